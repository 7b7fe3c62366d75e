"""Random starts of problems with priors."""

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import PriorProblem
from wm_drake.studies.fitting.search import Search

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
