"""Massless strut and the bushings at its ends (Hooke joints of [B] section 3)."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wm_drake.elements.strut import transverse
from wm_drake.laws.friction import havsin_friction
from wm_drake.laws.strut import bending_moment, transverse_couple

ZERO = (0.0, 0.0, 0.0)
K, C, P, V_T = 12.0, 0.3, 0.9, 0.5  # N m/rad, N m s/rad, N m, rad/s

directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1)
rates = st.tuples(*[st.floats(-3.0, 3.0)] * 3)  # rad/s


def unit(a):
    return np.asarray(a) / np.linalg.norm(a)


def turned(a, rotation_vector):
    return Rotation.from_rotvec(rotation_vector).apply(a)


def angle_between(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))


def test_no_moment_at_rest():
    axis = tuple(map(float, unit((1.0, 2.0, -4.0))))
    assert bending_moment(axis, ZERO, axis, K, C, P, V_T) == pytest.approx(ZERO, abs=1e-15)


def test_a_bent_strut_is_pushed_back_with_stiffness_times_angle():
    for angle in (1e-6, 0.02, 0.6, 2.0):  # rad
        # turned by angle about y, away from z
        direction = (float(np.sin(angle)), 0.0, float(np.cos(angle)))
        moment = bending_moment(direction, ZERO, (0.0, 0.0, 1.0), K, 0.0, 0.0, V_T)
        assert moment == pytest.approx((0.0, -K * angle, 0.0), rel=1e-12, abs=1e-18)


def test_hand_values_of_damping_and_friction():
    z = (0.0, 0.0, 1.0)
    slow = bending_moment(z, (V_T / 2, 0.0, 0.0), z, 0.0, C, P, V_T)
    assert slow == pytest.approx((-0.3 * 0.25 - 0.9 * np.sin(np.pi / 4), 0.0, 0.0))
    # the body turns under a strut at rest
    fast = bending_moment(z, (0.0, -2.0, 0.0), z, 0.0, C, P, V_T)
    assert fast == pytest.approx((0.0, 0.3 * 2.0 + 0.9, 0.0))


@given(axis=directions, direction=directions, w_strut=rates, w_body=rates)
def test_elastic_power_is_minus_the_rate_of_half_k_angle_squared(axis, direction, w_strut, w_body):
    axis, direction, w_strut, w_body = (
        unit(axis),
        unit(direction),
        np.array(w_strut),
        np.array(w_body),
    )
    assume(angle_between(axis, direction) < 3.0)
    w_strut = w_strut - (w_strut @ direction) * direction
    rate = transverse(tuple(w_strut - w_body), tuple(direction))
    moment = bending_moment(tuple(direction), rate, tuple(axis), K, 0.0, 0.0, V_T)
    h = 1e-5  # s

    def energy(t):
        return (
            0.5 * K * angle_between(turned(axis, w_body * t), turned(direction, w_strut * t)) ** 2
        )

    assert np.dot(moment, w_strut - w_body) == pytest.approx(
        (energy(-h) - energy(h)) / (2.0 * h), rel=1e-6, abs=1e-6
    )


@given(axis=directions, direction=directions, w=rates)
def test_damping_and_friction_dissipate(axis, direction, w):
    rate = transverse(w, tuple(unit(direction)))
    moment = bending_moment(tuple(unit(direction)), rate, tuple(unit(axis)), 0.0, C, P, V_T)
    assert np.dot(moment, w) <= 1e-12
    assert abs(np.dot(moment, unit(direction))) <= 1e-13 * (1.0 + np.linalg.norm(moment))


@given(direction=directions, spin=st.floats(-3.0, 3.0))
def test_spin_about_the_struts_own_axis_is_free(direction, spin):
    direction = tuple(map(float, unit(direction)))
    rate = transverse(tuple(spin * e for e in direction), direction)
    moment = bending_moment(direction, rate, direction, K, C, P, V_T)
    assert moment == pytest.approx(ZERO, abs=1e-13)


# rad/s
@pytest.mark.parametrize(
    "rate", [0.0, 1e-9, 0.3 * V_T, 0.999999 * V_T, V_T, 1.000001 * V_T, 5.0 * V_T]
)
def test_bending_friction_is_that_of_havsin(rate):
    z = (0.0, 0.0, 1.0)
    assert bending_moment(z, (rate, 0.0, 0.0), z, 0.0, 0.0, P, V_T)[0] == pytest.approx(
        havsin_friction(rate, V_T, P), rel=1e-14
    )


# rad; the series gives way at sin = 0.1
@pytest.mark.parametrize("angle", [0.0999999, 0.1001674, 0.1001675, 0.11])
def test_bending_is_smooth_where_the_series_gives_way_to_the_arctangent(angle):
    direction = (float(np.sin(angle)), 0.0, float(np.cos(angle)))
    assert bending_moment(direction, ZERO, (0.0, 0.0, 1.0), K, 0.0, 0.0, V_T)[1] == pytest.approx(
        -K * angle, rel=1e-14
    )


@given(direction=directions, m_tub=rates, m_housing=rates, length=st.floats(0.05, 0.5))
def test_transverse_couple_balances_the_moments_on_the_strut(direction, m_tub, m_housing, length):
    e = unit(direction)
    moments = np.array(m_tub) + m_housing
    moments = moments - (moments @ e) * e  # N m, transverse as those of the end bushings
    on_tub = np.array(transverse_couple(tuple(moments), tuple(e), 1.0 / length))
    on_strut = -on_tub  # at the tub end, L e from the housing end
    np.testing.assert_allclose(
        moments + np.cross(length * e, on_strut), 0.0, atol=1e-14 * (1.0 + np.linalg.norm(moments))
    )
    assert on_tub @ e == pytest.approx(0.0, abs=1e-12)
