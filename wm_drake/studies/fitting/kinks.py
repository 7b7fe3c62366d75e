"""Searches of problems with priors whose residuals have kinks, such as amplitudes (largest values).

Coarse differences of the smooth residuals pass a kink at which fine ones would stop.
"""

import itertools

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import FAILED, PriorProblem
from wm_drake.studies.fitting.search import AnyProblem, Optimum, Search

DIFFERENCE_STEPS = (0.1, 0.3, 0.03)
"""Step sizes of the finite differences of the Jacobian, in standard deviations of the prior.

The first is larger than the noise of amplitudes that comes from sampling. The others are tried
where the search stops at a kink of the residuals.
"""

LEAST_GAIN = 0.01
"""A search ends when no difference step reduces the cost by this fraction."""

START_SPREAD = 0.7
"""Standard deviation of random starts around the first one, in prior deviations."""

DRAWS = 24
"""Usual number of points that are drawn for a random start; the best one is used.

This costs less than one Jacobian and saves several of them.
"""


def start_number(
    search: Search[PriorProblem], number: int, seed: int, draws: int = DRAWS
) -> FloatArray:
    """Return the start with a number.

    Start 0 is that of the problem. Each other start is the best of some points that are drawn
    around it.
    """
    begin = search.clipped(search.problem.start)
    if number == 0:
        return begin
    generator = np.random.default_rng([seed, number])
    return best_near(search, begin, START_SPREAD, generator, draws)


def best_near(
    search: Search[PriorProblem],
    point: FloatArray,
    spread: float,
    generator: np.random.Generator,
    draws: int = DRAWS,
) -> FloatArray:
    """Return the best of some points that are drawn around a point.

    Args:
        point: (p,) centre of the normal distribution.
        spread: Standard deviation of each coordinate.
    """
    points = search.clipped(point + generator.normal(0.0, spread, (draws, len(point))))
    return np.asarray(points[int(np.argmin(search.costs(points)))])


def smooth_jacobian(
    search: Search[AnyProblem], point: FloatArray, step: float = DIFFERENCE_STEPS[0]
) -> FloatArray:
    """Return the Jacobian (n, p) of the smooth residuals at a point.

    It is computed by forward differences, or by backward differences near the upper bound. It is 0
    where a residual is NaN.
    """
    steps = np.where(point + step <= search.problem.upper, step, -step)
    smooth = search.evaluated(np.vstack([point, point + np.diag(steps)])).smooth
    return np.nan_to_num((smooth[1:] - smooth[0]).T / steps)


def least_squares_search(search: Search[AnyProblem], start: FloatArray, iterations: int) -> Optimum:
    """Search from one start by the Gauss-Newton method in a trust region (scipy's trf).

    When the method stops, it is started again from there with another difference step, until no
    difference step reduces the cost.

    Args:
        start: (p,) point where it starts.
        iterations: Limit of iterations.
    """
    before, problem = search.evaluations, search.problem
    inside = 1e-6 * (problem.upper - problem.lower)
    point = np.clip(start, problem.lower + inside, problem.upper - inside)
    cost, remaining, failed = np.inf, iterations, 0
    for step in itertools.cycle(DIFFERENCE_STEPS):
        result = _gauss_newton(search, point, step, remaining)
        failed = failed + 1 if result.cost > (1.0 - LEAST_GAIN) * cost else 0
        point, cost, remaining = result.x, float(result.cost), remaining - result.nfev
        if remaining <= 0 or failed == len(DIFFERENCE_STEPS):
            break
        point = np.clip(point, problem.lower + inside, problem.upper - inside)
    return Optimum(point, cost, search.evaluations - before)


def _gauss_newton(
    search: Search[AnyProblem], start: FloatArray, step: float, iterations: int
) -> OptimizeResult:
    def residuals(point: FloatArray) -> FloatArray:
        values = search.residuals(point[None])[0]
        # without residuals, a large value makes the trust region reject and shorten the step
        return np.concatenate([np.where(np.isfinite(values), values, FAILED), point])

    def slopes(point: FloatArray) -> FloatArray:
        return np.concatenate([smooth_jacobian(search, point, step), np.eye(len(point))])

    limits = {"xtol": 1e-4, "ftol": 1e-3, "gtol": 1e-6, "max_nfev": iterations}
    bounds = (search.problem.lower, search.problem.upper)
    return least_squares(residuals, start, jac=slopes, bounds=bounds, **limits)
