"""Shared by all methods of search: count of evaluations, starts, least squares from one point."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from scipy import optimize
from scipy.stats import qmc

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.fit import SearchLog
from wm_drake.studies.fitting.problem import CostProblem, FitProblem, Residuals, rmse

SAME_END = 1e-3
"""Searches whose costs differ by less than this part have the same end."""


AnyProblem = TypeVar("AnyProblem", bound=CostProblem)


@dataclass(frozen=True)
class Optimum:
    """Where a search ended.

    Attributes:
        point: Coordinates (p,).
        cost: Cost there.
        evaluations: Points that this search evaluated.
    """

    point: FloatArray
    cost: float
    evaluations: int = 0


def silent(fraction: float, least: float) -> None:
    """Ignore progress."""


def underway(done: int, usual: int) -> float:
    """Return the fraction to show of a search that may end any time: 2/3 after the usual rounds."""
    return done / (done + 0.5 * usual)


@dataclass
class Search(Generic[AnyProblem]):
    """A problem with a count of its evaluations and the best point so far.

    Attributes:
        report: Called after each evaluation with the points evaluated and the least cost so far.
        evaluations: Points evaluated so far.
        best: Coordinates of the best point so far; None before the first finite cost.
        least: Its cost.
        history: Least cost after each round.
    """

    problem: AnyProblem
    report: Callable[[int, float], None] = lambda evaluations, least: None
    evaluations: int = field(default=0, init=False)
    best: FloatArray | None = field(default=None, init=False)
    least: float = field(default=np.inf, init=False)
    history: list[float] = field(default_factory=list, init=False)

    def evaluated(self, points: FloatArray) -> Residuals:
        """Return the residuals at points (k, p)."""
        return self._counted(points)[0]

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return the residuals (k, n) at points (k, p)."""
        return self.evaluated(points).exact

    def costs(self, points: FloatArray) -> FloatArray:
        """Return the cost at each point (k,)."""
        return self._counted(points)[1]

    def clipped(self, points: FloatArray) -> FloatArray:
        """Return points moved into the bounds."""
        return np.clip(points, self.problem.lower, self.problem.upper)

    def round_done(self) -> None:
        """Append the least cost so far to the history."""
        self.history.append(self.least)

    def log(self, method: str, seed: int, *notes: str) -> SearchLog:
        """Return the log of the search at its end."""
        return SearchLog(method, seed, self.evaluations, (*self.history, self.least), notes)

    def _counted(self, points: FloatArray) -> tuple[Residuals, FloatArray]:
        residuals = self.problem.evaluated(points)
        costs = self.problem.costs(residuals.exact, points)
        self.evaluations += len(points)
        index = int(np.argmin(costs))
        if costs[index] < self.least:
            self.least, self.best = float(costs[index]), points[index].copy()
        self.report(self.evaluations, self.least)
        return residuals, costs


def scattered(p: int, number: int, seed: int) -> FloatArray:
    """Return points that fill the ranges evenly (number, p); best a power of two of them."""
    return np.asarray(qmc.Sobol(p, rng=np.random.default_rng(seed)).random(number))


def agreeing(problem: FitProblem, ends: list[Optimum]) -> int:
    """Return how many searches came to the least RMSE of all."""
    if not ends:
        return 0
    errors = np.array([end.cost for end in ends])
    floor = 1e-9 * float(rmse(np.concatenate([m.values / m.scale for m in problem.measurements])))
    return int(np.sum(errors <= (1.0 + SAME_END) * errors.min() + floor))


STEP = 1e-5
"""Step of one-sided differences during a search, in ranges."""

ResidualFunction: TypeAlias = Callable[[FloatArray], FloatArray]
"""Points in coordinates (k, p) -> residuals (k, n)."""


def descended(
    evaluate: ResidualFunction,
    begin: FloatArray,
    step_done: Callable[[float], None] = lambda fraction: None,
    most: int = 60,
) -> Optimum:
    """Return where least squares from one point within the unit cube end, with the RMSE as cost.

    The method is scipy's trust-region reflective one.

    Args:
        evaluate: Residuals of the problem.
        begin: First point (p,), moved a little into the cube.
        step_done: Called before every step with the fraction of a usual search.
        most: Evaluations of the residuals at most, without those of derivatives.
    """
    steps = 0
    last: tuple[FloatArray, FloatArray] = (np.full(len(begin), np.nan), np.empty(0))

    def residuals(z: FloatArray) -> FloatArray:
        nonlocal last
        last = (z.copy(), np.asarray(evaluate(z[None])[0]))
        return last[1]

    def jacobian(z: FloatArray) -> FloatArray:
        nonlocal steps
        steps += 1
        step_done(min(1.0, steps / 25))
        here = last[1] if np.array_equal(z, last[0]) else evaluate(z[None])[0]
        sign = np.where(z > 0.5, -1.0, 1.0)
        moved = evaluate(z + np.diag(STEP * sign))
        return np.asarray(((moved - here) / (STEP * sign)[:, None]).T)

    end = optimize.least_squares(
        residuals,
        np.clip(begin, 1e-4, 1.0 - 1e-4),
        jacobian,
        bounds=(0.0, 1.0),
        x_scale=1.0,
        ftol=1e-9,
        xtol=1e-9,
        gtol=1e-14,
        max_nfev=most,
    )
    return Optimum(end.x, float(rmse(end.fun)))
