"""Displacement sensor: a point of the tub, measured along one direction of the housing."""

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.matrices import three
from wm_drake.compiler.vectors import add, dot, rotate
from wm_drake.elements.motion import tub_motion
from wm_drake.parameters.types import FloatArray

POINT_SIZE = 7
"""Numbers of a measured point: its position in T, the direction in W along which it is measured,
its coordinate along that direction at rest. [m]"""


def packed_points(p_ToS_T: FloatArray, direction: FloatArray, at_rest: FloatArray) -> FloatArray:
    """Return measured points as rows (k, `POINT_SIZE`).

    Args:
        p_ToS_T: (k, 3) positions in T. [m]
        direction: (k, 3) unit vectors in W.
        at_rest: (k,) coordinates along the directions at the rest pose. [m]
    """
    return np.column_stack([p_ToS_T, direction, at_rest])


@law
def displacement_at(motion, points, at):
    """Return the displacement from rest of a measured point along its direction. [m]

    Args:
        motion: `TubMotion`.
        points: Array that holds what `packed_points` returns, row after row.
        at: Index where the numbers of the point begin.
    """
    moved_to = add(motion.position, rotate(motion.rotation, three(points, at)))
    return dot(three(points, at + 3), moved_to) - points[at + 6]


@law
def evaluate_sensors(x, points, displacement):
    """Write the displacement of each measured point. [m]

    Args:
        x: State of tub and drum, as `tub_motion` reads it.
        points: Array that holds what `packed_points` returns, row after row.
        displacement: (k,) written. [m]
    """
    motion = tub_motion(x)
    for k in range(len(displacement)):
        displacement[k] = displacement_at(motion, points, k * POINT_SIZE)
