"""Methods of search: response surfaces as in [A], least squares from many starts, evolution.

Each is a function that returns the optimum of a search. All evaluate the model at many points at
once and are repeated by their seed. `identify` assesses the optimum of any of them.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy import optimize

from wm_drake.errors import check_known
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.assessment import assess, evaluated
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.problem import FitProblem, Progress
from wm_drake.studies.fitting.search import (
    Optimum,
    Search,
    agreeing,
    descended,
    silent,
    underway,
)
from wm_drake.studies.fitting.starts import starts_of
from wm_drake.studies.fitting.surfaces import response_surface

AGREEING = 2
"""Searches from different starts with the same least end that are enough: no more are made."""

MEMBERS, MOST_GENERATIONS = 8, 120
"""Members of an evolution for each unknown, and its generations at most."""

POLISHED_EVERY = 5
"""Generations of an evolution between two searches by least squares from its best point."""


def least_squares(
    search: Search,
    *,
    seed: int = 0,
    starts: int = 4,
    screened: int = 32,
    progress: Progress = silent,
) -> Optimum:
    """Search by trust-region least squares from several starts, until two searches agree.

    Args:
        starts: Searches at most.
        screened: Points that are evaluated (a power of two), of which the best become starts.
        progress: Called after every step.
    """
    begins, ends = starts_of(search, seed, starts, screened), list[Optimum]()
    for end in descents(search, begins, starts, progress=progress):
        ends.append(end)
        if agreeing(search.problem, ends) >= AGREEING:
            break
    note = f"{agreeing(search.problem, ends)} of {len(ends)} starts came to the same least RMSE"
    return replace(min(ends, key=lambda end: end.cost), note=note)


def descents(
    search: Search,
    begins: Iterable[FloatArray],
    starts: int,
    most: int = 0,
    progress: Progress = silent,
) -> Iterator[Optimum]:
    """Yield where least squares from several starts end.

    Args:
        begins: The starts.
        starts: Their number.
        most: Evaluations of the rows of each at most, as for `descended`.
        progress: Called after every step.
    """
    before = 0
    for number, begin in enumerate(begins):

        def step_done(fraction: float, number: int = number) -> None:
            progress((number + fraction) / starts, search.least)

        end = descended(search, begin, most, step_done)
        search.round_done()
        yield replace(end, evaluations=search.evaluations - before)
        before = search.evaluations


def evolution(search: Search, *, seed: int = 0, progress: Progress = silent) -> Optimum:
    """Search by differential evolution, with least squares from its best point now and then.

    The evolution has to find the valley only, not its floor: it ends when least squares from the
    best points of two generations come to the same least RMSE.

    Args:
        progress: Called after every generation.
    """
    problem = search.problem
    ends: list[Optimum] = []
    last: FloatArray = np.full(len(problem.unknowns), np.nan)

    def agrees_from(point: FloatArray) -> bool:
        """Search from one more point unless enough searches agree; return whether they do."""
        nonlocal last
        if agreeing(problem, ends) < AGREEING and not np.array_equal(point, last):
            last = point.copy()
            ends.append(descended(search, point))
        return agreeing(problem, ends) >= AGREEING

    def generation_done(intermediate_result: optimize.OptimizeResult) -> bool:
        search.round_done()
        progress(underway(intermediate_result.nit, 2 * POLISHED_EVERY), search.least)
        return intermediate_result.nit % POLISHED_EVERY == 0 and agrees_from(intermediate_result.x)

    end = optimize.differential_evolution(
        lambda points: search.costs(points.T),
        [(0.0, 1.0)] * len(problem.unknowns),
        popsize=MEMBERS,
        maxiter=MOST_GENERATIONS,
        tol=0.01,
        polish=False,
        updating="deferred",
        vectorized=True,
        x0=problem.start,
        callback=generation_done,
        rng=np.random.default_rng(seed),
    )
    agrees_from(end.x)
    search.round_done()
    note = (
        f"least squares from the best of {len(ends)} of {end.nit} generations: "
        f"{agreeing(problem, ends)} came to the same least RMSE"
    )
    return replace(min(ends, key=lambda end: end.cost), note=note)


def refined(problem: FitProblem, fit: Fit, note: str) -> Fit:
    """Search by least squares from the end of a search with a part of the measurements.

    Args:
        problem: The problem with all measurements.
        fit: Fit to the part.
        note: Remark on the search that led there.
    """
    search = Search(problem)
    begin = np.clip(problem.coordinates_of(fit.values), 0.0, 1.0)
    end = descended(search, begin)
    search.round_done()
    return assess(problem, end.point, search.log(fit.log.method, fit.log.seed, note))


NO_END = "the search had not come to an end: no optimum, and no intervals are claimed"

METHODS: dict[str, Callable[..., Optimum]] = {
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
    **settings: int,
) -> Fit:
    """Search by the method of a name; without unknowns, evaluate the model.

    Args:
        settings: Arguments of the method, such as `starts`.

    Raises:
        InputError: There is no such method.
    """
    check_known(method, METHODS, f"no method '{method}'", where="--method")
    if not problem.unknowns:
        progress(1.0, 0.0)
        return evaluated(problem)
    search = Search(problem)
    end = METHODS[method](search, seed=seed, progress=progress, **settings)
    progress(1.0, search.least)
    fit = assess(problem, end.point, search.log(method, seed, end.note))
    return fit if end.is_end else fit.without_intervals(NO_END)
