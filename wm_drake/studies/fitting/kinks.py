"""Searches of problems with priors whose residuals have kinks, such as amplitudes (largest values).

Coarse differences of the smooth residuals pass a kink at which fine ones would stop.
"""

import itertools
from collections.abc import Callable

import cma
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
"""Usual number of points that are drawn for a random start or a hop; the best one is used.

This costs less than one Jacobian and saves several of them.
"""

HOP_SPREAD = 0.3
"""Standard deviation of the points of a hop around the best one so far, in prior deviations."""

OUTSIDE = 10.0
"""Cost of a point at a distance of one prior deviation beyond the bounds."""

POLISH = 10
"""Limit of iterations of least squares after CMA-ES or a hop."""


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


def least_squares_search(
    search: Search[AnyProblem],
    start: FloatArray,
    iterations: int,
    seed: int = 0,  # noqa: ARG001
) -> Optimum:
    """Search from one start by the Gauss-Newton method in a trust region (scipy's trf).

    When the method stops, it is started again from there with another difference step, until no
    difference step reduces the cost.

    Args:
        start: (p,) point where it starts.
        iterations: Limit of iterations.
        seed: Not used, because the method has no random part.
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


def basin_hopping_search(
    search: Search[PriorProblem], start: FloatArray, iterations: int, seed: int = 0
) -> Optimum:
    """Search by basin hopping: least squares from the start, then from the end of each hop.

    A hop goes to the best of some points that are drawn around the best point so far [Wales and
    Doye, J. Phys. Chem. A 101, 5111 (1997)]. Only a lower cost is accepted.

    Args:
        start: (p,) point where it starts.
        iterations: Number of hops.
    """
    before = search.evaluations
    generator = np.random.default_rng(seed)
    best = least_squares_search(search, start, 2 * POLISH)
    for _ in range(iterations):
        hopped = best_near(search, best.point, HOP_SPREAD, generator)
        best = min(best, least_squares_search(search, hopped, POLISH), key=lambda end: end.cost)
    return Optimum(best.point, best.cost, search.evaluations - before)


def evolution_search(
    search: Search[PriorProblem], start: FloatArray, iterations: int, seed: int = 0
) -> Optimum:
    """Search by CMA-ES from one start, then by least squares from its end point.

    CMA-ES: [Hansen, The CMA Evolution Strategy: A Tutorial, 2016]. The first points are drawn from
    the normal distribution around the start that the slopes there give to the quantities, so that
    combinations which the data determine well are changed by small steps. A point beyond the bounds
    is evaluated at the nearest one within, and costs more by `OUTSIDE` times the square of the
    distance.

    Args:
        start: (p,) point where it starts.
        iterations: Limit of generations.
    """
    before = search.evaluations
    options = {
        "popsize": DRAWS,
        "seed": seed + 1,  # 0 would mean a seed from the clock
        "maxiter": iterations,
        "verbose": -9,
        "tolfun": 1e-2,
        "tolx": 1e-3,
    }
    slopes = smooth_jacobian(search, start)
    spread = np.linalg.cholesky(np.linalg.inv(slopes.T @ slopes + np.eye(len(start))))
    best, least = start, np.inf
    strategy = cma.CMAEvolutionStrategy([0.0] * len(start), START_SPREAD, options)
    while not strategy.stop():
        drawn = strategy.ask()
        proposed = start + np.array(drawn) @ spread.T
        points = search.clipped(proposed)
        costs = search.costs(points)
        if costs.min() < least:
            best, least = points[int(np.argmin(costs))], float(costs.min())
        strategy.tell(drawn, (costs + OUTSIDE * np.sum((proposed - points) ** 2, axis=1)).tolist())
    end = least_squares_search(search, best, POLISH)
    return Optimum(end.point, end.cost, search.evaluations - before)


METHODS: dict[str, Callable[[Search[PriorProblem], FloatArray, int, int], Optimum]] = {
    "least-squares": least_squares_search,
    "basin-hopping": basin_hopping_search,
    "evolution": evolution_search,
}
"""Search methods by name; arguments: search, start, iterations, seed."""
