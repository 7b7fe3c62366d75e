"""Shared by all methods of search: count of evaluations, starts, least squares from one point."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.fit import SearchLog
from wm_drake.studies.fitting.problem import FitProblem, Rows, rmse

SAME_END = 1e-3
"""Searches whose costs differ by less than this part have the same end."""


@dataclass(frozen=True)
class Optimum:
    """Where a search ended.

    Attributes:
        point: Coordinates (p,).
        cost: Cost there.
        evaluations: Points that this search evaluated.
        note: Remark on how it ended, for the reader.
        is_end: Whether it came to an end; otherwise no intervals are claimed.
    """

    point: FloatArray
    cost: float
    evaluations: int = 0
    note: str = ""
    is_end: bool = True


def silent(fraction: float, least: float) -> None:
    """Ignore progress."""


def underway(done: int, usual: int) -> float:
    """Return the fraction to show of a search that may end any time: 2/3 after the usual rounds."""
    return done / (done + 0.5 * usual)


@dataclass
class Search:
    """A problem with a count of its evaluations and the best point so far.

    Attributes:
        report: Called after each evaluation with the points evaluated and the least cost so far.
        evaluations: Points evaluated so far.
        best: Coordinates of the best point so far; None before the first evaluation.
        least: Its cost.
        history: Least cost after each round.
    """

    problem: FitProblem
    report: Callable[[int, float], None] = lambda evaluations, least: None
    evaluations: int = field(default=0, init=False)
    best: FloatArray | None = field(default=None, init=False)
    least: float = field(default=np.inf, init=False)
    history: list[float] = field(default_factory=list, init=False)

    def evaluated(self, points: FloatArray) -> Rows:
        """Return the rows at points (k, p)."""
        return self._counted(points)[0]

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

    def _counted(self, points: FloatArray) -> tuple[Rows, FloatArray]:
        rows = self.problem.evaluated(points)
        costs = self.problem.costs_of(rows.exact)
        self.evaluations += len(points)
        index = int(np.argmin(costs))
        if costs[index] < self.least:
            self.least, self.best = float(costs[index]), points[index].copy()
        self.report(self.evaluations, self.least)
        return rows, costs


def agreeing(problem: FitProblem, ends: list[Optimum]) -> int:
    """Return how many searches came to the least RMSE of all."""
    if not ends:
        return 0
    errors = np.array([end.cost for end in ends])
    floor = 1e-9 * float(rmse(np.concatenate([m.values / m.scale for m in problem.measurements])))
    return int(np.sum(errors <= (1.0 + SAME_END) * errors.min() + floor))


LEAST_GAIN = 0.01
"""A search ends when no difference step reduces the cost by this fraction."""


def descended(
    search: Search,
    begin: FloatArray,
    most: int = 0,
    step_done: Callable[[float], None] = lambda fraction: None,
) -> Optimum:
    """Return where least squares from one point end.

    The method is scipy's trust-region reflective one, as finely as the problem's `Descent` says.

    Args:
        begin: First point (p,), moved a little into the bounds.
        most: Evaluations of the rows at most, without those of derivatives; 0 for `Descent.most`.
        step_done: Called before every step with the fraction of a usual search.
    """
    before, problem, descent = search.evaluations, search.problem, search.problem.descent
    margin = descent.inside * problem.ranges
    point, cost, remaining, failed = begin, np.inf, most or descent.most, 0
    for step in itertools.cycle(descent.steps):
        point = np.clip(point, problem.lower + margin, problem.upper - margin)
        end = _gauss_newton(search, point, step, remaining, step_done)
        failed = failed + 1 if end.cost > (1.0 - LEAST_GAIN) * cost else 0
        point, cost, remaining = end.x, float(end.cost), remaining - end.nfev
        if remaining <= 0 or failed == len(descent.steps) or len(descent.steps) == 1:
            break
    least = float(problem.costs_of(end.fun[None])[0])
    return Optimum(point, least, search.evaluations - before)


def _gauss_newton(
    search: Search,
    begin: FloatArray,
    step: float,
    most: int,
    step_done: Callable[[float], None],
) -> optimize.OptimizeResult:
    """Search with one size of the difference steps, until none of scipy's tolerances is missed."""
    problem, descent = search.problem, search.problem.descent
    steps = 0
    last: tuple[FloatArray, Rows] = (np.full(len(begin), np.nan), NO_ROWS)

    def evaluated(point: FloatArray) -> Rows:
        nonlocal last
        if not np.array_equal(point, last[0]):
            last = (point.copy(), search.evaluated(point[None]))
        return last[1]

    def slopes(point: FloatArray) -> FloatArray:
        nonlocal steps
        steps += 1
        step_done(min(1.0, steps / 25))
        return smooth_slopes(search, point, evaluated(point).smooth, step)

    return optimize.least_squares(
        lambda point: evaluated(point).exact[0],
        begin,
        slopes,
        bounds=(problem.lower, problem.upper),
        x_scale=1.0,
        ftol=descent.cost,
        xtol=descent.point,
        gtol=descent.gradient,
        max_nfev=most,
    )


NO_ROWS = Rows(np.empty((1, 0)), np.empty((1, 0)))


def smooth_slopes(search: Search, point: FloatArray, here: FloatArray, step: float) -> FloatArray:
    """Return the derivatives (m, p) of the smooth rows; 0 where one is NaN.

    Args:
        point: In coordinates (p,).
        here: Smooth rows there (1, m).
        step: Size of the difference steps, in coordinates.
    """
    problem = search.problem
    ahead = np.maximum(step, problem.descent.side * problem.ranges)
    steps = np.where(point + ahead <= problem.upper, step, -step)
    rows = search.evaluated(point + np.diag(steps)).smooth
    return np.nan_to_num(((rows - here) / steps[:, None]).T)
