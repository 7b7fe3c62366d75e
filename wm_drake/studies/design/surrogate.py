"""Search for a Pareto front with response surfaces that are cheap to evaluate.

It is independent of machines. Radial basis functions (cubic, with a linear trend) interpolate all
objectives and constraints of the designs that were evaluated. NSGA finds the front of these
surfaces, and the designs of it that lie farthest from known objectives are evaluated next.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import RBFInterpolator

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.design.search import (
    Problem,
    SearchResult,
    SearchSettings,
    first_population,
    hypervolume,
    minimized,
)

BATCH = 16
"""Designs that are evaluated before the surfaces are fitted again."""

GENERATIONS = 40
"""Generations of the search on the surfaces."""

MOST_POINTS = 600
"""Largest number of designs that a surface goes through, the best ones of the known designs."""

SAME = 1e-3
"""Distance below which two designs count as the same. [length of the unit cube]"""


def search_with_surfaces(problem: Problem, settings: SearchSettings) -> SearchResult:
    """Return the Pareto front of a problem, as `search_front` does."""
    known, evaluations = _Known(problem), settings.evaluations
    known.add(first_population(problem.start, settings))
    history = [(len(known.x), known.volume())]
    while len(known.x) < evaluations:
        batch = min(BATCH, evaluations - len(known.x))
        known.add(_next_designs(known, batch, settings))
        history.append((len(known.x), known.volume()))
    best = np.flatnonzero(known.is_best())
    best = best[np.lexsort(known.f[best].T[::-1])]
    first = known.f[: settings.population]
    return SearchResult(
        known.x[best], known.f[best], known.g[best], len(known.x), first, tuple(history)
    )


class _Known:
    """All designs that were evaluated.

    Attributes:
        x, f, g: Designs (n, d), objectives (n, m), constraints (n, k); NaN where not evaluable.
        first: Objectives of the first population.
    """

    def __init__(self, problem: Problem) -> None:
        """Begin without designs."""
        self.problem = problem
        self.x: FloatArray = np.empty((0, len(problem.start)))
        self.f: FloatArray = np.empty((0, problem.objectives))
        self.g: FloatArray = np.empty((0, problem.constraints))
        self.first: FloatArray = self.f

    def add(self, designs: FloatArray) -> None:
        """Evaluate designs and keep them."""
        f, g = self.problem.evaluate(designs)
        self.x = np.vstack([self.x, designs])
        self.f, self.g = np.vstack([self.f, f]), np.vstack([self.g, g])
        if not len(self.first):
            self.first = np.where(self.is_usable()[:, None], f, np.inf)

    def is_usable(self) -> np.ndarray:
        """Return whether each design was evaluated without failure. (n,)"""
        return np.asarray(np.isfinite(np.hstack([self.f, self.g])).all(axis=1))

    def is_best(self) -> np.ndarray:
        """Return whether each design meets the constraints and no other is better. (n,)"""
        from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

        allowed = self.is_usable() & (self.g <= 0.0).all(axis=1)
        best = np.zeros(len(self.x), dtype=bool)
        rows = np.flatnonzero(allowed)
        if len(rows):
            best[rows[NonDominatedSorting().do(self.f[rows], only_non_dominated_front=True)]] = True
        return best

    def volume(self) -> float:
        """Return the hypervolume of the best designs."""
        return hypervolume(self.f[self.is_best()], self.first)

    def ranked(self) -> np.ndarray:
        """Return the usable designs, the best first: least violation, then rank of the front."""
        from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

        rows = np.flatnonzero(self.is_usable())
        spread = np.ptp(self.g[rows], axis=0)
        violation = (np.maximum(self.g[rows], 0.0) / np.where(spread > 0, spread, 1.0)).sum(axis=1)
        _, rank = NonDominatedSorting().do(self.f[rows], return_rank=True)
        return rows[np.lexsort((rank, violation))]


def _next_designs(known: _Known, count: int, settings: SearchSettings) -> FloatArray:
    """Return the designs to evaluate next. (count, d)"""
    settings = replace(settings, seed=settings.seed + len(known.x))
    random, population = np.random.default_rng(settings.seed), settings.population
    rows, size = known.ranked()[:MOST_POINTS], known.x.shape[1]
    others = random.random((count, size))
    if len(rows) <= size + 1:  # too few for a linear trend
        return others
    surfaces = _surfaces(known.x[rows], np.hstack([known.f[rows], known.g[rows]]))
    objectives = known.problem.objectives

    def predicted(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        values = surfaces(x)
        return values[:, :objectives], values[:, objectives:]

    begin = np.vstack([known.x[rows[:population]], random.random((population, size))])[:population]
    problem = replace(known.problem, evaluate=predicted)
    result = minimized(problem, begin, ("n_gen", GENERATIONS), settings)
    candidates: Any = np.atleast_2d(result.X) if result.X is not None else others
    values = predicted(np.asarray(candidates, dtype=float))[0]
    return _spread(candidates, values, known, count, random)


def _spread(
    candidates: FloatArray,
    values: FloatArray,
    known: _Known,
    count: int,
    random: np.random.Generator,
) -> FloatArray:
    """Return the candidates whose objectives are farthest from known and from each other.

    If too few candidates differ from known designs, random neighbours of candidates are added.

    Args:
        candidates, values: Designs of a predicted front and their predicted objectives.
        known: Designs that were evaluated.
        count: Number of designs to return.
    """
    best, taken = known.f[known.is_best()], known.x
    together = np.vstack([best, values])
    low, length = together.min(axis=0), np.ptp(together, axis=0)
    scale = np.where(length > 0.0, length, 1.0)
    scaled, near = (values - low) / scale, (best - low) / scale
    chosen: list[FloatArray] = []
    apart = np.full(len(values), np.inf)
    for point in near:
        apart = np.minimum(apart, np.linalg.norm(scaled - point, axis=1))
    while len(chosen) < count and len(candidates):
        place = int(np.argmax(apart))
        if apart[place] < 0.0:
            break
        apart = np.minimum(apart, np.linalg.norm(scaled - scaled[place], axis=1))
        apart[place] = -1.0
        if np.linalg.norm(taken - candidates[place], axis=1).min() > SAME:
            chosen.append(candidates[place])
            taken = np.vstack([taken, candidates[place]])
    while len(chosen) < count:
        base = candidates[random.integers(len(candidates))]
        moved = base + 0.05 * random.standard_normal(len(base))
        chosen.append(np.clip(moved, 0.0, 1.0))
    return np.array(chosen)


def _surfaces(x: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return interpolating surfaces of designs (n, d) and their values (n, m)."""
    low, scale = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-12)
    scaled = (values - low) / scale
    # a little smoothing keeps designs that differ by rounding only from upsetting the fit
    surface = RBFInterpolator(x, scaled, kernel="cubic", degree=1, smoothing=1e-6)
    return lambda at: np.asarray(low + scale * surface(at))
