"""Displacement sensor: a point of the tub, measured along one direction of the housing."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, dot, rotate
from wm_drake.elements.motion import tub_motion

MEASURED_POINT = PackedLayout(
    "MeasuredPointNumbers", p_ToM_T=VECTOR, direction_W=VECTOR, at_rest=SCALAR
)
"""A measured point: its position in T [m], the direction in W along which it is measured, and its
coordinate along that direction at the rest pose [m]."""

read_measured_point = MEASURED_POINT.read
POINT_SIZE = MEASURED_POINT.fixed_size
"""Numbers of a measured point."""


@law
def displacement_at(motion, points, at):
    """Return the displacement from rest of a measured point along its direction. [m]

    Args:
        motion: `TubMotion`.
        points: Array that holds packed measured points, one after the other.
        at: Index where the numbers of the point begin.
    """
    point = read_measured_point(points, at)
    moved_to = add(motion.position, rotate(motion.rotation, point.p_ToM_T))
    return dot(point.direction_W, moved_to) - point.at_rest


@law
def evaluate_sensors(x, points, displacement):
    """Write the displacement of each measured point. [m]

    Args:
        x: State of tub and drum, as `tub_motion` reads it.
        points: Array that holds packed measured points, one after the other.
        displacement: (k,) written. [m]
    """
    motion = tub_motion(x)
    for k in range(len(displacement)):
        displacement[k] = displacement_at(motion, points, k * POINT_SIZE)
