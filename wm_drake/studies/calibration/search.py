"""Searches for the least squares of residuals; they are independent of machines."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import cma
import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from wm_drake.parameters.types import FloatArray

Residuals: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Function of points (points, n) in units of the prior.

It returns the residuals (points, m) and smooth substitutes of them (points, m). Both have the same
slopes except at kinks of the residuals. They are NaN where there are no residuals.
"""

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
"""Number of points that are drawn for a random start or a hop; the best one is used.

This costs less than one Jacobian and saves several of them.
"""

HOP_SPREAD = 0.3
"""Standard deviation of the points of a hop around the best one so far, in prior deviations."""


@dataclass
class SearchProblem:
    """A least-squares problem in units of the prior.

    A coordinate is (quantity - expected) / deviation.

    Attributes:
        residuals: Function that returns the residuals of the data for many points at once.
        lower, upper: (n) bounds of the coordinates.
        first: (n) start of the first search.
        report: Called with the number of points evaluated and the lowest cost so far.
        evaluations: Number of points evaluated so far.
        best: Lowest cost so far.
    """

    residuals: Residuals
    lower: FloatArray
    upper: FloatArray
    first: FloatArray
    report: Callable[[int, float], None] = lambda evaluations, best: None
    evaluations: int = field(default=0, init=False)
    best: float = field(default=np.inf, init=False)

    def evaluate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return residuals of the data (points, m) and costs (points,) at points.

        The cost is half the sum of the squares of residuals and coordinates. It is infinite if a
        residual is NaN.
        """
        values, _ = self._counted(points)
        return values, _costs(values, points)

    def _counted(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, smooth = self.residuals(points)
        self.evaluations += len(points)
        self.best = min(self.best, float(_costs(values, points).min()))
        self.report(self.evaluations, self.best)
        return values, smooth

    def jacobian(self, point: FloatArray, step: float = DIFFERENCE_STEPS[0]) -> FloatArray:
        """Return the Jacobian (m, n) of the smooth residuals at a point.

        It is computed by forward differences, or by backward differences near the upper bound. It
        is 0 where a residual is NaN.
        """
        steps = np.where(point + step <= self.upper, step, -step)
        _, smooth = self._counted(np.vstack([point, point + np.diag(steps)]))
        return np.nan_to_num((smooth[1:] - smooth[0]).T / steps)

    def start(self, number: int, seed: int) -> FloatArray:
        """Return the start with a number.

        Start 0 is `first`. Each other start is the best of some points that are drawn around it.
        """
        begin = np.clip(self.first, self.lower, self.upper)
        if number == 0:
            return begin
        return self.best_near(begin, START_SPREAD, np.random.default_rng([seed, number]))

    def best_near(
        self, point: FloatArray, spread: float, generator: np.random.Generator
    ) -> FloatArray:
        """Return the best of some points that are drawn around a point.

        Args:
            point: (n) centre of the normal distribution.
            spread: Standard deviation of each coordinate.
            generator: Source of random numbers.
        """
        drawn = point + generator.normal(0.0, spread, (DRAWS, len(point)))
        points = np.clip(drawn, self.lower, self.upper)
        _, costs = self.evaluate(points)
        return np.asarray(points[int(np.argmin(costs))])


def _costs(values: FloatArray, points: FloatArray) -> FloatArray:
    costs = 0.5 * (np.sum(values**2, axis=1) + np.sum(points**2, axis=1))
    return np.where(np.isfinite(costs), costs, np.inf)


@dataclass(frozen=True)
class Found:
    """Result of a search from one start.

    Attributes:
        point: (n) end point, in units of the prior.
        cost: Half the sum of squares there.
        evaluations: Number of points that the search evaluated.
    """

    point: FloatArray
    cost: float
    evaluations: int


def least_squares_search(
    problem: SearchProblem,
    start: FloatArray,
    iterations: int,
    seed: int = 0,  # noqa: ARG001
) -> Found:
    """Search from one start by the Gauss-Newton method in a trust region (scipy's trf).

    When the method stops, it is started again from there with another difference step, until no
    difference step reduces the cost.

    Args:
        problem: The least-squares problem.
        start: (n) point where the search starts.
        iterations: Limit of iterations.
        seed: Not used, because the method has no random part.
    """
    before = problem.evaluations
    inside = 1e-6 * (problem.upper - problem.lower)
    point = np.clip(start, problem.lower + inside, problem.upper - inside)
    cost, remaining, failed = np.inf, iterations, 0
    for step in itertools.cycle(DIFFERENCE_STEPS):
        result = _gauss_newton(problem, point, step, remaining)
        failed = failed + 1 if result.cost > (1.0 - LEAST_GAIN) * cost else 0
        point, cost, remaining = result.x, float(result.cost), remaining - result.nfev
        if remaining <= 0 or failed == len(DIFFERENCE_STEPS):
            break
        point = np.clip(point, problem.lower + inside, problem.upper - inside)
    return Found(point, cost, problem.evaluations - before)


def _gauss_newton(
    problem: SearchProblem, start: FloatArray, step: float, iterations: int
) -> OptimizeResult:
    def residuals(point: FloatArray) -> FloatArray:
        values, _ = problem.evaluate(point[None])
        # without residuals, a large value makes the trust region reject and shorten the step
        data = np.where(np.isfinite(values[0]), values[0], 1e3)
        return np.concatenate([data, point])

    def slopes(point: FloatArray) -> FloatArray:
        return np.concatenate([problem.jacobian(point, step), np.eye(len(point))])

    limits = {"xtol": 1e-4, "ftol": 1e-3, "gtol": 1e-6, "max_nfev": iterations}
    return least_squares(
        residuals, start, jac=slopes, bounds=(problem.lower, problem.upper), **limits
    )


def basin_hopping_search(
    problem: SearchProblem, start: FloatArray, iterations: int, seed: int = 0
) -> Found:
    """Search by basin hopping: least squares from the start, then from the end of each hop.

    A hop goes to the best of some points that are drawn around the best point so far [Wales and
    Doye, J. Phys. Chem. A 101, 5111 (1997)]. Only a lower cost is accepted.

    Args:
        problem: The least-squares problem.
        start: (n) point where the search starts.
        iterations: Number of hops.
        seed: Seed of the random numbers.
    """
    before = problem.evaluations
    generator = np.random.default_rng(seed)
    best = least_squares_search(problem, start, 2 * POLISH)
    for _ in range(iterations):
        hopped = problem.best_near(best.point, HOP_SPREAD, generator)
        best = min(
            best, least_squares_search(problem, hopped, POLISH), key=lambda found: found.cost
        )
    return Found(best.point, best.cost, problem.evaluations - before)


def evolution_search(
    problem: SearchProblem, start: FloatArray, iterations: int, seed: int = 0
) -> Found:
    """Search by CMA-ES from one start, then by least squares from its end point.

    CMA-ES: [Hansen, The CMA Evolution Strategy: A Tutorial, 2016]. The first points are drawn from
    the normal distribution around the start that the slopes there give to the quantities, so that
    combinations which the data determine well are changed by small steps. A point beyond the bounds
    is evaluated at the nearest one within, and costs more by `OUTSIDE` times the square of the
    distance.

    Args:
        problem: The least-squares problem.
        start: (n) point where the search starts.
        iterations: Limit of generations.
        seed: Seed of the random numbers.
    """
    before = problem.evaluations
    options = {
        "popsize": DRAWS,
        "seed": seed + 1,  # 0 would mean a seed from the clock
        "maxiter": iterations,
        "verbose": -9,
        "tolfun": 1e-2,
        "tolx": 1e-3,
    }
    slopes = problem.jacobian(start)
    spread = np.linalg.cholesky(np.linalg.inv(slopes.T @ slopes + np.eye(len(start))))
    best, least = start, np.inf
    strategy = cma.CMAEvolutionStrategy([0.0] * len(start), START_SPREAD, options)
    while not strategy.stop():
        drawn = strategy.ask()
        wanted = start + np.array(drawn) @ spread.T
        points = np.clip(wanted, problem.lower, problem.upper)
        costs = problem.evaluate(points)[1]
        if costs.min() < least:
            best, least = points[int(np.argmin(costs))], float(costs.min())
        strategy.tell(drawn, (costs + OUTSIDE * np.sum((wanted - points) ** 2, axis=1)).tolist())
    found = least_squares_search(problem, best, POLISH)
    return Found(found.point, found.cost, problem.evaluations - before)


OUTSIDE = 10.0
"""Cost of a point at a distance of one prior deviation beyond the bounds."""

POLISH = 10
"""Limit of iterations of least squares after CMA-ES or a hop."""

METHODS = {
    "least-squares": least_squares_search,
    "basin-hopping": basin_hopping_search,
    "evolution": evolution_search,
}
"""Search methods by name; arguments: problem, start, iterations, seed."""
