"""D-optimal designs by the modified Fedorov exchange of trials, with rank-two updates."""

import hashlib

import numpy as np

from wm_drake.compiler.kept import kept
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.doe.coding import Levels, level_matrix, model_matrix
from wm_drake.studies.threads import on_one_thread

LARGEST_GRID = 3**9
"""Largest number of trials to choose from; for a larger grid, a random sample of this size."""

MOST_PASSES = 10
"""Limit of the number of passes over all trials."""

SMALLEST_GAIN = 2e-4
"""Relative gain of the D-efficiency in one pass below which the exchange ends."""


@on_one_thread
def d_optimal_levels(factors: int, trials: int, model: str, seed: int) -> Levels:
    """Search for distinct trials with the largest det X'X; a design that was found is kept on disk.

    From a random start, each trial in turn is exchanged for the trial of the grid that raises the
    determinant most, until a pass over all trials raises it by too little [Cook and Nachtsheim
    1980, modified Fedorov exchange]. If trial j replaces trial i, det X'X changes by the factor

        (1 + d_j) (1 - d_i) + d_ij^2,   d_ij = x_i' (X'X)^-1 x_j,   d_i = d_ii.

    Args:
        trials: Number of trials: at least the number of columns of the model, fewer than the grid
            has.
        model: Key of `MODELS`.
        seed: Seed of the random start; the design depends on it.
    """
    rng = np.random.default_rng(seed)
    grid = _grid(factors, rng)
    candidates = model_matrix(grid, model)
    start = _independent_start(candidates, trials, rng)
    inputs = hashlib.sha256(candidates.tobytes() + start.tobytes()).hexdigest()
    best = kept(f"D-optimal exchange: {inputs}", lambda: _exchanged(candidates, start).tobytes())
    chosen = np.frombuffer(best, start.dtype)
    levels = grid[chosen]
    return levels[np.lexsort(levels.T[::-1])]


def _exchanged(candidates: FloatArray, start: np.ndarray) -> np.ndarray:
    """Return the indices of the chosen trials after all passes, from those of the start."""
    columns = np.ascontiguousarray(candidates.T)
    chosen, log_determinant = start.copy(), -np.inf
    for _ in range(MOST_PASSES):
        _pass(columns, chosen)
        last, log_determinant = (
            log_determinant,
            np.linalg.slogdet(candidates[chosen].T @ candidates[chosen])[1],
        )
        if log_determinant - last < SMALLEST_GAIN * candidates.shape[1]:
            break
    return chosen


def _grid(factors: int, rng: np.random.Generator) -> Levels:
    if 3**factors <= LARGEST_GRID:
        return level_matrix(factors)
    drawn = np.unique(rng.integers(-1, 2, size=(2 * LARGEST_GRID, factors), dtype=np.int8), axis=0)
    return rng.permutation(drawn)[:LARGEST_GRID]


def _independent_start(candidates: FloatArray, trials: int, rng: np.random.Generator) -> np.ndarray:
    """Return indices of random trials that determine all coefficients.

    First, elimination selects one trial for each column of the model; the others are random.
    """
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
    """Exchange each chosen trial in turn if this raises the determinant.

    Args:
        columns: (p, candidates) columns of the model for all candidates.
        chosen: Indices of the chosen trials; changed in place.
    """
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
        # one matrix product with the grid is faster than several
        *changes, covariance = np.stack([*steps, inverse @ following]) @ columns
        for scale, change in zip(scales, changes, strict=True):
            variance -= scale * change**2
