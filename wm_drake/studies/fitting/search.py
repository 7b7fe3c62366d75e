"""Shared by all methods of search: count of evaluations, scattered points, descent."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from scipy.stats import qmc

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.assessment import assess
from wm_drake.studies.fitting.descent import descended
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.problem import FitProblem, rmse

SAME_END = 1e-3
"""Searches whose RMSE differ by less than this part have the same end."""

End: TypeAlias = tuple[FloatArray, float]
"""Point where a search ended, in unit coordinates (p,), and its RMSE."""


def silent(fraction: float, least: float) -> None:
    """Ignore progress."""


def underway(done: int, usual: int) -> float:
    """Return the fraction to show of a search that may end any time: 2/3 after the usual rounds."""
    return done / (done + 0.5 * usual)


@dataclass
class Count:
    """A problem with a count of its evaluations and the best point so far."""

    problem: FitProblem
    evaluations: int = 0
    best: FloatArray | None = None
    least: float = np.inf
    history: list[float] = field(default_factory=list)

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return scaled residuals (k, n) at points in unit coordinates (k, p)."""
        found = self.problem.residuals(points)
        self.evaluations += len(points)
        errors = rmse(found)
        index = int(np.argmin(errors))
        if errors[index] < self.least:
            self.least, self.best = float(errors[index]), points[index].copy()
        return found

    def errors(self, points: FloatArray) -> FloatArray:
        """Return the RMSE at each point (k,)."""
        return rmse(self.residuals(points))

    def round_done(self) -> None:
        """Append the least RMSE so far to the history."""
        self.history.append(self.least)

    def fit(self, point: FloatArray, method: str, seed: int, notes: tuple[str, ...] = ()) -> Fit:
        """Return the fit at the point where the search ended."""
        rounds = (*self.history, self.least)
        return assess(
            self.problem,
            point,
            method=method,
            seed=seed,
            evaluations=self.evaluations,
            history=rounds,
            notes=notes,
        )


def scattered(p: int, number: int, seed: int) -> FloatArray:
    """Return points that fill the ranges evenly (number, p); best a power of two of them."""
    return np.asarray(qmc.Sobol(p, rng=np.random.default_rng(seed)).random(number))


def agreeing(problem: FitProblem, ends: list[End]) -> int:
    """Return how many searches came to the least RMSE of all."""
    if not ends:
        return 0
    errors = np.array([error for _, error in ends])
    floor = 1e-9 * float(rmse(np.concatenate([m.values / m.scale for m in problem.measurements])))
    return int(np.sum(errors <= (1.0 + SAME_END) * errors.min() + floor))


def descend(
    count: Count, begin: FloatArray, step_done: Callable[[float], None], most: int = 60
) -> End:
    """Search once by least squares from a point, and return its end."""
    return descended(count.residuals, begin, step_done, most)
