"""Motion of the tub, as the force elements see it."""

from collections import namedtuple

from wm_drake.laws.compilation import law
from wm_drake.laws.elementary import sine_cosine
from wm_drake.laws.vectors import rotation_from_sines

TubMotion = namedtuple("TubMotion", ("rotation", "position", "angular_velocity", "velocity"))
"""R_WT by rows, p_WTo [m], w_WT [rad/s], v_WTo [m/s]: tuples of scalars, in W."""


@law
def tub_motion(x):
    """Motion of the tub from the plant's state: roll, pitch, yaw, x, y, z, drum angle, then w_WT, v_WTo, drum rate."""
    return tub_motion_from_sines(x, sine_cosine(x[0]), sine_cosine(x[1]), sine_cosine(x[2]))


@law
def tub_motion_from_sines(x, roll, pitch, yaw):
    """The same, with sine and cosine of each angle known."""
    return TubMotion(rotation_from_sines(roll, pitch, yaw), (x[3], x[4], x[5]), (x[7], x[8], x[9]), (x[10], x[11], x[12]))
