"""Jackknife interval of an optimum on linear curves with a known answer."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import t as student

from wm_drake.studies.gasket_damping.uncertainty import (
    Curve,
    curves_of,
    difference_points,
    jackknife_interval,
)


def test_interval_of_a_mean_is_that_of_the_textbook():
    """Measure one number by each curve; the optimum is their mean, standard error s / sqrt(m)."""
    values = np.array([1.0, 2.0, 4.0, 3.0, 7.0, 2.5])
    lower, upper = np.array([-100.0]), np.array([100.0])
    best = np.array([values.mean()])
    curves = [Curve("one", best - value, np.array([[200.0]])) for value in values]
    found = jackknife_interval(best, lower, upper, curves)
    half = student.ppf(0.975, 5) * values.std(ddof=1) / np.sqrt(6.0)
    assert (found.low, found.high) == (pytest.approx(best - half), pytest.approx(best + half))


def test_interval_of_two_loads_is_that_of_repeated_searches():
    """Find each optimum without a curve by minimizing the norms directly, for linear curves."""
    rng = np.random.default_rng(4)
    lower, upper = np.array([0.0, -1.0]), np.array([4.0, 3.0])
    matrix = {load: rng.normal(size=(3, 40, 2)) for load in ("a", "b")}
    target = {load: rng.normal(size=(3, 40)) + m @ [2.0, 1.0] for load, m in matrix.items()}

    def differences(point, out=None):
        found = {load: matrix[load] @ point - target[load] for load in matrix}
        if out:
            found[out[0]] = np.delete(found[out[0]], out[1], axis=0)
        return found

    def optimum(out=None):
        def distance(point):
            return sum(np.linalg.norm(d) for d in differences(point, out).values())

        options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000}
        return minimize(distance, [2.0, 1.0], method="Nelder-Mead", options=options).x

    best = optimum()
    points = difference_points(best, lower, upper)
    curves = curves_of([differences(point) for point in points], points, upper - lower)
    found = jackknife_interval(best, lower, upper, curves)
    optima = np.array([optimum((load, index)) for load in matrix for index in range(3)])
    spread = np.sqrt(5.0 / 6.0 * np.sum((optima - optima.mean(axis=0)) ** 2, axis=0))
    half = student.ppf(0.975, 5) * spread
    assert found.low == pytest.approx(best - half, rel=1e-5)
    assert found.high == pytest.approx(best + half, rel=1e-5)


def test_interval_ends_at_the_bounds_and_needs_three_curves():
    lower, upper = np.array([0.0]), np.array([1.0])
    curves = [Curve("one", np.array([r]), np.array([[1.0]])) for r in (-3.0, 0.0, 3.0)]
    found = jackknife_interval(np.array([0.2]), lower, upper, curves)
    assert (found.low[0], found.high[0]) == (0.0, 1.0)
    assert jackknife_interval(np.array([0.2]), lower, upper, curves[:2]) is None
