"""Shared by all methods of search: count of evaluations, scattered points, end of a search."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from scipy.stats import qmc

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.fit import SearchLog
from wm_drake.studies.fitting.problem import FitProblem, Problem, Residuals, rmse

SAME_END = 1e-3
"""Searches whose costs differ by less than this part have the same end."""


AnyProblem = TypeVar("AnyProblem", bound=Problem)


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
        problem: The problem.
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
