"""Search for a Pareto front by NSGA-II or NSGA-III of pymoo. It is independent of machines."""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy import stats

from wm_drake.errors import WmDrakeError, input_error
from wm_drake.parameters.types import FloatArray

Evaluate: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Function of designs (n, d) in [0, 1] with objectives (n, m), which are to be small, and
constraints (n, k), which are met at 0 and below. NaN marks a design that cannot be evaluated."""

UNUSABLE = 1e12
"""Objective and violation of a design that cannot be evaluated."""


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        designs: Designs of the front. (n, d) in [0, 1]
        objectives: Their objectives. (n, m)
        constraints: Their constraints. (n, k)
        evaluations: Number of designs that were evaluated.
        first: Objectives of the first population. (population, m)
        history: Number of evaluations, and hypervolume of the front, after each generation.
    """

    designs: FloatArray
    objectives: FloatArray
    constraints: FloatArray
    evaluations: int
    first: FloatArray
    history: tuple[tuple[int, float], ...]

    @property
    def hypervolume(self) -> float:
        """Hypervolume of the front."""
        return self.history[-1][1]


def hypervolume(objectives: FloatArray, first: FloatArray) -> float:
    """Return the hypervolume of a front.

    Objectives are scaled so that the first population reaches from 0 to 1; the reference point has
    1 in each objective. A front beyond the best of the first population can exceed 1.

    Args:
        objectives: Of the front. (n, m)
        first: Of the first population. (n, m)
    """
    from pymoo.indicators.hv import HV

    usable = first[np.all(first < UNUSABLE, axis=1)]
    if not len(objectives) or not len(usable):
        return 0.0
    low, high = usable.min(axis=0), usable.max(axis=0)
    scaled = (objectives - low) / np.where(high > low, high - low, 1.0)
    return float(HV(ref_point=np.ones(scaled.shape[1]))(scaled))


def check_search(evaluations: int, population: int) -> None:
    """Raise an InputError if there are fewer evaluations than designs of a generation.

    Raises:
        WmDrakeError: pymoo is missing.
    """
    if importlib.util.find_spec("pymoo") is None:
        raise WmDrakeError("a design study needs pymoo: pip install 'wm-drake[design]'")
    if evaluations < population:
        raise input_error(
            f"{evaluations} is less than the population, {population}", where="--evaluations"
        )


def search_front(
    evaluate: Evaluate,
    start: FloatArray,
    objectives: int,
    constraints: int,
    *,
    evaluations: int = 2000,
    population: int = 64,
    seed: int = 0,
) -> SearchResult:
    """Return the Pareto front of a problem.

    With up to two objectives the search is NSGA-II, with more NSGA-III. The first population is the
    start and points of a scrambled Sobol sequence.

    Args:
        evaluate: The problem.
        start: A first design. (d,) in [0, 1]
        objectives: Number of objectives.
        constraints: Number of constraints.
        evaluations: Number of designs to evaluate, at least one population.
        population: Designs of a generation.
        seed: Of all random numbers.

    Raises:
        InputError: there are fewer evaluations than designs of a generation.
        WmDrakeError: pymoo is missing.
    """
    check_search(evaluations, population)
    size, done, first = len(start), 0, list[FloatArray]()
    history: list[tuple[int, float]] = []

    def usable_only(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        nonlocal done
        f, g = evaluate(x)
        usable = np.all(np.isfinite(np.hstack([f, g])), axis=1, keepdims=True)
        f, g = np.where(usable, f, UNUSABLE), np.where(usable, g, UNUSABLE)
        if not first:
            first.append(f)
        done += len(x)
        return f, g

    def note(algorithm: Any) -> None:
        optimum = algorithm.opt
        kept = optimum.get("F")[optimum.get("feas").ravel()] if len(optimum) else np.empty((0, 1))
        history.append((done, hypervolume(kept, first[0])))

    points = first_population(start, population, seed)
    until = ("n_eval", evaluations)
    result = minimized(usable_only, points, objectives, constraints, until, population, seed, note)
    if result.F is None:
        empty = np.empty((0, size)), np.empty((0, objectives)), np.empty((0, constraints))
        return SearchResult(*empty, done, first[0], tuple(history))
    x, f = np.atleast_2d(result.X), np.reshape(result.F, (-1, objectives))
    g = np.reshape(result.G, (len(f), -1)) if constraints else np.empty((len(f), 0))
    usable = np.all(f < UNUSABLE, axis=1)
    x, f, g = x[usable], f[usable], g[usable]
    order = np.lexsort(f.T[::-1])
    return SearchResult(x[order], f[order], g[order], done, first[0], tuple(history))


def first_population(start: FloatArray, population: int, seed: int) -> FloatArray:
    """Return a first design (d,) and points of a scrambled Sobol sequence. (population, d)"""
    sobol = stats.qmc.Sobol(len(start), scramble=True, seed=np.random.default_rng(seed))
    points = sobol.random(1 << (population - 1).bit_length())[:population]
    points[0] = start
    return np.asarray(points)


def minimized(
    evaluate: Evaluate,
    points: FloatArray,
    objectives: int,
    constraints: int,
    until: tuple[str, int],
    population: int,
    seed: int,
    note: Callable[[Any], None] | None = None,
) -> Any:
    """Return the result of pymoo's search.

    Args:
        evaluate: The problem; its values are finite.
        points: First population. (population, d)
        objectives, constraints: Numbers of objectives and constraints.
        until: When to stop, in the words of pymoo: ("n_eval", 2000) or ("n_gen", 40).
        population: Designs of a generation.
        seed: Of all random numbers.
        note: Called after each generation with pymoo's algorithm.
    """
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Bounded(Problem):
        """The problem in the form of pymoo."""

        def __init__(self) -> None:
            super().__init__(
                n_var=points.shape[1], n_obj=objectives, n_ieq_constr=constraints, xl=0.0, xu=1.0
            )

        def _evaluate(self, x: FloatArray, out: Any, *_: Any, **__: Any) -> None:
            out["F"], g = evaluate(np.asarray(x, dtype=float))
            if constraints:
                out["G"] = g

    algorithm = _algorithm(objectives, population, points)
    more = {} if note is None else {"callback": note}
    return minimize(Bounded(), algorithm, until, seed=seed, **more)


def _algorithm(objectives: int, population: int, points: FloatArray) -> Any:
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.util.ref_dirs import get_reference_directions

    if objectives <= 2:
        return NSGA2(pop_size=population, sampling=points)
    parts = 1
    while len(get_reference_directions("das-dennis", objectives, n_partitions=parts + 1)) <= (
        population
    ):
        parts += 1
    directions = get_reference_directions("das-dennis", objectives, n_partitions=parts)
    return NSGA3(directions, pop_size=population, sampling=points)
