"""Loads and margins of the feet of the cabinet at samples, and over a run, as compiled code."""

import math

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.elements.feet import load_on_feet, read_feet
from wm_drake.laws.feet import (
    normal_loads,
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
def fixed_feet_history(wrenches, p, loads, feet_loads):
    """Evaluate the load on the feet of a fixed cabinet at each sample, and how the feet share it.

    Args:
        wrenches: (n, 6) moment about the origin of W and force of all mounts on the cabinet, in W.
            [N m, N]
        p: Numbers of `FEET`.
        loads: (n, 6), written: as `load_on_feet` returns them.
        feet_loads: (n, 2, 4), written: normal and tangential load of each foot. [N]
    """
    feet = read_feet(p, 0)
    for row in range(len(wrenches)):
        load = load_on_feet(wrenches[row], feet)
        normal = normal_loads(load[0], load[3], load[4], feet.x, feet.y)
        tangential = tangential_loads(load[1], load[2], load[5], normal, feet.x, feet.y)
        for k in range(6):
            loads[row, k] = load[k]
        for i in range(FEET_COUNT):
            feet_loads[row, 0, i] = normal[i]
            feet_loads[row, 1, i] = tangential[i]


@long_running
def moving_feet_history(floor_forces, p, loads, feet_loads):
    """Evaluate the load on the feet of a cabinet that moves, from the forces of the floor.

    Args:
        floor_forces: (n, 4, 3) force of the floor on each foot, in the frame of the cabinet. [N]
        p, loads, feet_loads: As for `fixed_feet_history`.
    """
    feet = read_feet(p, 0)
    loads[:] = 0.0
    for row in range(len(floor_forces)):
        for i in range(FEET_COUNT):
            f_x, f_y, normal = floor_forces[row, i]
            feet_loads[row, 0, i] = normal
            feet_loads[row, 1, i] = math.sqrt(f_x * f_x + f_y * f_y)
            loads[row, 0] += normal
            loads[row, 1] -= f_x
            loads[row, 2] -= f_y
            loads[row, 3] -= feet.y[i] * normal
            loads[row, 4] += feet.x[i] * normal
            loads[row, 5] -= feet.x[i] * f_y - feet.y[i] * f_x


@law
def holding_of(normal, feet):
    """Return the friction force that each foot can hold. [N]

    Args:
        normal: Normal loads of the feet. [N]
        feet: Numbers of `FEET`, by name.
    """
    mu = feet.friction
    return mu * normal[0], mu * normal[1], mu * normal[2], mu * normal[3]


@long_running
def foot_history(loads, feet_loads, p, margins):
    """Evaluate the margins of the feet at each sample.

    Args:
        loads, feet_loads, p: As for `fixed_feet_history`.
        margins: (n, 4), written: columns as `LEAST_LOAD`, `SLIDE`, `TURN`, `TILT`.
    """
    feet = read_feet(p, 0)
    for row in range(len(loads)):
        load, normal = loads[row], feet_loads[row, 0]
        holding = holding_of(normal, feet)
        margins[row, LEAST_LOAD] = min(min(normal[0], normal[1]), min(normal[2], normal[3]))
        margins[row, SLIDE] = sliding_margin(load[1], load[2], holding)
        margins[row, TURN] = turning_margin(load[1], load[2], load[5], holding, feet.x, feet.y)
        margins[row, TILT] = tilting_margin(load[0], load[3], load[4], feet.x, feet.y)


@long_running
def foot_extremes(loads, feet_loads, p, region_of, extremes, smallest):
    """Find the extremes of the loads of the feet, and the smallest margins of run and regions.

    The margin of turning is computed only where its lower bound is below the smallest so far.

    Args:
        loads, feet_loads, p: As for `fixed_feet_history`.
        region_of: (>= n,) number of the region of each sample, -1 for none.
        extremes: (3, 4), written: rows as `NORMAL_SMALLEST`, `NORMAL_LARGEST`,
            `TANGENTIAL_LARGEST`, a column for each foot. [N] NaN without samples.
        smallest: (1 + regions, 4), written: smallest values of the run, then of each region;
            columns as `LEAST_LOAD`, `SLIDE`, `TURN`, `TILT`. Infinite without samples.
    """
    feet = read_feet(p, 0)
    extremes[:] = np.nan
    smallest[:] = math.inf
    for row in range(len(loads)):
        load, normal, tangential = loads[row], feet_loads[row, 0], feet_loads[row, 1]
        f_x, f_y, m_z = load[1], load[2], load[5]
        holding = holding_of(normal, feet)
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
