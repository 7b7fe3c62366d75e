"""Loads and margins of the feet of the cabinet at samples, and over a run, as compiled code."""

import math

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.feet import load_on_feet, normal_and_holding, read_feet
from wm_drake.laws.feet import (
    sliding_margin,
    tangential_loads,
    tilting_margin,
    turning_margin,
    turning_margin_bound,
)

FEET_COUNT = 4
NORMAL_SMALLEST, NORMAL_LARGEST, TANGENTIAL_LARGEST = range(3)
"""Rows of the extremes of the feet."""
LEAST_LOAD, SLIDE, TURN, TILT = range(4)
"""Columns of the smallest values: load of any foot [N], margins of sliding [N], turning [N m] and
tilting [N m]."""


@long_running
def foot_history(wrenches, p, loads, margins):
    """Evaluate loads and margins of the feet at each sample.

    Args:
        wrenches: (n, 6) moment about the origin of W and force of all mounts on the cabinet, in W.
            [N m, N]
        p: Numbers of `FEET`.
        loads: (n, 2, 4), written: normal and tangential load of each foot. [N]
        margins: (n, 4), written: columns as `LEAST_LOAD`, `SLIDE`, `TURN`, `TILT`.
    """
    feet = read_feet(p, 0)
    for row in range(len(wrenches)):
        load = load_on_feet(wrenches[row], feet)
        normal, holding = normal_and_holding(load, feet)
        tangential = tangential_loads(load[1], load[2], load[5], normal, feet.x, feet.y)
        for i in range(FEET_COUNT):
            loads[row, 0, i] = normal[i]
            loads[row, 1, i] = tangential[i]
        margins[row, LEAST_LOAD] = min(min(normal[0], normal[1]), min(normal[2], normal[3]))
        margins[row, SLIDE] = sliding_margin(load[1], load[2], holding)
        margins[row, TURN] = turning_margin(load[1], load[2], load[5], holding, feet.x, feet.y)
        margins[row, TILT] = tilting_margin(load[0], load[3], load[4], feet.x, feet.y)


@long_running
def foot_extremes(wrenches, p, region_of, extremes, smallest):
    """Find the extremes of the loads of the feet, and the smallest margins of run and regions.

    The margin of turning is computed only where its lower bound is below the smallest so far.

    Args:
        wrenches, p: As for `foot_history`.
        region_of: (>= n,) number of the region of each sample, -1 for none.
        extremes: (3, 4), written: rows as `NORMAL_SMALLEST`, `NORMAL_LARGEST`,
            `TANGENTIAL_LARGEST`, a column for each foot. [N] NaN without samples.
        smallest: (1 + regions, 4), written: smallest values of the run, then of each region;
            columns as `LEAST_LOAD`, `SLIDE`, `TURN`, `TILT`. Infinite without samples.
    """
    feet = read_feet(p, 0)
    extremes[:] = np.nan
    smallest[:] = math.inf
    for row in range(len(wrenches)):
        load = load_on_feet(wrenches[row], feet)
        f_x, f_y, m_z = load[1], load[2], load[5]
        normal, holding = normal_and_holding(load, feet)
        tangential = tangential_loads(f_x, f_y, m_z, normal, feet.x, feet.y)
        for i in range(FEET_COUNT):
            extremes[NORMAL_SMALLEST, i] = np.fmin(extremes[NORMAL_SMALLEST, i], normal[i])
            extremes[NORMAL_LARGEST, i] = np.fmax(extremes[NORMAL_LARGEST, i], normal[i])
            extremes[TANGENTIAL_LARGEST, i] = np.fmax(
                extremes[TANGENTIAL_LARGEST, i], tangential[i]
            )
        least = min(min(normal[0], normal[1]), min(normal[2], normal[3]))
        slide = sliding_margin(f_x, f_y, holding)
        tilt = tilting_margin(load[0], load[3], load[4], feet.x, feet.y)
        region = region_of[row] + 1
        bound = turning_margin_bound(f_x, f_y, m_z, holding, feet.x, feet.y)
        turn = math.inf
        if bound < smallest[0, TURN] or bound < smallest[region, TURN]:
            turn = turning_margin(f_x, f_y, m_z, holding, feet.x, feet.y)
        for k in (0, region):  # the run, and the region if there is one
            smallest[k, LEAST_LOAD] = min(smallest[k, LEAST_LOAD], least)
            smallest[k, SLIDE] = min(smallest[k, SLIDE], slide)
            smallest[k, TURN] = min(smallest[k, TURN], turn)
            smallest[k, TILT] = min(smallest[k, TILT], tilt)
