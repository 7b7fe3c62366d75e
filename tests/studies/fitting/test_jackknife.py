"""Jackknife interval of an optimum on linear curves with a known answer."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import t as student

from wm_drake.studies.fitting.jackknife import jackknife_interval
from wm_drake.studies.fitting.problem import NormProblem, Unknown


def linear(lower, upper, matrices, targets):
    """Return the problem of curves, matrix times point less target, of one or more groups."""
    unknowns = tuple(
        Unknown(f"x{k}", *ends) for k, ends in enumerate(zip(lower, upper, strict=True))
    )
    curves, end = [], 0
    for group, target in targets.items():
        for values in target:
            curves.append((group, slice(end, end + len(values))))
            end += len(values)
    matrix = np.concatenate([m.reshape(-1, m.shape[-1]) for m in matrices.values()])
    whole = np.concatenate([target.ravel() for target in targets.values()])
    return NormProblem(unknowns, lambda points: points @ matrix.T - whole, tuple(curves))


def test_interval_of_a_mean_is_that_of_the_textbook():
    """Measure one number by each curve; the optimum is their mean, standard error s / sqrt(m)."""
    values = np.array([1.0, 2.0, 4.0, 3.0, 7.0, 2.5])
    best = np.array([values.mean()])
    problem = linear([-100.0], [100.0], {"one": np.ones((6, 1, 1))}, {"one": values[:, None]})
    interval = jackknife_interval(problem, best)
    half = student.ppf(0.975, 5) * values.std(ddof=1) / np.sqrt(6.0)
    assert (interval.low, interval.high) == (pytest.approx(best - half), pytest.approx(best + half))


def test_interval_of_two_loads_is_that_of_repeated_searches():
    """Find each optimum without a curve by minimizing the norms directly, for linear curves."""
    rng = np.random.default_rng(4)
    matrix = {load: rng.normal(size=(3, 40, 2)) for load in ("a", "b")}
    target = {load: rng.normal(size=(3, 40)) + m @ [2.0, 1.0] for load, m in matrix.items()}

    def differences(point, out=None):
        interval = {load: matrix[load] @ point - target[load] for load in matrix}
        if out:
            interval[out[0]] = np.delete(interval[out[0]], out[1], axis=0)
        return interval

    def optimum(out=None):
        def distance(point):
            return sum(np.linalg.norm(d) for d in differences(point, out).values())

        options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000}
        return minimize(distance, [2.0, 1.0], method="Nelder-Mead", options=options).x

    best = optimum()
    interval = jackknife_interval(linear([0.0, -1.0], [4.0, 3.0], matrix, target), best)
    optima = np.array([optimum((load, index)) for load in matrix for index in range(3)])
    spread = np.sqrt(5.0 / 6.0 * np.sum((optima - optima.mean(axis=0)) ** 2, axis=0))
    half = student.ppf(0.975, 5) * spread
    assert interval.low == pytest.approx(best - half, rel=1e-5)
    assert interval.high == pytest.approx(best + half, rel=1e-5)


def test_interval_ends_at_the_bounds_and_needs_three_curves():
    values, ones = np.array([[-3.0], [0.0], [3.0]]), np.ones((3, 1, 1))
    problem = linear([0.0], [1.0], {"one": ones}, {"one": values})
    interval = jackknife_interval(problem, np.array([0.2]))
    assert (interval.low[0], interval.high[0]) == (0.0, 1.0)
    two = linear([0.0], [1.0], {"one": ones[:2]}, {"one": values[:2]})
    assert jackknife_interval(two, np.array([0.2])) is None
