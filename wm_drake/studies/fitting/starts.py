"""Starts of searches: the first guess, and the best of points that are drawn."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import qmc

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.search import Search

START_SPREAD = 0.7
"""Standard deviation of random starts around the first one, in prior deviations."""

DRAWS = 24
"""Usual number of points that are drawn for a start of a problem with priors; the best one is used.

This costs less than one Jacobian and saves several of them.
"""


def starts_of(search: Search, seed: int, count: int, draws: int) -> Iterator[FloatArray]:
    """Yield starts of a search, the first guess first.

    If all unknowns have priors, each other start is the best of points that are drawn around the
    first guess. Else the others are the best of points that fill the ranges of those without.

    Args:
        draws: Number of points that are drawn; for ranges, best a power of two.
    """
    problem = search.problem
    begin = search.clipped(problem.start)
    if problem.has_prior.all():
        yield begin
        for number in range(1, count):
            yield best_near(search, begin, np.random.default_rng([seed, number]), draws)
        return
    points = scattered(search, draws, seed)
    order = np.argsort(search.costs(points), kind="stable")
    search.round_done()
    yield problem.start
    yield from points[order[: count - 1]]


def best_near(
    search: Search, point: FloatArray, generator: np.random.Generator, draws: int
) -> FloatArray:
    """Return the best of some points that are drawn around a point (p,)."""
    offsets = generator.normal(0.0, START_SPREAD, (draws, len(point)))
    points = search.clipped(point + offsets)
    return np.asarray(points[int(np.argmin(search.costs(points)))])


def scattered(search: Search, number: int, seed: int) -> FloatArray:
    """Return points that fill the ranges evenly (number, p), best a power of two of them.

    An unknown with a prior stays at its first guess.
    """
    problem = search.problem
    p = len(problem.unknowns)
    parts = qmc.Sobol(p, rng=np.random.default_rng(seed)).random(number)
    points = problem.lower + problem.ranges * parts
    return np.where(problem.has_prior, problem.start, points)
