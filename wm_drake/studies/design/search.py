"""Search for a Pareto front by NSGA-II or NSGA-III of pymoo. It is independent of machines."""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from scipy import stats

from wm_drake.errors import WmDrakeError, input_error
from wm_drake.parameters.types import FloatArray

EvaluateDesigns: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
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


@dataclass(frozen=True)
class DesignProblem:
    """What a search makes small.

    Attributes:
        evaluate: Objectives and constraints of designs.
        start: A first design. (d,) in [0, 1]
        objectives, constraints: Their numbers.
    """

    evaluate: EvaluateDesigns
    start: FloatArray
    objectives: int
    constraints: int = 0


@dataclass(frozen=True)
class SearchSettings:
    """Size of a search.

    Attributes:
        evaluations: Number of designs to evaluate, at least one population.
        population: Designs of a generation.
    """

    evaluations: int = 2000
    population: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InputError: there are fewer evaluations than designs of a generation.
            WmDrakeError: pymoo is missing.
        """
        if importlib.util.find_spec("pymoo") is None:
            raise WmDrakeError("a design study needs pymoo: pip install 'wm-drake[design]'")
        if self.evaluations < self.population:
            raise input_error(
                f"{self.evaluations} is less than the population, {self.population}",
                where="--evaluations",
            )


def search_front(problem: DesignProblem, settings: SearchSettings) -> SearchResult:
    """Return the Pareto front of a problem.

    With up to two objectives the search is NSGA-II, with more NSGA-III. The first population is the
    start and points of a scrambled Sobol sequence.
    """
    done, first = 0, list[FloatArray]()
    objectives, constraints = problem.objectives, problem.constraints
    history: list[tuple[int, float]] = []

    def usable_only(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Evaluate designs; those of the last generation beyond the allowed number count as bad."""
        nonlocal done
        f, g = (np.full((len(x), size), UNUSABLE) for size in (objectives, constraints))
        allowed = min(len(x), settings.evaluations - done)
        if allowed > 0:
            values = problem.evaluate(x[:allowed])
            usable = np.all(np.isfinite(np.hstack(values)), axis=1, keepdims=True)
            f[:allowed], g[:allowed] = (np.where(usable, v, UNUSABLE) for v in values)
        if not first:
            first.append(f)
        done += allowed
        return f, g

    def note(algorithm: Any) -> None:
        optimum = algorithm.opt
        kept = optimum.get("F")[optimum.get("feas").ravel()] if len(optimum) else np.empty((0, 1))
        history.append((done, hypervolume(kept, first[0])))

    result = minimized(
        replace(problem, evaluate=usable_only),
        first_population(problem.start, settings),
        ("n_eval", settings.evaluations),
        settings,
        note,
    )
    if result.F is None:
        x, f, g = (np.empty((0, n)) for n in (len(problem.start), objectives, constraints))
        return SearchResult(x, f, g, done, first[0], tuple(history))
    x, f = np.atleast_2d(result.X), np.reshape(result.F, (-1, objectives))
    g = np.reshape(result.G, (len(f), -1)) if constraints else np.empty((len(f), 0))
    usable = np.all(f < UNUSABLE, axis=1)
    x, f, g = x[usable], f[usable], g[usable]
    order = np.lexsort(f.T[::-1])
    return SearchResult(x[order], f[order], g[order], done, first[0], tuple(history))


def first_population(start: FloatArray, settings: SearchSettings) -> FloatArray:
    """Return a first design (d,) and points of a scrambled Sobol sequence. (population, d)"""
    random, population = np.random.default_rng(settings.seed), settings.population
    sobol = stats.qmc.Sobol(len(start), scramble=True, seed=random)
    points = sobol.random(1 << (population - 1).bit_length())[:population]
    points[0] = start
    return np.asarray(points)


def minimized(
    problem: DesignProblem,
    points: FloatArray,
    until: tuple[str, int],
    settings: SearchSettings,
    note: Callable[[Any], None] | None = None,
) -> Any:
    """Return the result of pymoo's search.

    Args:
        problem: The problem; its values are finite.
        points: First population. (population, d)
        until: When to stop, in the words of pymoo: ("n_eval", 2000) or ("n_gen", 40).
        settings: Designs of a generation, and seed.
        note: Called after each generation with pymoo's algorithm.
    """
    from pymoo.core.problem import Problem as PymooProblem
    from pymoo.optimize import minimize

    class Bounded(PymooProblem):
        """The problem in the form of pymoo."""

        def __init__(self) -> None:
            super().__init__(
                n_var=points.shape[1],
                n_obj=problem.objectives,
                n_ieq_constr=problem.constraints,
                xl=0.0,
                xu=1.0,
            )

        def _evaluate(self, x: FloatArray, out: Any, *_: Any, **__: Any) -> None:
            out["F"], g = problem.evaluate(np.asarray(x, dtype=float))
            if problem.constraints:
                out["G"] = g

    algorithm = _algorithm(problem.objectives, settings.population, points)
    more = {} if note is None else {"callback": note}
    return minimize(Bounded(), algorithm, until, seed=settings.seed, **more)


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
