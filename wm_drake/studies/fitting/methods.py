"""Methods of search: response surfaces as in [A], least squares from many starts, evolution.

All take the same problem, evaluate the model at many points at once, are repeated by their seed,
and return the same type `Fit`.
"""

from collections.abc import Callable

import numpy as np
from scipy import optimize

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.assessment import evaluated
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.problem import FitProblem, Progress
from wm_drake.studies.fitting.search import (
    Count,
    End,
    agreeing,
    descend,
    scattered,
    silent,
    underway,
)
from wm_drake.studies.fitting.surfaces import response_surface

AGREEING = 2
"""Searches from different starts with the same least end that are enough: no more are made."""

POLISHED_EVERY = 5
"""Generations of an evolution between two searches by least squares from its best point."""


def least_squares(
    problem: FitProblem,
    *,
    seed: int = 0,
    starts: int = 4,
    screened: int = 32,
    progress: Progress = silent,
) -> Fit:
    """Search by trust-region least squares from several starts, until two searches agree.

    The starts are the problem's start and the best of many scattered points.

    Args:
        problem: The problem.
        seed: Seed of the scattered points.
        starts: Searches at most.
        screened: Points that are evaluated (a power of two), of which the best become starts.
        progress: Called after every step.
    """
    count = Count(problem)
    points = scattered(len(problem.unknowns), screened, seed)
    order = np.argsort(count.errors(points), kind="stable")
    begins = [problem.start, *points[order[: starts - 1]]]
    count.round_done()
    ends: list[End] = []
    for index, begin in enumerate(begins):
        if agreeing(problem, ends) >= AGREEING:
            break

        def step_done(fraction: float, index: int = index) -> None:
            progress((index + fraction) / len(begins), count.least)

        ends.append(descend(count, begin, step_done))
        count.round_done()
    note = f"{agreeing(problem, ends)} of {len(ends)} starts came to the same least RMSE"
    progress(1.0, count.least)
    return count.fit(min(ends, key=lambda end: end[1])[0], "least-squares", seed, (note,))


def evolution(
    problem: FitProblem,
    *,
    seed: int = 0,
    population: int = 8,
    generations: int = 120,
    progress: Progress = silent,
) -> Fit:
    """Search by differential evolution, with least squares from its best point now and then.

    The evolution has to find the valley only, not its floor: it ends when least squares from the
    best points of two generations come to the same least RMSE.

    Args:
        problem: The problem.
        seed: Seed of the evolution.
        population: Members for each unknown.
        generations: Generations at most.
        progress: Called after every generation.
    """
    count = Count(problem)
    polish = _Polish(problem, count)

    def generation_done(intermediate_result: optimize.OptimizeResult) -> bool:
        count.round_done()
        progress(underway(intermediate_result.nit, 2 * POLISHED_EVERY), count.least)
        return intermediate_result.nit % POLISHED_EVERY == 0 and polish.agrees_from(
            intermediate_result.x
        )

    found = optimize.differential_evolution(
        lambda points: count.errors(points.T),
        [(0.0, 1.0)] * len(problem.unknowns),
        popsize=population,
        maxiter=generations,
        tol=0.01,
        polish=False,
        updating="deferred",
        vectorized=True,
        x0=problem.start,
        callback=generation_done,
        rng=np.random.default_rng(seed),
    )
    polish.agrees_from(found.x)
    count.round_done()
    progress(1.0, count.least)
    note = (
        f"least squares from the best of {len(polish.ends)} of {found.nit} generations: "
        f"{polish.agreeing} came to the same least RMSE"
    )
    return count.fit(polish.best, "evolution", seed, (note,))


class _Polish:
    """Least squares from the best points of an evolution, until two searches agree."""

    def __init__(self, problem: FitProblem, count: Count) -> None:
        self._problem, self._count = problem, count
        self._last: FloatArray | None = None
        self.ends: list[End] = []

    def agrees_from(self, point: FloatArray) -> bool:
        """Search from one more point, and return whether enough searches agree.

        There is no search if enough agree already, or if the point is the last one again.
        """
        if self.agreeing < AGREEING and not (
            self._last is not None and np.array_equal(point, self._last)
        ):
            self._last = point.copy()
            self.ends.append(descend(self._count, point, lambda fraction: None))
        return self.agreeing >= AGREEING

    @property
    def agreeing(self) -> int:
        """Number of searches that came to the least end."""
        return agreeing(self._problem, self.ends)

    @property
    def best(self) -> FloatArray:
        """Point of the least end."""
        return min(self.ends, key=lambda end: end[1])[0]


def refined(problem: FitProblem, values: FloatArray, note: str, method: str, seed: int) -> Fit:
    """Search by least squares from one point, the end of a search with a part of the measurements.

    Args:
        problem: The problem.
        values: The point (p,). [SI]
        note: Remark on the search that led there.
        method, seed: Of this search.
    """
    count = Count(problem)
    end, _ = descend(count, np.clip(problem.to_unit(values), 0.0, 1.0), lambda fraction: None)
    count.round_done()
    return count.fit(end, method, seed, (note,))


METHODS: dict[str, Callable[..., Fit]] = {
    "response-surface": response_surface,
    "least-squares": least_squares,
    "evolution": evolution,
}


def identify(
    problem: FitProblem,
    method: str = "least-squares",
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Search by the method of a name; without unknowns, evaluate the model.

    Raises:
        InputError: There is no such method.
    """
    if method not in METHODS:
        raise input_error(f"no method '{method}'{nearest_names(method, METHODS)}", where="--method")
    if not problem.unknowns:
        progress(1.0, 0.0)
        return evaluated(problem)
    return METHODS[method](problem, seed=seed, progress=progress)
