"""Ends of confidence intervals that would leave the bounds: by the profile of the sum of squares.

An interval by standard errors is symmetric, so that of a friction force may reach below zero. Its
end is then sought where the least sum of squares, with the unknown held and all others free, rises
as much as it would for a linear model at the symmetric end. The standard error takes correlated
samples and a variance per test into account, and so does the rise: it is scaled by the quotient of
that variance and the one of independent samples.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.descent import descended
from wm_drake.studies.fitting.problem import FitProblem

MOST_STEPS = 12
"""Most steps of a search with one unknown held."""

NEAR = 2e-3
"""Accuracy of an end, in ranges."""


def profiled_end(
    problem: FitProblem,
    point: FloatArray,
    held: int,
    free: Sequence[int] | np.ndarray,
    side: int,
    rise: float,
) -> float:
    """Return the end of an interval within the bounds, in unit coordinates.

    Args:
        problem: The problem.
        point: Where the search ended (p,), in unit coordinates.
        held: Index of the unknown.
        free: Indices of the unknowns that are not at a bound.
        side: -1 for the lower and 1 for the upper end.
        rise: Rise of the sum of squared residuals at the end.

    Returns:
        Where the profile has risen so far; the bound, if it does not.
    """
    others = np.array([k for k in free if k != held], dtype=int)
    begin = point[others]
    count = sum(len(m.values) for m in problem.measurements)
    least = float(np.sum(np.square(problem.residuals(point[None])[0])))

    def excess(place: float) -> float:
        """Return the rise of the profile less the wanted one, in roots: nearly linear."""

        def residuals(points: FloatArray) -> FloatArray:
            whole = np.tile(point, (len(points), 1))
            whole[:, others], whole[:, held] = points, place
            return problem.residuals(whole)

        if len(others):
            _, error = descended(residuals, begin, lambda fraction: None, MOST_STEPS)
        else:
            error = float(np.sqrt(np.mean(np.square(residuals(np.zeros((1, 0)))[0]))))
        return float(np.sqrt(max(error**2 * count - least, 0.0)) - np.sqrt(rise))

    bound = 0.0 if side < 0 else 1.0
    if excess(bound) <= 0.0:
        return bound
    return float(brentq(excess, bound, point[held], xtol=NEAR, rtol=NEAR, maxiter=12, disp=False))
