"""Errors of tests that a fit has not seen."""

from collections.abc import Callable, Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.assessment import central_differences
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.problem import FitProblem, rmse
from wm_drake.studies.fitting.search import Search, descended

SEEN = 1e-10
"""Smallest eigenvalue, by the largest, of the information in the other tests about a direction that
is searched anew without a test. In other directions the fit to all tests is kept."""

FAR = 0.05
"""Change of an unknown, in ranges, above which one step is not trusted and the fit is repeated."""

MOST_STEPS = 20
"""Most steps of a search without one test."""


def left_out_errors(fit: Fit, part: Callable[[Sequence[int]], FitProblem]) -> FloatArray:
    """Return the RMSE of each test at the fit to all the other tests (m,).

    The fit without a test is one Gauss-Newton step away from the fit to all tests; for a model that
    is linear in its unknowns this is exact. A step that is long is replaced by a search by least
    squares. The error at its end is that of the model itself.

    Args:
        fit: Fit to all tests, at least two.
        part: Function of the indices of some tests that returns the problem with these tests only.
    """
    problem = fit.problem
    count = len(problem.measurements)
    if not problem.unknowns:
        return np.array([test.rmse for test in fit.tests])
    point = np.clip(problem.coordinates_of(fit.values), 0.0, 1.0)
    residuals = problem.residuals(point[None])[0]
    jacobian, _ = central_differences(problem, point, residuals)
    free = [k for k, estimate in enumerate(fit.estimates) if not estimate.at_bound]
    jacobian = jacobian[:, free]
    information, slope = jacobian.T @ jacobian, jacobian.T @ residuals
    errors = np.empty(count)
    for index, where in enumerate(problem.slices):
        rows = jacobian[where]
        inverse = np.linalg.pinv(information - rows.T @ rows, rcond=SEEN, hermitian=True)
        moved = point.copy()
        moved[free] -= inverse @ (slope - rows.T @ residuals[where])
        if np.max(np.abs(moved - point)) > FAR:
            rest = part([k for k in range(count) if k != index])
            moved = descended(Search(rest), point, MOST_STEPS).point
        left_out = part([index])
        error = rmse(left_out.residuals(np.clip(moved, 0.0, 1.0)[None])[0])
        errors[index] = float(error) * left_out.measurements[0].scale
    return errors
