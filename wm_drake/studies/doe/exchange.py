"""D-optimal designs by exchange of rows: modified Fedorov, with rank-two updates."""

import numpy as np
from threadpoolctl import threadpool_limits

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.doe.coding import Levels, level_matrix, model_matrix

LARGEST_GRID = 3**9
"""Trials that the exchange chooses from at most; of a larger grid, so many taken at random."""

MOST_PASSES = 10
SMALLEST_GAIN = 2e-4
"""Over all trials, the exchange goes on while a pass gains more than this of the D-efficiency."""


def d_optimal_levels(factors: int, trials: int, model: str, seed: int) -> Levels:
    """Trials, all different, that determine the coefficients of a model as well as so many can: largest det X'X.

    From a random start, each trial in turn is exchanged for the one of the grid that raises the determinant most, until a
    pass over all trials gains nothing worth having [Cook and Nachtsheim 1980, modified Fedorov exchange]. det X'X changes by
    the factor (1 + d_j)(1 - d_i) + d_ij^2 when j replaces i, with d_ij = x_i' (X'X)^-1 x_j.

    Args:
        factors: Number of factors.
        trials: At least as many as the model has columns, fewer than the grid.
        model: Key of `MODELS`.
        seed: Of the start; the same seed gives the same design.

    Returns:
        Sorted, so that only the set of trials matters.
    """
    rng = np.random.default_rng(seed)
    grid = _grid(factors, rng)
    candidates = model_matrix(grid, model)
    columns = np.ascontiguousarray(candidates.T)
    log_determinant = -np.inf
    with threadpool_limits(
        1, "blas"
    ):  # the products are small: threads would wait for each other, on a busy machine for long
        chosen = _independent_start(candidates, trials, rng)
        for _ in range(MOST_PASSES):
            _pass(columns, chosen)
            last, log_determinant = (
                log_determinant,
                np.linalg.slogdet(candidates[chosen].T @ candidates[chosen])[1],
            )
            if log_determinant - last < SMALLEST_GAIN * candidates.shape[1]:
                break
    levels = grid[chosen]
    return levels[np.lexsort(levels.T[::-1])]


def _grid(factors: int, rng: np.random.Generator) -> Levels:
    if 3**factors <= LARGEST_GRID:
        return level_matrix(factors)
    drawn = np.unique(rng.integers(-1, 2, size=(2 * LARGEST_GRID, factors), dtype=np.int8), axis=0)
    return rng.permutation(drawn)[:LARGEST_GRID]


def _independent_start(candidates: FloatArray, trials: int, rng: np.random.Generator) -> np.ndarray:
    """Random rows that determine all coefficients: first one for each column, by elimination, then any others."""
    order = rng.permutation(len(candidates))
    remaining = candidates[order[: 8 * candidates.shape[1]]].copy()
    basis = []
    for _ in range(candidates.shape[1]):
        sizes = np.einsum("ij,ij->i", remaining, remaining)
        best = int(np.argmax(sizes))
        basis.append(best)
        direction = remaining[best] / np.sqrt(sizes[best])
        remaining -= np.outer(remaining @ direction, direction)
    others = np.setdiff1d(np.arange(len(order)), basis)
    return order[np.concatenate([basis, others[: trials - len(basis)]])]


def _pass(columns: FloatArray, chosen: np.ndarray) -> None:
    """One exchange for each chosen trial, if any gains; changes `chosen`. `columns` are those of the model, (p, candidates)."""
    inverse = np.linalg.inv(columns[:, chosen] @ columns[:, chosen].T)
    variance = np.einsum("ji,ji->i", columns, inverse @ columns)
    free = np.ones(columns.shape[1], dtype=bool)
    free[chosen] = False
    covariance = (inverse @ columns[:, chosen[0]]) @ columns
    for place, old in enumerate(chosen.copy()):
        factor = np.where(free, (1.0 + variance) * (1.0 - variance[old]) + covariance**2, 0.0)
        new = int(np.argmax(factor))
        steps, scales = [], []
        if factor[new] > 1.0 + 1e-9:
            for row, sign in ((new, 1.0), (old, -1.0)):
                step = inverse @ columns[:, row]
                scale = sign / (1.0 + sign * float(columns[:, row] @ step))
                inverse -= scale * np.outer(step, step)
                steps.append(step)
                scales.append(scale)
            free[old], free[new] = True, False
            chosen[place] = new
        following = columns[:, chosen[(place + 1) % len(chosen)]]
        *changes, covariance = (
            np.stack([*steps, inverse @ following]) @ columns
        )  # all products with the grid in one go
        for scale, change in zip(scales, changes, strict=True):
            variance -= scale * change**2
