"""A foot on the floor: hand values, sticking without creep, continuity, and the balance of power."""

import numpy as np
import pytest

from wm_drake.compiler.compilation import generic
from wm_drake.laws import foot_contact

pad_normal_force = generic(foot_contact.pad_normal_force)
pad_friction = generic(foot_contact.pad_friction)
K, C, GROWTH = 200e3, 400.0, 2e3  # N/m, N s/m, 1/m
RNG = np.random.default_rng(3)


def test_normal_force_of_a_pad():
    assert pad_normal_force(1e-3, 0.0, K, C, GROWTH) == pytest.approx(200.0)
    assert pad_normal_force(1e-3, 0.1, K, C, GROWTH) == pytest.approx(240.0)
    assert pad_normal_force(0.25e-3, 0.1, K, C, GROWTH) == pytest.approx(50.0 + 20.0)  # half share
    assert pad_normal_force(-1e-6, 5.0, K, C, GROWTH) == 0.0  # above the floor
    assert pad_normal_force(1e-3, -1.0, K, C, GROWTH) == 0.0  # it does not pull
    assert pad_normal_force(1e-12, 5.0, K, C, GROWTH) < 1e-5  # no jump where it touches


def test_below_the_limit_the_pad_sticks_and_does_not_creep():
    f_x, f_y, w_x, w_y = pad_friction((1e-3, -2e-3), (0.02, 0.1), K, C, 600.0)
    assert (f_x, f_y) == pytest.approx((-208.0, 360.0))
    assert (w_x, w_y) == (0.0, 0.0)


def test_above_the_limit_it_slides_along_the_force_and_holds_the_limit():
    shear, velocity, limit = np.array([1e-3, 0.0]), np.array([0.0, 0.5]), 100.0
    f_x, f_y, w_x, w_y = pad_friction(shear, velocity, K, C, limit)
    assert np.hypot(f_x, f_y) == pytest.approx(limit)
    assert f_x / f_y == pytest.approx(1.0)
    rate = velocity - (w_x, w_y)
    np.testing.assert_allclose(K * shear + C * rate, (-f_x, -f_y))  # spring and damper
    assert w_x * f_y - w_y * f_x == pytest.approx(0.0, abs=1e-12)


def test_it_is_continuous_where_sliding_begins():
    at = 250.0 / K
    before, after = (
        pad_friction(((1.0 + sign * 1e-9) * at, 0.0), (0.0, 0.0), K, C, 250.0) for sign in (-1, 1)
    )
    np.testing.assert_allclose(after, before, atol=1e-6)


def test_power_goes_to_spring_damper_and_friction():
    """Check -F . v = d(k s^2 / 2)/dt + c |s'|^2 + mu N |w| at any state."""
    for _ in range(200):
        shear, v = RNG.uniform(-2e-3, 2e-3, 2), RNG.uniform(-0.5, 0.5, 2)
        limit = RNG.uniform(0.0, 500.0)
        f_x, f_y, w_x, w_y = pad_friction(tuple(shear), tuple(v), K, C, limit)
        rate, w = v - (w_x, w_y), np.hypot(w_x, w_y)
        dissipated = C * rate @ rate + limit * w
        assert -(f_x * v[0] + f_y * v[1]) == pytest.approx(K * shear @ rate + dissipated)
        assert dissipated >= 0.0


def test_a_lifted_foot_holds_nothing_and_springs_back():
    f_x, f_y, w_x, _ = pad_friction((1e-3, 0.0), (0.0, 0.0), K, C, 0.0)
    assert (f_x, f_y) == (0.0, 0.0)
    assert w_x == pytest.approx(1e-3 * K / C)
