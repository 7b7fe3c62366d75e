"""Rigid-body mechanics of a tub and of a drum in a compliant bearing, as two bodies.

Own derivation; the tests compare it with the Drake plant. The drum turns in a massless carrier. For
carrier and drum, `wm_drake.engines.compiled.mechanics.accelerations` is used with the carrier in
place of the tub. The tub is one rigid body. In its frame, with moments about To, its first moment S
and its inertia I about To:

    M a_O + w' x S + w x (w x S) = F,    S x a_O + I w' + w x (I w) = tau

The packed numbers are those of `TUB_AND_BEARING`; the state of the carrier is a `BODY_STATE`.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.matrices import times
from wm_drake.compiler.packed import LAYOUT, SCALAR, SYMMETRIC, VECTOR, PackedLayout
from wm_drake.compiler.vectors import (
    add,
    cross,
    rotate,
    rotate_back,
    rotation_from_sines,
    scale,
    subtract,
)
from wm_drake.elements.bearing import DRUM_BEARING_NUMBERS
from wm_drake.elements.motion import TubMotion, read_body_state, rpy_rates

TUB = PackedLayout(
    "TubNumbers", inverse_mass=SCALAR, moment=VECTOR, inertia=SYMMETRIC, inverse_inertia=SYMMETRIC
)
"""The tub without drum: 1/M [1/kg], S [kg m], I [kg m^2], inverse of the inertia about the centre
of mass [1/(kg m^2)]."""
TUB_AND_BEARING = PackedLayout(
    "TubAndBearingNumbers", tub=LAYOUT(TUB), bearing=LAYOUT(DRUM_BEARING_NUMBERS)
)
"""Packed numbers of a compliant bearing: the tub, then the bearing itself."""

read_tub, read_tub_and_bearing = TUB.read, TUB_AND_BEARING.read


@law
def tub_accelerations(motion, wrench, gravity, p, at):
    """Return the accelerations of a tub without its drum.

    Args:
        motion: `TubMotion`.
        wrench: Moment about To and force of all elements on the tub, in W, without gravity.
            [N m, N]
        gravity: Acceleration in W. [m/s^2]
        p, at: Array that holds the numbers of `TUB`, and index where they begin.

    Returns:
        Angular acceleration of the tub and acceleration of To, in W. [rad/s^2, m/s^2]
    """
    tub = read_tub(p, at)
    q, first, i = tub.inverse_mass, tub.moment, tub.inertia
    w = rotate_back(motion.rotation, motion.angular_velocity)
    force = rotate_back(motion.rotation, (wrench[3], wrench[4], wrench[5]))
    force = subtract(force, cross(w, cross(w, first)))
    moment = rotate_back(motion.rotation, (wrench[0], wrench[1], wrench[2]))
    moment = subtract(subtract(moment, cross(w, times(i, w))), scale(q, cross(first, force)))
    w_rate = times(tub.inverse_inertia, moment)
    a_O = scale(q, subtract(force, cross(w_rate, first)))
    return rotate(motion.rotation, w_rate), add(rotate(motion.rotation, a_O), gravity)


@law
def carrier_motion(x, k):
    """Return the motion of the carrier, whose state begins at index k, and its angle rates."""
    state = read_body_state(x, k)
    angles, w = state.angles, state.angular_velocity
    roll, pitch, yaw = sine_cosine(angles[0]), sine_cosine(angles[1]), sine_cosine(angles[2])
    rotation = rotation_from_sines(roll, pitch, yaw)
    return TubMotion(rotation, state.position, w, state.velocity), rpy_rates(w, pitch, yaw)
