"""Orthogonal arrays of up to eight factors: the trials x of the grid with H x = 0 modulo 3.

H is the parity-check matrix of a linear code over the field of three elements. With two of its rows
729 of the 3^8 trials remain, in which any five factors have all their level combinations equally
often (strength 5). With three rows 243 trials of strength 4 remain. Both arrays determine main
effects and two-factor interactions as well as the full factorial does. With all five rows 27 trials
of strength 2 remain, which are enough for a mean: main effects and interactions of two factors
cancel in it as in the full factorial. For fewer factors, columns are removed, which does not reduce
the strength.
"""

import numpy as np

from wm_drake.errors import input_error
from wm_drake.studies.doe.coding import Levels, level_matrix

CHECKS = np.array(
    [
        [1, 1, 1, 1, 1, 1, 0, 0],
        [2, 1, 0, 2, 1, 0, 1, 2],
        [1, 1, 0, 2, 0, 2, 2, 0],
        [2, 2, 0, 2, 0, 0, 0, 1],
        [0, 1, 0, 2, 1, 2, 2, 2],
    ]
)
"""Parity-check matrix H for eight factors: two rows for 729 trials, three for 243, all for 27.

The last two rows were searched for the fewest sets of three factors (8 of 56) whose combinations
are not all equally frequent among the 27 trials.
"""

_ROWS = {729: 2, 243: 3, 27: 5}


def orthogonal_levels(factors: int, trials: int) -> Levels:
    """Return the orthogonal array with a number of trials.

    If the full factorial is not larger than the array, the full factorial is returned.

    Args:
        factors: Number of factors, at most eight.
        trials: Number of trials, 27, 243 or 729.
    """
    if trials not in _ROWS:
        raise input_error(
            f"{trials} trials are not possible; orthogonal designs have 27, 243 or 729"
        )
    if factors > CHECKS.shape[1]:
        raise input_error(
            f"{factors} factors are too many; orthogonal designs have at most {CHECKS.shape[1]}. "
            "Use a D-optimal design"
        )
    if 3**factors <= trials:
        return level_matrix(factors)
    full = level_matrix(CHECKS.shape[1])
    array = full[~np.any((full.astype(int) + 1) @ CHECKS[: _ROWS[trials]].T % 3, axis=1)]
    levels = array[:, :factors]
    return levels[np.lexsort(levels.T[::-1])]
