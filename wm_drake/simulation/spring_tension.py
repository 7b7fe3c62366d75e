"""Smallest tension of each spring over a run, and the springs that go slack."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from wm_drake.elements.spring import SpringStrutParameters
from wm_drake.parameters.types import FloatArray


def smallest_tensions(tension: FloatArray) -> FloatArray:
    """Return the smallest value over time of each column of a history (time, spring). [N]

    It is NaN if there are no samples, 0 for a spring that goes slack, and below 0 for a spring that
    pushes.
    """
    return tension.min(axis=0) if len(tension) else np.full(tension.shape[1], np.nan)


def tensions_at(
    springs: Iterable[SpringStrutParameters], lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the tensions of springs, and their elongations from the free length, at lengths.

    The tension never falls with the length, so that the smallest length gives the smallest tension.

    Args:
        lengths: Length of each; not finite for a run without samples. [m]

    Returns:
        Tensions [N] and elongations [m]; NaN where the length is not finite. An elongation is
        negative for a slack spring, and NaN for a spring without a free length.
    """
    answer = np.full((2, len(lengths)), np.nan)
    for column, (spring, length) in enumerate(zip(springs, lengths, strict=True)):
        if np.isfinite(length):
            free = spring.free_length
            answer[:, column] = spring.tension(length), np.nan if free is None else length - free
    return answer[0], answer[1]


def slack_springs(smallest: xr.DataArray) -> list[str]:
    """Return the names of the springs whose smallest tension (spring) is 0. [N]

    A tension-compression spring does not have the tension 0 for longer than an instant.
    """
    return [str(name) for name in smallest.spring.values[smallest.values == 0.0]]
