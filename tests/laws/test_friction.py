"""Friction laws: [A] Eq. (2)-(4), [C] Eq. (4), (6), (7), as corrected in the project's physics notes."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wm_drake.laws.friction import coulomb_friction, havsin_friction, mstv_friction, stv_friction

ONE_VELOCITY_LAWS = {
    "coulomb": lambda v, _, f_max: coulomb_friction(v, f_max),
    "stv": stv_friction,
    "havsin": havsin_friction,
}
every_law = pytest.mark.parametrize("law", ONE_VELOCITY_LAWS.values(), ids=ONE_VELOCITY_LAWS)

velocities = st.floats(-2.0, 2.0)  # m/s
transitions = st.floats(1e-6, 1.0)  # m/s
forces = st.floats(0.0, 200.0)  # N
dampings = st.floats(0.0, 500.0)  # N s/m
epsilons = st.floats(1e-9, 1e-3)  # m/s


def havsin_of_the_paper(x, x0, h0, x1, h1):
    """Return [A] Eq. (3), with pi inside the sine and (h1 - h0)/2 before it."""
    if x <= x0:
        return h0
    if x >= x1:
        return h1
    return (h0 + h1) / 2 + (h1 - h0) / 2 * np.sin(np.pi * (x - x0) / (x1 - x0) - np.pi / 2)


def test_hand_values():
    assert coulomb_friction(0.1, 60.0) == -60.0  # N
    assert coulomb_friction(0.0, 60.0) == 0.0
    # a third of the transition velocity
    assert stv_friction(0.03, 0.09, 60.0) == pytest.approx(-20.0)
    # [A] Table 1: sin(30 deg) of 10.5 N
    assert havsin_friction(0.03, 0.09, 10.5) == pytest.approx(-5.25)
    # slips: 35 N + 60 N s/m * 0.1 m/s
    assert mstv_friction(0.1, 0.05, 35.0, 60.0, 1e-6) == pytest.approx(-41.0)
    # sticks: 38 N * 0.05/0.2
    assert mstv_friction(0.05, 0.199999, 35.0, 60.0, 1e-6) == pytest.approx(-9.5)


@every_law
@given(v=velocities, v_t=transitions, f_max=forces)
def test_is_odd_dissipates_and_stays_below_the_full_force(law, v, v_t, f_max):
    f = law(v, v_t, f_max)
    assert law(-v, v_t, f_max) == -f
    assert f * v <= 0.0
    assert abs(f) <= f_max * (1.0 + 1e-15)


@every_law
@given(v=velocities, v_t=transitions, f_max=forces)
def test_is_full_beyond_the_transition(law, v, v_t, f_max):
    assume(abs(v) >= v_t)
    assert law(v, v_t, f_max) == -f_max * np.sign(v)


@given(w=velocities, u=velocities, f_max=forces, c_m=dampings, epsilon=epsilons)
def test_mstv_is_odd_in_both_velocities_dissipates_and_stays_below_the_full_force(
    w, u, f_max, c_m, epsilon
):
    f = mstv_friction(w, u, f_max, c_m, epsilon)
    assert mstv_friction(-w, -u, f_max, c_m, epsilon) == -f
    assert mstv_friction(w, -u, f_max, c_m, epsilon) == f
    assert f * w <= 0.0
    assert abs(f) <= (f_max + c_m * abs(w)) * (1.0 + 1e-15)


@given(v=velocities, v_t=transitions, p=forces)
def test_havsin_equals_the_corrected_formula_of_the_paper(v, v_t, p):
    assert havsin_friction(v, v_t, p) == pytest.approx(
        havsin_of_the_paper(v, -v_t, p, v_t, -p), rel=1e-12, abs=1e-14 * p
    )


@given(v_t=transitions, p=forces)
def test_havsin_meets_its_full_force_smoothly(v_t, p):
    inside, outside = v_t * (1.0 - 1e-6), v_t * (1.0 + 1e-6)
    assert havsin_friction(inside, v_t, p) == pytest.approx(
        havsin_friction(outside, v_t, p), rel=2e-12
    )
    slope = (havsin_friction(outside, v_t, p) - havsin_friction(inside, v_t, p)) / (
        outside - inside
    )
    assert abs(slope) <= 1e-5 * p / v_t


@given(v=st.floats(1e-9, 2.0), f_max=forces, sign=st.sampled_from([-1.0, 1.0]))
def test_stv_tends_to_coulomb_friction(v, f_max, sign):
    assert stv_friction(sign * v, 1e-9, f_max) == coulomb_friction(sign * v, f_max)
    assert stv_friction(0.0, 1e-9, f_max) == coulomb_friction(0.0, f_max) == 0.0


@given(w=velocities, u=velocities, f_max=forces, epsilon=epsilons)
def test_mstv_without_growth_equals_the_corrected_formula_of_the_paper(w, u, f_max, epsilon):
    sticks = -f_max * w / (abs(u) + epsilon)  # [C] Eq. (7), second branch, sign corrected
    expected = -f_max * np.sign(w) if abs(w) >= abs(u) else sticks
    assert mstv_friction(w, u, f_max, 0.0, epsilon) == pytest.approx(expected, rel=1e-14, abs=0.0)


@given(u=st.floats(0.01, 2.0), f_max=forces, c_m=dampings, epsilon=epsilons)
def test_mstv_jumps_by_epsilon_over_the_deformation_rate_where_it_begins_to_slip(
    u, f_max, c_m, epsilon
):
    sticks = mstv_friction(u * (1.0 - 1e-15), u, f_max, c_m, epsilon)
    slips = mstv_friction(u, u, f_max, c_m, epsilon)
    assert slips - sticks == pytest.approx(
        slips * epsilon / (u + epsilon), abs=1e-12 * (f_max + c_m * u)
    )
