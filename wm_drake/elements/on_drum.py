"""Free particles near the drum axis, and vectors that turn with the drum."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.vectors import add, cross, dot, rotate_back, scale, subtract


@law
def rate_in_tub(motion, point, velocity):
    """Return the rate of the place of a particle in the tub, in T. [m/s]

    Args:
        motion: `DrumMotion`.
        point: Place of the particle from To, in T. [m]
        velocity: Velocity of the particle, in W. [m/s]
    """
    w = rotate_back(motion.rotation, motion.angular_velocity)
    moving = rotate_back(motion.rotation, subtract(velocity, motion.velocity))
    return subtract(moving, cross(w, point))


@law
def seen_from_drum(motion, axis, top, place):
    """Return a vector's components to the top and to the side of the drum, in D.

    Args:
        motion: `DrumMotion`.
        axis, top: Axis of the drum and direction to its top at angle 0, in T.
        place: The vector, in T.
    """
    up, side = dot(place, top), dot(place, cross(axis, top))
    sine, cosine = sine_cosine(motion.drum_angle)
    return up * cosine + side * sine, side * cosine - up * sine


@law
def turned_with_drum(motion, axis, top, up, side):
    """Return a vector fixed to the drum, in T; the inverse of `seen_from_drum`.

    Args:
        motion, axis, top: As for `seen_from_drum`.
        up, side: Its components to the top and to the side of the drum.
    """
    sine, cosine = sine_cosine(motion.drum_angle)
    across = scale(side * cosine + up * sine, cross(axis, top))
    return add(scale(up * cosine - side * sine, top), across)
