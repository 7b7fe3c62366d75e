"""Grid search of [B] section 3.1.2, which goes on where that of [B] may end beside the optimum.

[B] halves its grid in each round and stops when the distance falls by less than 0.02, so a round
without a better point ends it. Here the first grid covers the region. Each further grid is centred
at the best point so far. Its spacing is halved only if the last grid gave no better point;
otherwise the grid moves on with the same spacing. So the search follows a diagonal valley, where
the best point of a grid is far from the optimum. This is a pattern search; it ends when the spacing
is as fine as demanded. The rule of [B] can be chosen.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import FitProblem
from wm_drake.studies.fitting.search import Optimum, Search

POINTS_PER_AXIS = 5
"""Points of a grid along each axis: 25 points for two unknowns, as in [B]."""


@dataclass(frozen=True)
class Round:
    """One grid.

    Attributes:
        points: Its new points. [SI]
        values: Cost at these points.
        best: The best point so far. [SI]
        spacing: Distance of neighbouring points, as a part of the region.
    """

    points: FloatArray
    values: FloatArray
    best: FloatArray
    spacing: float


def grid_search(
    problem: FitProblem, mesh: float, *, least_fall: float | None = None
) -> tuple[Optimum, tuple[Round, ...]]:
    """Minimize the cost by grids that move to the best point and are refined there.

    Points of a grid that are outside the region are omitted. Points that are known already are not
    computed again. The number of grids is finite: each one either finds a better point of the same
    mesh or is the last one of its spacing.

    Args:
        problem: A problem whose unknowns have no priors: the region is the unit cube.
        mesh: Spacing at which the search ends, as a part of the region, > 0. The last grid has at
            most this spacing, and no point of it is better than its centre.
        least_fall: Rule of [B] in place of the mesh: each grid has half the spacing of the one
            before, and the search ends at the first fall of the cost below this.

    Returns:
        The optimum, and the grids.
    """
    search, size = Search(problem), len(problem.unknowns)
    known: dict[tuple[float, ...], float] = {}
    steps = _offsets(size)
    centre, spacing, before = np.full(size, 0.5), 1.0 / (POINTS_PER_AXIS - 1), np.inf
    rounds = list[Round]()
    while True:
        # the coordinates are dyadic fractions, which floats hold exactly
        grid = centre + spacing * steps
        inside = grid[np.all((grid >= 0.0) & (grid <= 1.0), axis=1)]
        new = np.array([point for point in inside if tuple(point) not in known]).reshape(-1, size)
        values = search.costs(new) if len(new) else np.empty(0)
        known |= {tuple(map(float, p)): float(v) for p, v in zip(new, values, strict=True)}
        best = min(known, key=lambda point: known[point])
        is_better = known[best] < known[tuple(map(float, centre))]
        centre = np.array(best) if is_better else centre
        best_value = known[tuple(map(float, centre))]
        points, best_point = problem.points_at(new), problem.points_at(centre)
        rounds.append(Round(points, values, best_point, spacing))
        if least_fall is None:
            is_last, is_halved = not is_better and spacing <= mesh, not is_better
        else:
            is_last, is_halved = not before - best_value >= least_fall, True
        if is_last:
            break
        spacing, before = spacing * (0.5 if is_halved else 1.0), best_value
    return Optimum(centre, best_value, len(known)), tuple(rounds)


def _offsets(size: int) -> FloatArray:
    """Return the points of a grid with spacing 1 around its centre, one row per point."""
    along = [np.arange(POINTS_PER_AXIS) - POINTS_PER_AXIS // 2] * size
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, size).astype(float)
