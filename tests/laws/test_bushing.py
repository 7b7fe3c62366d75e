"""Six-component bushing: [A] Eq. (7), (8) along and about three axes, without leaks of energy."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wm_drake.elements.bushing import BUSHING_LAW, read_bushing_law
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.laws import bushing
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters.elements import ForceTable

ZERO = (0.0, 0.0, 0.0)
STIFFNESS = (8e3, 3e3, 8e3)  # N/m: gasket, [A] Table 8
ROTATIONAL_STIFFNESS = (73.0, 890.0, 250.0)  # N m/rad; the third differs to break symmetry
DAMPING = (50.0, 10.0, 50.0)  # N s/m
ROTATIONAL_DAMPING = (3.0, 5.0, 7.0)  # N m s/rad
FRICTION_TORQUE = (3.7, 2.0, 1.0)  # N m
FULL_FRICTION_RATE = (1.5, 1.0, 0.5)  # rad/s
# m, N
CURVE = ForceTable(displacement=(-0.01, -0.002, 0.003, 0.01), force=(-60.0, -4.0, 5.0, 80.0))

vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


def packed(damping=ZERO, rotational_damping=ZERO, friction=ZERO, curves=(0.0,) * 6):
    kinds = {
        "damping": damping,
        "rotational_damping": rotational_damping,
        "friction_torque": friction,
        "full_friction_rate": FULL_FRICTION_RATE,
        "stiffness": [packed_stiffness(curve) for curve in curves[:3]],
        "rotational_stiffness": [packed_stiffness(curve) for curve in curves[3:]],
    }
    return BUSHING_LAW.pack(
        **{
            f"{kind}_{axis}": value
            for kind, values in kinds.items()
            for axis, value in zip("xyz", values, strict=True)
        }
    )


def bushing_force(d, d_rate, r, w, p, at):
    return bushing.bushing_force(d, d_rate, r, w, read_bushing_law(p, at))


ELASTIC = packed(curves=(STIFFNESS[0], CURVE, STIFFNESS[2], *ROTATIONAL_STIFFNESS))
LOSSY = packed(DAMPING, ROTATIONAL_DAMPING, FRICTION_TORQUE)


def angular_velocity(r, r_rate):
    """Return the rate of the rotation exp(r) in the fixed frame, by the left Jacobian of the exponential map."""
    angle = np.linalg.norm(r)
    first, second = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return r_rate + first * np.cross(r, r_rate) + second * np.cross(r, np.cross(r, r_rate))


def closed_path(count=400):
    """Return displacement, rotation vector and rates over a closed path, up to 2 rad. [m, rad, 1/s]"""
    s = 2.0 * np.pi * np.arange(count) / count
    d = 0.008 * np.column_stack([np.sin(s), np.cos(2 * s), np.sin(s + 1.0)])
    d_rate = 0.008 * np.column_stack([np.cos(s), -2 * np.sin(2 * s), np.cos(s + 1.0)])
    r = np.column_stack([1.2 * np.cos(s), 0.9 * np.sin(s) + 0.3, 1.1 * np.sin(2 * s + 0.4)])
    r_rate = np.column_stack([-1.2 * np.sin(s), 0.9 * np.cos(s), 2.2 * np.cos(2 * s + 0.4)])
    return d, d_rate, r, r_rate


def test_hand_values_along_and_about_one_axis():
    p = packed(DAMPING, ROTATIONAL_DAMPING, FRICTION_TORQUE, (*STIFFNESS, *ROTATIONAL_STIFFNESS))
    force, moment = bushing_force(
        (0.01, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.5, 0.0), p, 0
    )
    # N: 8 N/mm * 10 mm, 0.05 N s/mm * 200 mm/s
    assert force == pytest.approx((-80.0 - 10.0, 0.0, 0.0))
    friction = 2.0 * np.sin(np.pi / 4)  # N m: half the rate of full friction
    assert moment == pytest.approx((0.0, -89.0 - 2.5 - friction, 0.0))  # N m


def test_no_force_at_zero():
    p = packed(DAMPING, ROTATIONAL_DAMPING, FRICTION_TORQUE, (*STIFFNESS, *ROTATIONAL_STIFFNESS))
    assert bushing_force(ZERO, ZERO, ZERO, ZERO, p, 0) == (ZERO, ZERO)


def test_curves_of_different_length_serve_their_own_axis():
    curves = (CURVE, 1e3, CURVE, 50.0, 60.0, 70.0)
    p = np.concatenate([[9.9, 9.9], packed(curves=curves)])
    force, moment = bushing_force((0.005, 0.006, -0.007), ZERO, (0.0, 0.0, 0.02), ZERO, p, 2)
    expected = [
        -stiffness_force(x, packed_stiffness(c), 0)
        for x, c in zip((0.005, 0.006, -0.007), curves[:3], strict=True)
    ]
    assert force == pytest.approx(expected)
    assert moment == pytest.approx((0.0, 0.0, -1.4))  # N m


def test_elastic_energy_comes_back_around_a_closed_path_of_large_rotations():
    powers, naive_powers = [], []
    for d, d_rate, r, r_rate in zip(*closed_path(), strict=True):
        w = angular_velocity(r, r_rate)
        force, moment = bushing_force(tuple(d), tuple(d_rate), tuple(r), tuple(w), ELASTIC, 0)
        powers.append(np.dot(force, d_rate) + np.dot(moment, w))
        naive_powers.append(-np.dot(np.multiply(ROTATIONAL_STIFFNESS, r), w))
    exchanged = np.mean(np.abs(powers))
    # the curve has jumps of curvature: the sum is not exact to rounding
    assert abs(np.mean(powers)) < 1e-6 * exchanged
    # the torque on the rotation vector taken for a moment would leak
    assert abs(np.mean(naive_powers)) > 1e-2 * exchanged


def test_elastic_power_is_the_loss_of_stored_energy():
    for d, d_rate, r, r_rate in zip(*closed_path(7), strict=True):
        w = angular_velocity(r, r_rate)
        force, moment = bushing_force(tuple(d), tuple(d_rate), tuple(r), tuple(w), ELASTIC, 0)
        along = [
            STIFFNESS[0] * d[0],
            stiffness_force(d[1], packed_stiffness(CURVE), 0),
            STIFFNESS[2] * d[2],
        ]
        stored = np.dot(along, d_rate) + np.dot(np.multiply(ROTATIONAL_STIFFNESS, r), r_rate)  # W
        assert np.dot(force, d_rate) + np.dot(moment, w) == pytest.approx(-stored, rel=1e-11)


@given(d=vectors, d_rate=vectors, r=vectors, w=vectors)
def test_damping_and_friction_never_feed_energy_in(d, d_rate, r, w):
    assume(np.linalg.norm(r) < 3.0)
    force, moment = bushing_force(d, d_rate, r, w, LOSSY, 0)
    assert np.dot(force, d_rate) <= 0.0
    assert np.dot(moment, w) <= 1e-12 * (1.0 + np.dot(w, w))


@given(d=vectors, d_rate=vectors, r=vectors, w=vectors)
def test_reversing_the_rates_reverses_damping_and_friction(d, d_rate, r, w):
    assume(np.linalg.norm(r) < 3.0)
    there = bushing_force(d, d_rate, r, w, LOSSY, 0)
    back = bushing_force(d, tuple(-x for x in d_rate), r, tuple(-x for x in w), LOSSY, 0)
    assert np.array_equal(np.negative(back), there)
