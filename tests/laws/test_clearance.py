"""A shaft in a hole with play: hand values, continuity, power, symmetry, derivatives."""

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd

from wm_drake.compiler.compilation import generic
from wm_drake.laws import clearance

clearance_force = generic(clearance.clearance_force)
C, K, B = 1e-4, 2e7, 3e3  # m, N/m, N s/m
RNG = np.random.default_rng(11)


def test_within_the_clearance_there_is_no_force():
    for angle in np.linspace(0.0, 6.0, 7):
        d = 0.999 * C * np.array([np.cos(angle), np.sin(angle)])
        assert clearance_force(tuple(d), (1.0, -2.0), C, K, B) == (0.0, 0.0)
    assert clearance_force((0.0, 0.0), (1.0, 0.0), C, K, B) == (0.0, 0.0)


def test_without_a_clearance_there_is_no_contact():
    assert clearance_force((1e-3, 0.0), (0.0, 0.0), 0.0, K, B) == (0.0, 0.0)


def test_beyond_it_the_contact_pushes_towards_the_centre():
    force = clearance_force((0.9e-4, 1.2e-4), (0.0, 0.0), C, K, B)  # 50 um too far, along 3 : 4
    assert force == pytest.approx((-600.0, -800.0))
    # a tenth of the clearance and more: full damping, along the line of centres alone
    force = clearance_force((1.2e-4, 0.0), (0.1, 5.0), C, K, B)
    assert force == pytest.approx((-(400.0 + 300.0), 0.0), abs=1e-9)


def test_it_does_not_jump_where_the_shaft_touches_and_never_pulls():
    assert abs(clearance_force((C * (1 + 1e-9), 0.0), (10.0, 0.0), C, K, B)[0]) < 1e-2
    assert clearance_force((1.1e-4, 0.0), (-10.0, 0.0), C, K, B)[0] == 0.0


def test_power_is_what_is_stored_and_lost():
    for _ in range(200):
        d, v = RNG.uniform(-2e-4, 2e-4, 2), RNG.uniform(-0.05, 0.05, 2)
        force = np.array(clearance_force(tuple(d), tuple(v), C, K, B))
        rho = np.hypot(*d)
        e, rate = rho - C, d @ v / rho
        stored = K * e * rate if e > 0.0 else 0.0  # d(k e^2 / 2)/dt
        lost = -force @ v - stored
        assert lost >= -1e-9 or force @ force == 0.0
        if e > 0.0 and force.any():
            assert lost == pytest.approx(B * min(1.0, 10.0 * e / C) * rate**2)


def test_derivatives_are_those_of_finite_differences():
    for d in ([1.3e-4, -0.4e-4], [0.2e-4, 0.3e-4]):  # in contact and not
        v = np.array([0.02, 0.03])
        x = np.concatenate([d, v])

        def force(x):
            return np.array(clearance_force(tuple(x[:2]), tuple(x[2:]), C, K, B))

        steps = np.diag([1e-9, 1e-9, 1e-6, 1e-6])
        expected = np.column_stack([(force(x + s) - force(x - s)) / (2.0 * s.max()) for s in steps])
        exact = [AutoDiffXd(value, row) for value, row in zip(x, np.eye(4), strict=True)]
        found = clearance_force(tuple(exact[:2]), tuple(exact[2:]), C, K, B)
        for row, derivative in zip(found, expected, strict=True):
            gradient = row.derivatives() if isinstance(row, AutoDiffXd) else np.zeros(4)
            gradient = gradient if gradient.size else np.zeros(4)
            np.testing.assert_allclose(gradient, derivative, rtol=1e-5, atol=1e-3)
