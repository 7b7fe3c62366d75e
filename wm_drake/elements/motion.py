"""Motion of the tub, as the force elements see it."""

from collections import namedtuple

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.vectors import rotation_from_sines

PLANT_STATE_SIZE = 14
"""q = [roll, pitch, yaw, x, y, z, drum angle] and v = [w_WT, v_WTo, drum rate] of the plant."""
GENERALIZED_FORCE_SIZE = 7
"""Moment about To and force on the tub in W, then the torque on the drum joint."""

TubMotion = namedtuple("TubMotion", ("rotation", "position", "angular_velocity", "velocity"))
"""R_WT by rows, p_WTo [m], w_WT [rad/s], v_WTo [m/s]: tuples of scalars, in W. Of the tub, or of another body."""


@law
def tub_motion(x):
    """Motion of the tub from the plant's state: roll, pitch, yaw, x, y, z, drum angle, then w_WT, v_WTo, drum rate."""
    return motion_at(x, 0)


@law
def motion_at(x, at):
    """Motion of a body whose state stands like the tub's from index `at` on: angles, position, one more, w, v, one more."""
    return motion_from_sines(
        x, at, sine_cosine(x[at]), sine_cosine(x[at + 1]), sine_cosine(x[at + 2])
    )


@law
def motion_from_sines(x, at, roll, pitch, yaw):
    """The same, with sine and cosine of each angle known."""
    position, w = (x[at + 3], x[at + 4], x[at + 5]), (x[at + 7], x[at + 8], x[at + 9])
    return TubMotion(
        rotation_from_sines(roll, pitch, yaw), position, w, (x[at + 10], x[at + 11], x[at + 12])
    )


@law
def rpy_rates(w, pitch, yaw):
    """Rates of roll, pitch, yaw from the angular velocity in W, as Drake's RpyFloatingJoint has them. [rad/s]"""
    s_p, c_p = pitch
    s_y, c_y = yaw
    roll_rate = (c_y * w[0] + s_y * w[1]) / c_p
    return roll_rate, c_y * w[1] - s_y * w[0], w[2] + s_p * roll_rate
