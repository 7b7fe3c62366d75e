"""Motion of the tub, as the force elements see it."""

from collections import namedtuple

from wm_drake.laws.compilation import law
from wm_drake.laws.vectors import rotation_from_rpy

TubMotion = namedtuple("TubMotion", ("rotation", "position", "angular_velocity", "velocity"))  # noqa: PYI024 - numba's kind
"""R_WT by rows, p_WTo [m], w_WT [rad/s], v_WTo [m/s]: tuples of scalars, in W."""


@law
def tub_motion(x):
    """Motion of the tub from the plant's state: roll, pitch, yaw, x, y, z, drum angle, then w_WT, v_WTo, drum rate."""
    rotation = rotation_from_rpy(x[0], x[1], x[2])
    return TubMotion(rotation, (x[3], x[4], x[5]), (x[7], x[8], x[9]), (x[10], x[11], x[12]))
