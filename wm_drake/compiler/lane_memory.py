"""Memory of SIMD lanes: aligned arrays, filled from the arrays of several runs."""

import numpy as np

from wm_drake.compiler.lanes import WIDTH

_FloatArray = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


def aligned(size: int) -> _FloatArray:
    """Return zeros at an address that is aligned to the size of a vector of lanes. (size,)"""
    raw = np.zeros(size + WIDTH)
    begin = (-raw.ctypes.data // raw.itemsize) % WIDTH
    return raw[begin : begin + size]


def fill_lanes(lanes: _FloatArray, runs: list[_FloatArray]) -> _FloatArray:
    """Write arrays of up to `WIDTH` runs into a flat array of lanes.

    Idle lanes repeat the last run.

    Args:
        lanes: (size * WIDTH,), written.
        runs: Array (size,) of each run.

    Returns:
        The array of lanes.
    """
    idle = WIDTH - len(runs)
    rows = lanes.reshape(-1, WIDTH)
    if len(runs) == 1:
        rows[:] = runs[0][:, None]
    else:
        np.stack([*runs, *runs[-1:] * idle], axis=1, out=rows)
    return lanes
