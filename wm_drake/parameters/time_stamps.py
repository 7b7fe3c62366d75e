"""Measured samples with equal time stamps."""

import warnings

import numpy as np

from wm_drake.errors import InputNotice, Problem
from wm_drake.parameters.types import FloatArray


def with_distinct_times(samples: FloatArray, where: str) -> FloatArray:
    """Return samples with those of equal time stamps averaged, with a notice.

    Instruments that store few digits of the time give neighbouring samples the same one.

    Args:
        samples: (n, k) with the time in the first column.
        where: File, for the notice.

    Returns:
        (m, k), m <= n; the same array if no neighbours have the same time.
    """
    is_first = np.ones(len(samples), dtype=bool)
    is_first[1:] = np.diff(samples[:, 0]) != 0.0
    first = np.flatnonzero(is_first)
    if len(first) == len(samples):
        return samples
    sizes = np.diff(np.append(first, len(samples)))
    averaged = np.add.reduceat(samples, first) / sizes[:, None]
    averaged[:, 0] = samples[first, 0]
    message = (
        f"{int(sizes[sizes > 1].sum())} samples share their time stamp with a neighbour; they were "
        f"averaged to {int(np.sum(sizes > 1))}"
    )
    warnings.warn(str(Problem(where, "", message)), InputNotice, stacklevel=3)
    return averaged
