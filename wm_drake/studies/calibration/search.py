"""The search itself: residuals of a problem -> points where their squares are least. Knows nothing of machines."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import cma
import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from wm_drake.parameters.types import FloatArray

Residuals: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""(points, n) in units of the prior -> residuals (points, m), and smooth stand-ins for them (points, m), whose slopes are
theirs but for kinks; NaN where there are none."""

DIFFERENCE_STEPS = (0.1, 0.3, 0.03)
"""Of the Jacobian's differences, in standard deviations of the prior. The first is above the grain of amplitudes read off
samples; where a kink of the landscape misleads it, the others are tried."""

LEAST_GAIN = 0.01
"""A search ends when no difference step brings the cost down by this part of it."""

START_SPREAD = 0.7
"""Of random starts about the first one, in standard deviations of the prior."""

DRAWS = 24
"""Points that are drawn for a random start or a hop, of which the best is taken: less than a Jacobian, and worth several."""

HOP_SPREAD = 0.3
"""Of the points a hop draws about the best one so far, in standard deviations of the prior."""


@dataclass
class SearchProblem:
    """Least squares in units of the prior: a coordinate is (quantity - expected) / deviation.

    Attributes:
        residuals: Of the data, for many points at once.
        lower, upper: Bounds of the coordinates. (n)
        first: Where the first search begins. (n)
        report: Called with the number of points evaluated and the least cost so far.
        evaluations: Points evaluated so far.
        best: Least cost so far.
    """

    residuals: Residuals
    lower: FloatArray
    upper: FloatArray
    first: FloatArray
    report: Callable[[int, float], None] = lambda evaluations, best: None
    evaluations: int = field(default=0, init=False)
    best: float = field(default=np.inf, init=False)

    def evaluate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (points, m) of the data, and costs (points): half the sum of all squares, infinite without residuals."""
        values, _ = self._counted(points)
        return values, _costs(values, points)

    def _counted(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, smooth = self.residuals(points)
        self.evaluations += len(points)
        self.best = min(self.best, float(_costs(values, points).min()))
        self.report(self.evaluations, self.best)
        return values, smooth

    def jacobian(self, point: FloatArray, step: float = DIFFERENCE_STEPS[0]) -> FloatArray:
        """Slopes of the smooth residuals at a point, by one-sided differences away from the upper bound. (m, n)"""
        steps = np.where(point + step <= self.upper, step, -step)
        _, smooth = self._counted(np.vstack([point, point + np.diag(steps)]))
        return np.nan_to_num((smooth[1:] - smooth[0]).T / steps)  # no machine there: no slope

    def start(self, number: int, seed: int) -> FloatArray:
        """The first start is `first`; each other is the best of some points drawn about it."""
        begin = np.clip(self.first, self.lower, self.upper)
        if number == 0:
            return begin
        return self.best_near(begin, START_SPREAD, np.random.default_rng([seed, number]))

    def best_near(
        self, point: FloatArray, spread: float, generator: np.random.Generator
    ) -> FloatArray:
        """The best of some points drawn about one, with this standard deviation in each coordinate."""
        drawn = point + generator.normal(0.0, spread, (DRAWS, len(point)))
        points = np.clip(drawn, self.lower, self.upper)
        _, costs = self.evaluate(points)
        return np.asarray(points[int(np.argmin(costs))])


def _costs(values: FloatArray, points: FloatArray) -> FloatArray:
    costs = 0.5 * (np.sum(values**2, axis=1) + np.sum(points**2, axis=1))
    return np.where(np.isfinite(costs), costs, np.inf)


@dataclass(frozen=True)
class Found:
    """Where a search from one start ended: the point in units of the prior, half its sum of squares, points evaluated."""

    point: FloatArray
    cost: float
    evaluations: int


def least_squares_search(
    problem: SearchProblem, start: FloatArray, iterations: int, seed: int = 0
) -> Found:  # noqa: ARG001
    """Gauss-Newton in a trust region within the bounds (scipy's trf) from one start; takes no chances, so no seed.

    Where it gets stuck it begins anew from there with another difference step, until none of them helps.
    """
    before = problem.evaluations
    inside = 1e-6 * (problem.upper - problem.lower)
    point = np.clip(start, problem.lower + inside, problem.upper - inside)
    cost, left, fruitless = np.inf, iterations, 0
    for step in itertools.cycle(DIFFERENCE_STEPS):
        result = _gauss_newton(problem, point, step, left)
        fruitless = fruitless + 1 if result.cost > (1.0 - LEAST_GAIN) * cost else 0
        point, cost, left = result.x, float(result.cost), left - result.nfev
        if left <= 0 or fruitless == len(DIFFERENCE_STEPS):
            break
        point = np.clip(point, problem.lower + inside, problem.upper - inside)
    return Found(point, cost, problem.evaluations - before)


def _gauss_newton(
    problem: SearchProblem, start: FloatArray, step: float, iterations: int
) -> OptimizeResult:
    def residuals(point: FloatArray) -> FloatArray:
        values, _ = problem.evaluate(point[None])
        data = np.where(
            np.isfinite(values[0]), values[0], 1e3
        )  # no machine there: the step is refused and shortened
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
    """Least squares, then so many hops: least squares again from the best of some points about the best so far.

    [Wales and Doye, J. Phys. Chem. A 101, 5111 (1997)], downhill only.
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
    """CMA-ES [Hansen, The CMA Evolution Strategy: A Tutorial, 2016] from one start, then least squares from where it ends."""
    before = problem.evaluations
    options = {
        "bounds": [problem.lower.tolist(), problem.upper.tolist()],
        "seed": seed + 1,  # 0 would mean the clock
        "maxiter": iterations,
        "verbose": -9,
        "tolfun": 1e-2,
        "tolx": 1e-3,
    }
    strategy = cma.CMAEvolutionStrategy(start.tolist(), 0.5 * START_SPREAD, options)
    while not strategy.stop():
        points = np.array(strategy.ask())
        strategy.tell(points, problem.evaluate(points)[1].tolist())
    found = least_squares_search(
        problem, np.clip(strategy.result.xbest, problem.lower, problem.upper), POLISH
    )
    return Found(found.point, found.cost, problem.evaluations - before)


POLISH = 10
"""Iterations of least squares after an evolution or a hop."""

METHODS = {
    "least-squares": least_squares_search,
    "basin-hopping": basin_hopping_search,
    "evolution": evolution_search,
}
"""Ways to search, by name: (problem, start, iterations, seed) -> Found."""
