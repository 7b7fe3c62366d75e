"""Grid search of [B] section 3.1.2: a grid over the region, then grids of half the size around the best point so far."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize

from wm_drake.parameters.types import FloatArray

POINTS_PER_AXIS = 5
"""Of each grid: 25 points for two unknowns, as in [B]."""

MOST_ROUNDS = 12
"""By then the grid is 4000 times finer than at first."""

Objective: TypeAlias = Callable[[Sequence[FloatArray]], list[float]]
"""Values at several points, which may be computed side by side."""


@dataclass(frozen=True)
class Round:
    """One grid: the points that were new in it, their values, and the best point known after it."""

    points: FloatArray
    values: FloatArray
    best: FloatArray
    best_value: float


@dataclass(frozen=True)
class Search:
    """How an optimum was found.

    Attributes:
        best, value: The optimum.
        evaluations: Points at which the objective was computed.
        rounds: The grids, of a grid search.
    """

    best: FloatArray
    value: float
    evaluations: int
    rounds: tuple[Round, ...] = ()


def grid_search(objective: Objective, lower: FloatArray, upper: FloatArray, stop: float) -> Search:
    """Refines a grid around its best point until a round gains less than `stop`.

    Points of a finer grid outside the region are left out, those known already are not computed again.

    Args:
        objective: To be smallest.
        lower, upper: The region.
        stop: Smallest gain of the objective from round to round that is worth another one.
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
        grid = (
            centre + steps / 2.0**number
        )  # in units of the region; quarters of powers of two, so exact
        inside = grid[np.all((grid >= 0.0) & (grid <= 1.0), axis=1)]
        new = [point for point in inside if tuple(point) not in known]
        points = [lower + point * (upper - lower) for point in new]
        values = objective(points)
        known |= dict(zip((tuple(map(float, point)) for point in new), values, strict=True))
        centre = np.array(min(known, key=lambda point: known[point]))
        best_value = known[tuple(centre)]
        shown = np.array(points).reshape(-1, len(lower))
        rounds.append(Round(shown, np.array(values), lower + centre * (upper - lower), best_value))
        if number and rounds[-2].best_value - best_value < stop:
            break
    return Search(rounds[-1].best, rounds[-1].best_value, len(known), tuple(rounds))


def bounded_search(
    objective: Objective, lower: FloatArray, upper: FloatArray, stop: float
) -> Search:
    """scipy's Nelder-Mead within the region, from its middle; envelopes have kinks, so no method that needs slopes.

    Args:
        objective, lower, upper: As for `grid_search`.
        stop: Ends when the values at all corners of the simplex are this near, and their places within a thousandth.
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
    """A quarter of the region wide, about its middle."""
    return np.vstack([np.full(size, 0.4), 0.4 + 0.25 * np.eye(size)])
