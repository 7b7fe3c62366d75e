"""The ways to search: iterated response surfaces as in [A], least squares from many starts, evolution with polish.

All take the same problem, ask the model for many points at once, repeat from their seed, and give the same `Fit`.
"""

from collections.abc import Callable

import numpy as np
from scipy import optimize

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters.types import FloatArray
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
"""Searches from different starts that came to the same least end: no more are made."""

POLISHED_EVERY = 5
"""Generations of an evolution, after which least squares shows where its best point leads."""


def least_squares(
    problem: FitProblem,
    *,
    seed: int = 0,
    starts: int = 4,
    screened: int = 32,
    progress: Progress = silent,
) -> Fit:
    """Trust-region least squares from the problem's start and the best of many scattered points, until two agree.

    Args:
        problem: What to find.
        seed: Of the scattered points.
        starts: Searches at most.
        screened: Points that are looked at (a power of two), of which the best become starts.
        progress: Told after every step.
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
    """Differential evolution over the whole range; least squares from its best point every few generations.

    The evolution has only to find the valley, not its floor: it ends when least squares from the best points of two
    generations come to the same least RMSE.

    Args:
        problem: What to find.
        seed: Of the evolution.
        population: Members for each unknown.
        generations: At most.
        progress: Told after every generation.
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
        """Searches from one more point, unless that is the last one again or enough agree already; whether they do now."""
        if self.agreeing < AGREEING and not (
            self._last is not None and np.array_equal(point, self._last)
        ):
            self._last = point.copy()
            self.ends.append(descend(self._count, point, lambda fraction: None))
        return self.agreeing >= AGREEING

    @property
    def agreeing(self) -> int:
        """How many came to the least end."""
        return agreeing(self._problem, self.ends)

    @property
    def best(self) -> FloatArray:
        """The least end."""
        return min(self.ends, key=lambda end: end[1])[0]


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
    """Searches by the method of a name.

    Raises:
        InputError: no such method.
    """
    if method not in METHODS:
        raise input_error(f"no method '{method}'{nearest_names(method, METHODS)}", where="--method")
    return METHODS[method](problem, seed=seed, progress=progress)
