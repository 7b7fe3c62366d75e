"""Motion of the tub, as the force elements take it."""

from collections import namedtuple

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import rotation_from_sines

TREE_STATE = PackedLayout(
    "TreeState",
    angles=VECTOR,
    position=VECTOR,
    joint_position=SCALAR,
    angular_velocity=VECTOR,
    velocity=VECTOR,
    joint_rate=SCALAR,
)
"""State of a tree of the plant: a floating body and one joint from it.

Roll, pitch, yaw of the body, its position p_WTo, angle or extension of the joint; w_WT, v_WTo, rate
of the joint. The body is the tub or another one. [rad, m, rad or m; rad/s, m/s, rad/s or m/s]"""
read_tree_state = TREE_STATE.read

PLANT_STATE_SIZE = TREE_STATE.fixed_size
"""State of the plant of a rigid machine, a `TREE_STATE`: the tub floats, the drum turns in it."""
GENERALIZED_FORCE_SIZE = 7
"""Moment about To and force on the tub in W, then the torque on the drum joint."""

TubMotion = namedtuple("TubMotion", ("rotation", "position", "angular_velocity", "velocity"))
"""R_WT by rows, p_WTo [m], w_WT [rad/s], v_WTo [m/s] of the tub or of another body: tuples of
scalars, in W."""


@law
def tub_motion(x):
    """Return the motion of the tub from the state of the plant (`TREE_STATE`)."""
    return motion_at(x, 0)


@law
def motion_at(x, at):
    """Return the motion of the body whose `TREE_STATE` begins at index `at`."""
    roll, pitch, yaw = read_tree_state(x, at).angles
    return motion_from_sines(x, at, sine_cosine(roll), sine_cosine(pitch), sine_cosine(yaw))


@law
def motion_from_sines(x, at, roll, pitch, yaw):
    """Return the motion of a body from its `TREE_STATE`, and sine and cosine of each angle."""
    state = read_tree_state(x, at)
    return TubMotion(
        rotation_from_sines(roll, pitch, yaw),
        state.position,
        state.angular_velocity,
        state.velocity,
    )


@law
def rpy_rates(w, pitch, yaw):
    """Return the rates of roll, pitch, yaw, as Drake's RpyFloatingJoint defines them. [rad/s]

    Args:
        w: Angular velocity in W. [rad/s]
        pitch, yaw: Sine and cosine of each angle.
    """
    s_p, c_p = pitch
    s_y, c_y = yaw
    roll_rate = (c_y * w[0] + s_y * w[1]) / c_p
    return roll_rate, c_y * w[1] - s_y * w[0], w[2] + s_p * roll_rate
