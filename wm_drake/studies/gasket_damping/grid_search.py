"""Grid search of [B] section 3.1.2, and a bounded Nelder-Mead search to compare with.

The first grid covers the region. Each further grid has half the size and is centred at the best
point so far.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize

from wm_drake.parameters.types import FloatArray

POINTS_PER_AXIS = 5
"""Points of a grid along each axis: 25 points for two unknowns, as in [B]."""

MOST_ROUNDS = 12
"""Limit of the number of grids; the last one is about 2000 times finer than the first."""

Objective: TypeAlias = Callable[[Sequence[FloatArray]], list[float]]
"""Function that returns the values at several points, so that they can be computed in parallel."""


@dataclass(frozen=True)
class Round:
    """One grid: its new points, their values, and the best point so far with its value."""

    points: FloatArray
    values: FloatArray
    best: FloatArray
    best_value: float


@dataclass(frozen=True)
class Search:
    """Result of a search.

    Attributes:
        best: The optimum.
        value: Objective at the optimum.
        evaluations: Number of points at which the objective was computed.
        rounds: The grids of a grid search; empty for other searches.
    """

    best: FloatArray
    value: float
    evaluations: int
    rounds: tuple[Round, ...] = ()


def grid_search(objective: Objective, lower: FloatArray, upper: FloatArray, stop: float) -> Search:
    """Minimize an objective by grids that are refined around the best point.

    Points of a finer grid that are outside the region are omitted. Points that are known already
    are not computed again.

    Args:
        objective: Objective to minimize.
        lower, upper: Bounds of the region.
        stop: The search ends when a round reduces the objective by less than this.
    """
    known: dict[tuple[float, ...], float] = {}
    offsets = np.stack(
        np.meshgrid(
            *[np.arange(POINTS_PER_AXIS) - POINTS_PER_AXIS // 2] * len(lower), indexing="ij"
        ),
        axis=-1,
    )
    steps = offsets.reshape(-1, len(lower)) / (POINTS_PER_AXIS - 1)
    centre, rounds = np.full(len(lower), 0.5), list[Round]()
    for number in range(MOST_ROUNDS):
        # in units of the region; the coordinates are dyadic fractions, which floats hold exactly
        grid = centre + steps / 2.0**number
        inside = grid[np.all((grid >= 0.0) & (grid <= 1.0), axis=1)]
        new = [point for point in inside if tuple(point) not in known]
        points = [lower + point * (upper - lower) for point in new]
        values = objective(points)
        known |= dict(zip((tuple(map(float, point)) for point in new), values, strict=True))
        centre = np.array(min(known, key=lambda point: known[point]))
        best_value = known[tuple(centre)]
        best = lower + centre * (upper - lower)
        new_points = np.array(points).reshape(-1, len(lower))
        rounds.append(Round(new_points, np.array(values), best, best_value))
        if number and rounds[-2].best_value - best_value < stop:
            break
    return Search(rounds[-1].best, rounds[-1].best_value, len(known), tuple(rounds))


def bounded_search(
    objective: Objective, lower: FloatArray, upper: FloatArray, stop: float
) -> Search:
    """Minimize an objective by scipy's Nelder-Mead method, from near the middle of the region.

    This method needs no derivatives; envelopes have kinks.

    Args:
        objective: Objective to minimize.
        lower, upper: Bounds of the region.
        stop: The search ends when the values at the corners of the simplex differ by less than
            this, and the corners by less than 0.1 % of the region.
    """
    found = minimize(
        lambda point: objective([lower + point * (upper - lower)])[0],
        np.full(len(lower), 0.5),
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(lower),
        options={"fatol": stop, "xatol": 1e-3, "initial_simplex": _simplex(len(lower))},
    )
    return Search(lower + found.x * (upper - lower), float(found.fun), int(found.nfev))


def _simplex(size: int) -> FloatArray:
    """Return a start simplex near the middle of the region, with edges of a quarter of its size."""
    return np.vstack([np.full(size, 0.4), 0.4 + 0.25 * np.eye(size)])
