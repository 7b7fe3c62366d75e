"""Motion of the tub, as the force elements take it."""

from collections import namedtuple

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import rotation_from_sines

POSE = PackedLayout("Pose", angles=VECTOR, position=VECTOR)
"""Roll, pitch, yaw of a body and its position p_WTo. [rad, m]"""
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
BODY_STATE = PackedLayout(
    "BodyState", angles=VECTOR, position=VECTOR, angular_velocity=VECTOR, velocity=VECTOR
)
"""Roll, pitch, yaw and position of a floating body, its angular velocity and velocity, in W."""
BODY_STATE_SIZE = BODY_STATE.fixed_size
read_pose = POSE.read
read_body_state, write_body_state = BODY_STATE.read, BODY_STATE.write
read_tree_state, write_tree_state = TREE_STATE.read, TREE_STATE.write

PLANT_STATE_SIZE = TREE_STATE.fixed_size
"""State of the plant of a rigid machine, a `TREE_STATE`: the tub floats, the drum turns in it."""
GENERALIZED_FORCE = PackedLayout("GeneralizedForce", moment=VECTOR, force=VECTOR, on_joint=SCALAR)
"""Moment about To and force on the body of a tree, in W, then torque or force on its joint."""
GENERALIZED_FORCE_SIZE = GENERALIZED_FORCE.fixed_size
_put_generalized_force = GENERALIZED_FORCE.write

TubMotion = namedtuple("TubMotion", ("rotation", "position", "angular_velocity", "velocity"))
"""R_WT by rows, p_WTo [m], w_WT [rad/s], v_WTo [m/s] of the tub or of another body: tuples of
scalars, in W."""

DrumMotion = namedtuple(
    "DrumMotion", "rotation position angular_velocity velocity drum_angle drum_rate"
)
"""A `TubMotion`, and angle and rate of the drum against the tub. [rad, rad/s]"""


@law
def drum_motion(motion, x):
    """Return the motion of tub and drum from that of the tub and the state (`TREE_STATE`)."""
    state = read_tree_state(x, 0)
    return DrumMotion(
        motion.rotation,
        motion.position,
        motion.angular_velocity,
        motion.velocity,
        state.joint_position,
        state.joint_rate,
    )


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
def write_generalized_force(generalized_force, at, wrench, on_joint):
    """Write the numbers of `GENERALIZED_FORCE`.

    Args:
        generalized_force, at: Array that is written, and index where the numbers begin.
        wrench: Moment about To and force, in W (six numbers). [N m, N]
        on_joint: Torque or force on the joint. [N m or N]
    """
    moment, force = (wrench[0], wrench[1], wrench[2]), (wrench[3], wrench[4], wrench[5])
    _put_generalized_force(generalized_force, at, moment, force, on_joint)


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
