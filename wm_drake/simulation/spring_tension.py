"""Smallest tension of each spring over a run, and the springs that go slack."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import where
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.compiler.vectors import rotate
from wm_drake.elements.motion import PLANT_STATE_SIZE, tub_motion
from wm_drake.elements.spring import SpringStrutParameters, read_spring
from wm_drake.elements.strut import strut_line
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.histories import in_bounds


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
        springs: The springs.
        lengths: Length of each; not finite for a run without samples. [m]

    Returns:
        Tensions [N] and elongations [m]; NaN where the length is not finite. An elongation is
        negative for a slack spring, and NaN for a spring without a free length.
    """
    found = np.full((2, len(lengths)), np.nan)
    for column, (spring, length) in enumerate(zip(springs, lengths, strict=True)):
        if np.isfinite(length):
            free = spring.free_length
            found[:, column] = spring.tension(length), np.nan if free is None else length - free
    return found[0], found[1]


def slack_springs(smallest: xr.DataArray) -> list[str]:
    """Return the names of the springs whose smallest tension (spring) is 0. [N]

    A tension-compression spring does not have the tension 0 for longer than an instant.
    """
    return [str(name) for name in smallest.spring.values[smallest.values == 0.0]]


@long_running
def smallest_lengths_lanes(samples, rows, size, bounds, p, springs, smallest):
    """Measure `lanes.WIDTH` runs side by side, each up to its first sample out of bounds.

    All arrays of floats but `bounds` are flat arrays of lanes.

    Args:
        samples: Samples, one after the other, each with the state first.
        rows, size: Number of samples, and of the numbers in each.
        bounds: Largest angle and displacement of the tub at which a run goes on. [rad, m]
        p: Packed numbers.
        springs: Array of the indices of the springs in them.
        smallest: Written: smallest length of each spring [m]; inf for a run without samples in
            bounds.
    """
    align_stack()
    x_numbers = np.empty(PLANT_STATE_SIZE * WIDTH)
    x, states, numbers = lane_array(x_numbers), lane_array(samples), lane_array(p)
    least = lane_array(smallest)
    zero = 0.0 * numbers[0]
    for k in range(len(springs)):
        least[k] = zero + np.inf
    good = zero + 1.0
    for row in range(rows):
        for k in range(PLANT_STATE_SIZE):
            x[k] = states[row * size + k]
        good = good * in_bounds(x, bounds[0], bounds[1])
        motion = tub_motion(x)
        for k in range(len(springs)):
            spring = read_spring(numbers, springs[k])
            arm = rotate(motion.rotation, spring.p_ToA_T)
            length, _, _, _, _ = strut_line(motion, arm, spring.p_WH)
            least[k] = where((good > 0.5) & (length < least[k]), length, least[k])
