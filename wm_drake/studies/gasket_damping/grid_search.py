"""Grid search of [B] section 3.1.2, and a bounded Nelder-Mead search to compare with.

The first grid covers the region. Each further grid is centred at the best point so far. Its spacing
is halved only if the last grid gave no better point; otherwise the grid moves on with the same
spacing. So the search follows a diagonal valley, where the best point of a grid is far from the
optimum. This is a pattern search; it ends when the spacing is as fine as demanded.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize

from wm_drake.parameters.types import FloatArray

POINTS_PER_AXIS = 5
"""Points of a grid along each axis: 25 points for two unknowns, as in [B]."""

Objective: TypeAlias = Callable[[Sequence[FloatArray]], list[float]]
"""Function that returns the values at several points, so that they can be computed in parallel."""


@dataclass(frozen=True)
class Round:
    """One grid.

    Attributes:
        points: Its new points.
        values: Objective at these points.
        best: The best point so far.
        best_value: Objective at the best point.
        spacing: Distance of neighbouring points, as a part of the region.
    """

    points: FloatArray
    values: FloatArray
    best: FloatArray
    best_value: float
    spacing: float


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


def grid_search(objective: Objective, lower: FloatArray, upper: FloatArray, mesh: float) -> Search:
    """Minimize an objective by grids that move to the best point and are refined there.

    Points of a grid that are outside the region are omitted. Points that are known already are not
    computed again. The number of grids is finite: each one either finds a better point of the same
    mesh or is the last one of its spacing.

    Args:
        objective: Objective to minimize.
        lower, upper: Bounds of the region.
        mesh: Spacing at which the search ends, as a part of the region, > 0. The last grid has at
            most this spacing, and no point of it is better than its centre.
    """
    known: dict[tuple[float, ...], float] = {}
    steps = _offsets(len(lower))
    centre, spacing = np.full(len(lower), 0.5), 1.0 / (POINTS_PER_AXIS - 1)
    rounds = list[Round]()
    while True:
        # in units of the region; the coordinates are dyadic fractions, which floats hold exactly
        grid = centre + spacing * steps
        inside = grid[np.all((grid >= 0.0) & (grid <= 1.0), axis=1)]
        new = [point for point in inside if tuple(point) not in known]
        points = [lower + point * (upper - lower) for point in new]
        values = objective(points)
        known |= dict(zip((tuple(map(float, point)) for point in new), values, strict=True))
        best = min(known, key=lambda point: known[point])
        is_better = known[best] < known[tuple(map(float, centre))]
        centre = np.array(best) if is_better else centre
        best_value = known[tuple(map(float, centre))]
        new_points = np.array(points).reshape(-1, len(lower))
        best_point = lower + centre * (upper - lower)
        rounds.append(Round(new_points, np.array(values), best_point, best_value, spacing))
        if not is_better:
            if spacing <= mesh:
                break
            spacing *= 0.5
    return Search(rounds[-1].best, rounds[-1].best_value, len(known), tuple(rounds))


def _offsets(size: int) -> FloatArray:
    """Return the points of a grid with spacing 1 around its centre, one row per point."""
    along = [np.arange(POINTS_PER_AXIS) - POINTS_PER_AXIS // 2] * size
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, size).astype(float)


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
