"""Ends of confidence intervals that would leave the bounds: by the profile of the sum of squares.

An interval by standard errors is symmetric, so that of a friction force may reach below zero. Its
end is then sought where the least sum of squares, with the unknown held and all others free, rises
as much as it would for a linear model at the symmetric end. The standard error takes correlated
samples and a variance per test into account, and so does the rise: it is scaled by the quotient of
that variance and the one of independent samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import FitProblem
from wm_drake.studies.fitting.search import Search, descended

MOST_STEPS = 12
"""Most steps of a search with one unknown held."""

NEAR = 2e-3
"""Accuracy of an end, in ranges."""


@dataclass(frozen=True)
class Profile:
    """Least sum of squares over one unknown without a prior.

    Attributes:
        point: Where the search ended (p,), in coordinates.
        unknown: Index of the unknown.
        free: Indices of the unknowns that are not at a bound, with all that have a prior.
    """

    problem: FitProblem
    point: FloatArray
    unknown: int
    free: Sequence[int] | np.ndarray

    def end(self, side: int, rise: float) -> float:
        """Return the end of an interval within the bounds. [SI]

        Args:
            side: -1 for the lower and 1 for the upper end.
            rise: Rise of the sum of squares at the end.

        Returns:
            Where the profile has risen so far; the bound, if it does not.
        """
        rows = self.problem.evaluated(self.point[None]).exact[0]
        least = float(np.sum(np.square(rows)))

        def excess(place: float) -> float:
            """Return the rise of the profile less `rise`, in roots: nearly linear."""
            error = self._least_rmse(place)
            return float(np.sqrt(max(error**2 * len(rows) - least, 0.0)) - np.sqrt(rise))

        whole, end = self.point.copy(), 0.0 if side < 0 else 1.0
        if excess(end) > 0.0:
            limits = {"xtol": NEAR, "rtol": NEAR, "maxiter": 12, "disp": False}
            end = float(brentq(excess, end, self.point[self.unknown], **limits))
        whole[self.unknown] = end
        return float(self.problem.points_at(whole)[self.unknown])

    def _least_rmse(self, place: float) -> float:
        """Return the least root mean square error with the unknown held at a coordinate."""
        others = np.array([k for k in self.free if k != self.unknown], dtype=int)
        held = self.point.copy()
        held[self.unknown] = place
        problem = self.problem.restricted(others, held)
        if len(others):
            begin = self.point[others]
            return descended(Search(problem), begin, MOST_STEPS).cost
        return float(problem.costs_of(problem.evaluated(np.zeros((1, 0))).exact)[0])
