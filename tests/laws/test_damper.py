"""Friction dampers along their line: [C] Eq. (2), (3), (7) and [A] Eq. (2)-(6) with a massless sponge."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from scipy.optimize import brentq

from wm_drake.compiler.compilation import generic
from wm_drake.elements.damper_law import damper_response
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.laws.damper import (
    free_stroke_damper,
    mstv_damper,
    mstv_sponge_with_mass,
    slider_rate,
    stv_sponge_damper,
)
from wm_drake.laws.friction import mstv_friction, stv_friction
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters import DAMPER_LAWS, ForceTable

K1, C1, C2 = 176e3, 90.0, 400.0  # N/m, N s/m, N s/m: fit of [C]
F_MAX, C_M, P_B, V_B = 35.0, 60.0, 10.5, 0.09  # N, N s/m, N, m/s: [A] Table 1
EPSILON = 1e-6  # m/s
SPONGE = packed_stiffness(
    ForceTable(  # free stroke of 8 mm to either side, then progressive; assumed
        displacement=(-0.02, -0.012, -0.008, 0.008, 0.012, 0.02),  # m
        force=(-120.0, -25.0, 0.0, 0.0, 25.0, 120.0),  # N
    )
)

# N; a force of 1e-300 N gives a slider rate below the smallest normal float
sponge_forces = st.just(0.0) | st.floats(1e-9, 500.0) | st.floats(-500.0, -1e-9)
velocities = st.just(0.0) | st.floats(-2.0, 2.0)  # m/s
full_forces = st.just(0.0) | st.floats(0.1, 200.0)  # N
dampings = st.just(0.0) | st.floats(1e-2, 1e4)  # N s/m
epsilons = st.floats(1e-8, 1e-3)  # m/s


@st.composite
def sliders(draw):
    """Draw velocity, dashpot, friction parameters of a slider whose rate is finite."""
    v, c, f_max, c_m, epsilon = (
        draw(s) for s in (velocities, dampings, full_forces, dampings, epsilons)
    )
    assume(c + c_m > 0.0)
    return v, c, f_max, c_m, epsilon


def least_and_largest_load(w, v, c, f_max, c_m, epsilon):
    """Return the loads b that hold the slider at w; two where MSTV friction jumps, |w| = |v - w|."""
    loads = [
        c * w - mstv_friction(w, (v - w) * (1.0 + turn), f_max, c_m, epsilon)
        for turn in (-1e-12, 1e-12)
    ]
    return min(loads), max(loads)


@given(b=sponge_forces, slider=sliders())
def test_slider_rate_balances_the_forces_on_the_slider(b, slider):
    v, c, f_max, c_m, _ = slider
    w = slider_rate(b, *slider)
    low, high = least_and_largest_load(w, *slider)
    tolerance = 1e-11 * (abs(b) + f_max + (c + c_m) * (abs(v) + abs(w)))
    assert low - tolerance <= b <= high + tolerance


@given(b=sponge_forces, slider=sliders())
def test_slider_rate_turns_its_sign_with_load_and_velocity(b, slider):
    v, *rest = slider
    assert slider_rate(-b, -v, *rest) == -slider_rate(b, v, *rest)
    assert slider_rate(b, v, *rest) * b >= 0.0


@given(loads=st.tuples(sponge_forces, sponge_forces), slider=sliders())
def test_slider_rate_rises_with_load(loads, slider):
    low, high = (slider_rate(b, *slider) for b in sorted(loads))
    assert low <= high + 1e-9 * (abs(low) + abs(high))


@given(loads=st.tuples(sponge_forces, sponge_forces), slider=sliders())
def test_slider_rate_is_no_more_sensitive_to_load_than_the_dashpot_allows(loads, slider):
    v, c, f_max, c_m, _ = slider
    assume(c > 0.0)
    low, high = sorted(loads)
    rise = slider_rate(high, *slider) - slider_rate(low, *slider)
    rounding = 1e-11 * (abs(low) + abs(high) + f_max + (c + c_m) * abs(v))
    assert rise <= (high - low + rounding) / c


@pytest.mark.parametrize(
    ("b", "v"),
    [
        (30.0, 0.1),
        (100.0, 0.1),
        (20.0, -0.1),
        (300.0, -0.1),
        (-30.0, 0.02),
        (-90.0, -0.05),
    ],  # N, m/s
)
@pytest.mark.parametrize("c_m", [0.0, 60.0, 900.0])  # N s/m; the last exceeds c1 + c2
def test_slider_rate_is_the_root_that_bisection_finds(b, v, c_m):
    c = C1 + C2

    def balance(w):
        return c * w - mstv_friction(w, v - w, 60.0, c_m, EPSILON) - b

    assert slider_rate(b, v, c, 60.0, c_m, EPSILON) == pytest.approx(
        brentq(balance, -2.0, 2.0, xtol=1e-15), rel=1e-9
    )


def test_slider_keeps_half_the_velocity_where_the_friction_jumps():
    v, c, f_max, epsilon = 0.1, 490.0, 60.0, 1e-3  # m/s, N s/m, N, m/s
    low, high = least_and_largest_load(0.5 * v, v, c, f_max, 0.0, epsilon)
    assert high - low == pytest.approx(f_max * epsilon / (0.5 * v + epsilon))
    assert slider_rate(0.5 * (low + high), v, c, f_max, 0.0, epsilon) == 0.5 * v
    assert (
        slider_rate(low - 0.1, v, c, f_max, 0.0, epsilon)
        < 0.5 * v
        < slider_rate(high + 0.1, v, c, f_max, 0.0, epsilon)
    )


def test_a_damper_at_constant_rate_comes_to_slip_and_no_further():
    deformation, rate, step = 0.0, 0.02, 1e-5  # m, m/s, s
    for _ in range(10_000):
        tension, deformation_rate = mstv_damper(rate, deformation, 60.0, 0.0, EPSILON, K1, C1, C2)
        deformation += step * deformation_rate
    assert tension == pytest.approx(60.0 + C2 * rate, rel=1e-6)


@given(rate=st.floats(-0.5, 0.5), deformation=st.floats(-0.008, 0.008))
def test_in_its_free_stroke_a_damper_has_basic_friction_only_and_the_sponge_stays(
    rate, deformation
):
    tension, deformation_rate = free_stroke_damper(
        rate, deformation, F_MAX, C_M, EPSILON, P_B, V_B, (SPONGE, 0)
    )
    basic = P_B * np.sin(0.5 * np.pi * np.clip(rate / V_B, -1.0, 1.0))
    assert tension == pytest.approx(basic, rel=1e-12, abs=1e-14)
    assert deformation_rate == rate


PACKED = {  # law -> its numbers in the order of its class
    "coulomb": [60.0, 25.0],  # f_max N, damping N s/m
    "stv": [60.0, 0.05, 25.0],  # f_max N, v_st m/s, damping N s/m
    "havsin": [P_B, V_B, 25.0],  # p N, v_t m/s, damping N s/m
    "mstv": [60.0, 30.0, EPSILON, K1, C1, C2],
    "stv_sponge": [60.0, 0.01, K1, C1, C2],  # f_max N, v_st m/s, k1 N/m, c1, c2 N s/m
    "free_stroke": [F_MAX, C_M, EPSILON, P_B, V_B, *SPONGE],
}


def direct_response(law, v, deformation):
    """Return tension and deformation rate, typed from the papers."""
    if law == "coulomb":
        return 25.0 * v + 60.0 * np.sign(v), 0.0
    if law == "stv":
        return 25.0 * v + 60.0 * np.clip(v / 0.05, -1.0, 1.0), 0.0
    if law == "havsin":
        return 25.0 * v + P_B * np.sin(0.5 * np.pi * np.clip(v / V_B, -1.0, 1.0)), 0.0
    if law == "mstv":
        w = brentq(
            lambda w: (
                C2 * w
                - mstv_friction(w, v - w, 60.0, 30.0, EPSILON)
                - K1 * deformation
                - C1 * (v - w)
            ),
            -9.0,
            9.0,
        )
        return K1 * deformation + C1 * (v - w), v - w
    if law == "stv_sponge":
        w = brentq(
            lambda w: C2 * w - stv_friction(w, 0.01, 60.0) - K1 * deformation - C1 * (v - w),
            -9.0,
            9.0,
            xtol=1e-15,
        )
        return K1 * deformation + C1 * (v - w), v - w
    f_d = stiffness_force(deformation, SPONGE, 0)
    w = brentq(lambda w: -mstv_friction(w, v - w, F_MAX, C_M, EPSILON) - f_d, -9.0, 9.0)
    return f_d + P_B * np.sin(0.5 * np.pi * np.clip(v / V_B, -1.0, 1.0)), v - w


def test_every_registered_law_is_tested_here():
    assert set(PACKED) == set(DAMPER_LAWS)


@pytest.mark.parametrize("law", PACKED)
@pytest.mark.parametrize("rate", [-0.3, -0.04, -1e-3, 0.02, 0.2])  # m/s
def test_each_law_answers_by_its_number_as_its_formula_does(law, rate):
    packed = np.array([9.9, 9.9, 9.9, DAMPER_LAWS[law].number, *PACKED[law]])
    for deformation in (-0.013, -3.1e-4, 2.2e-4, 0.015):  # m
        response = damper_response(rate, deformation, packed, 3)
        assert response == pytest.approx(
            direct_response(law, rate, deformation), rel=1e-9, abs=1e-9
        )


@given(
    rate=velocities,
    deformation=st.floats(-2e-3, 2e-3),
    f_max=full_forces,
    c_m=dampings,
    c1=dampings,
    c2=dampings,
)
def test_the_mstv_damper_never_gives_back_more_than_its_sponge_stores(
    rate, deformation, f_max, c_m, c1, c2
):
    assume(c1 + c2 + c_m > 0.0)
    tension, deformation_rate = mstv_damper(rate, deformation, f_max, c_m, EPSILON, K1, c1, c2)
    stored = K1 * deformation * deformation_rate  # W: rate of k1 delta^2/2
    assert tension * rate - stored >= -1e-10 * (abs(tension * rate) + abs(stored))


@given(
    rate=velocities,
    deformation=st.floats(-2e-3, 2e-3),
    f_max=full_forces,
    v_st=velocities,
    c1=dampings,
    c2=dampings,
)
def test_the_damper_with_stv_sponge_never_gives_back_more_than_its_sponge_stores(
    rate, deformation, f_max, v_st, c1, c2
):
    assume(c1 + c2 > 0.0)
    tension, deformation_rate = stv_sponge_damper(rate, deformation, f_max, abs(v_st), K1, c1, c2)
    stored = K1 * deformation * deformation_rate  # W
    # W, of which tension is a difference
    parts = (K1 * abs(deformation) + c1 * abs(rate)) * (abs(rate) + abs(deformation_rate))
    assert tension * rate - stored >= -1e-12 * parts


def test_under_coulomb_friction_the_slider_holds_up_to_full_friction_and_then_slips():
    for deformation, w in (
        (59.9 / K1, 0.0),
        (-60.0 / K1, 0.0),
        (70.0 / K1, 10.0 / 490.0),
        (-109.0 / K1, -0.1),
    ):  # m, m/s
        tension, deformation_rate = stv_sponge_damper(0.0, deformation, 60.0, 0.0, K1, C1, C2)
        assert -deformation_rate == pytest.approx(w, abs=1e-12)
        assert tension == pytest.approx(K1 * deformation - C1 * w)


@given(rate=velocities, deformation=st.floats(-0.03, 0.03))
def test_the_free_stroke_damper_never_gives_back_more_than_its_sponge_stores(rate, deformation):
    tension, deformation_rate = free_stroke_damper(
        rate, deformation, F_MAX, C_M, EPSILON, P_B, V_B, (SPONGE, 0)
    )
    stored = stiffness_force(deformation, SPONGE, 0) * deformation_rate  # W
    assert tension * rate - stored >= -1e-10 * (abs(tension * rate) + abs(stored))


def test_derivatives_of_a_free_stroke_damper_without_main_friction_are_finite():
    # m, N
    sponge = packed_stiffness(
        ForceTable(displacement=(-0.02, -0.008, 0.008, 0.02), force=(-90.0, 0.0, 0.0, 120.0))
    )
    rate, deformation = InitializeAutoDiff(np.array([0.1, 0.0])).ravel()  # m/s, m
    _, deformation_rate = generic(free_stroke_damper)(
        rate, deformation, 0.0, 60.0, 1e-6, 10.5, 0.09, (sponge, 0)
    )
    assert np.all(np.isfinite(ExtractGradient(np.array([[deformation_rate]]))))


@given(
    deformation=st.floats(-5e-3, 5e-3),
    v=velocities,
    w_before=st.floats(-2.0, 2.0),
    step=st.floats(1e-7, 1e-2),
    mass=st.floats(1e-6, 1.0),
    f_max=full_forces,
)
def test_step_of_heavy_sponge_keeps_momentum(deformation, v, w_before, step, mass, f_max):
    """Check m (w - w0) / h: all forces at the end of the step, [C] (2), (3)."""
    tension, w = mstv_sponge_with_mass(
        deformation, v, w_before, step, mass, f_max, 0.0, EPSILON, K1, C1, C2
    )
    assert tension == pytest.approx(
        K1 * (deformation - step * w) + C1 * (v - w), rel=1e-9, abs=1e-9
    )
    inertia = mass * (w - w_before) / step
    # friction jumps where |w| = |v - w|: the balance holds between its two values there
    frictions = [
        mstv_friction(w, (v - w) * (1.0 + turn), f_max, 0.0, EPSILON) for turn in (-1e-9, 1e-9)
    ]
    size = abs(K1 * deformation) + abs(C1 * v) + abs(mass * w_before / step) + f_max
    room = 1e-6 * size + 1e-9
    friction = inertia - tension + C2 * w
    if w == 0.0 and v == 0.0:
        assert abs(friction) <= f_max + room
    else:
        assert min(frictions) - room <= friction <= max(frictions) + room


def test_step_of_heavy_sponge_without_mass_is_that_of_massless_damper():
    tension, w = mstv_sponge_with_mass(2e-4, 0.03, 0.5, 1e-12, 0.0, 60.0, 0.0, EPSILON, K1, C1, C2)
    expected, rate = mstv_damper(0.03, 2e-4, 60.0, 0.0, EPSILON, K1, C1, C2)
    assert tension == pytest.approx(expected, rel=1e-9)
    assert 0.03 - w == pytest.approx(rate, rel=1e-9)
