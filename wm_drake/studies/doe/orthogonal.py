"""Orthogonal arrays of up to eight factors: the trials x of the grid with H x = 0 modulo 3.

The rows of H are those of a linear code over the field of three elements. Two of them leave 729 of 3^8 trials, in which any
five factors take all their level combinations equally often (strength 5); three leave 243 of strength 4. Both determine main
effects and two-factor interactions as well as the full factorial does. Fewer factors: columns left out, which keeps the
strength.
"""

import itertools

import numpy as np

from wm_drake.errors import input_error
from wm_drake.studies.doe.coding import Levels, level_matrix

CHECKS = np.array([[1, 1, 1, 1, 1, 1, 0, 0], [2, 1, 0, 2, 1, 0, 1, 2], [1, 1, 0, 2, 0, 2, 2, 0]])
"""Parity checks H for eight factors: rows 1 and 2 for 729 trials, all for 243."""

_ROWS = {729: 2, 243: 3}


def orthogonal_levels(factors: int, trials: int) -> Levels:
    """The orthogonal array of so many trials.

    Args:
        factors: At most eight.
        trials: 243 or 729; the grid of the factors if that is no larger.

    Raises:
        InputError: there is none of this size here.
    """
    if trials not in _ROWS:
        raise input_error(
            f"{trials} trials: orthogonal designs have {' or '.join(map(str, sorted(_ROWS)))}"
        )
    if factors > CHECKS.shape[1]:
        raise input_error(
            f"{factors} factors: orthogonal designs have at most {CHECKS.shape[1]}; take a D-optimal one"
        )
    if 3**factors <= trials:
        return level_matrix(factors)
    full = level_matrix(CHECKS.shape[1])
    array = full[~np.any((full.astype(int) + 1) @ CHECKS[: _ROWS[trials]].T % 3, axis=1)]
    levels = array[:, :factors]
    return levels[np.lexsort(levels.T[::-1])]


def strength(levels: Levels, most: int = 5) -> int:
    """The largest t, up to a most, for which any t factors take all their level combinations equally often."""
    for size in range(1, min(most, levels.shape[1]) + 1):
        for columns in itertools.combinations(range(levels.shape[1]), size):
            cells = (levels[:, columns].astype(int) + 1) @ 3 ** np.arange(size)
            counts = np.bincount(cells, minlength=3**size)
            if counts.min() != counts.max():
                return size - 1
    return min(most, levels.shape[1])
