"""Rigid-body mechanics of a tub and of a drum in a compliant bearing, as two bodies.

Own derivation; the tests compare it with the Drake plant. The drum turns in a massless carrier. For
carrier and drum, `wm_drake.engines.compiled.mechanics.accelerations` is used with the carrier in
place of the tub. The tub is one rigid body. In its frame, with moments about To, its first moment S
and its inertia I about To:

    M a_O + w' x S + w x (w x S) = F,    S x a_O + I w' + w x (I w) = tau

Packed numbers, from the index of the bearing: 1/M [1/kg]; S [kg m]; I as xx, yy, zz, xy, xz, yz
[kg m^2]; then those of `SixComponentBushingParameters`.

State, behind all others: roll, pitch, yaw, position of the carrier; its angular velocity and
velocity.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.matrices import about_centre, inverse, six, three, times
from wm_drake.compiler.vectors import (
    add,
    cross,
    rotate,
    rotate_back,
    rotation_from_sines,
    scale,
    subtract,
)
from wm_drake.elements.motion import TubMotion, rpy_rates

TUB_SIZE = 10
"""Numbers of the tub's body."""
CARRIER_STATE_SIZE = 12
"""Numbers of the carrier in the state."""


@law
def tub_accelerations(motion, wrench, gravity, p, at):
    """Return the accelerations of a tub without its drum.

    Args:
        motion: `TubMotion`.
        wrench: Moment about To and force of all elements on the tub, in W, without gravity.
            [N m, N]
        gravity: Acceleration in W. [m/s^2]
        p, at: Packed numbers and index of the bearing in them.

    Returns:
        Angular acceleration of the tub and acceleration of To, in W. [rad/s^2, m/s^2]
    """
    q, first, i = p[at], three(p, at + 1), six(p, at + 4)
    w = rotate_back(motion.rotation, motion.angular_velocity)
    force = rotate_back(motion.rotation, (wrench[3], wrench[4], wrench[5]))
    force = subtract(force, cross(w, cross(w, first)))
    moment = rotate_back(motion.rotation, (wrench[0], wrench[1], wrench[2]))
    moment = subtract(subtract(moment, cross(w, times(i, w))), scale(q, cross(first, force)))
    w_rate = times(inverse(about_centre(i, first, q)), moment)
    a_O = scale(q, subtract(force, cross(w_rate, first)))
    return rotate(motion.rotation, w_rate), add(rotate(motion.rotation, a_O), gravity)


@law
def carrier_motion(x, dx, k):
    """Return the motion of the carrier, whose state begins at index k.

    The rates of its angles and of its position are written into `dx`.
    """
    roll, pitch, yaw = sine_cosine(x[k]), sine_cosine(x[k + 1]), sine_cosine(x[k + 2])
    w, v = (x[k + 6], x[k + 7], x[k + 8]), (x[k + 9], x[k + 10], x[k + 11])
    dx[k], dx[k + 1], dx[k + 2] = rpy_rates(w, pitch, yaw)
    dx[k + 3], dx[k + 4], dx[k + 5] = v
    return TubMotion(rotation_from_sines(roll, pitch, yaw), (x[k + 3], x[k + 4], x[k + 5]), w, v)


@law
def carrier_size(bearing):
    """Return the size of the state of the carrier; 0 for a rigid bearing (None)."""
    if bearing is None:
        return 0
    return CARRIER_STATE_SIZE
