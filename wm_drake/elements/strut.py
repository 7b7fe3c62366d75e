"""Geometry of a massless strut between the tub and the housing."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt
from wm_drake.compiler.vectors import add, cross, dot, scale, subtract
from wm_drake.elements.kind import Described

STRUT_ENDS = (
    Described("tub_point_T", "Point on the tub.", "p_ToA_T", "m", (3,)),
    Described("housing_point_W", "Point on the housing.", "p_WH", "m", (3,)),
)
"""Ends of a strut in its place."""


@law
def strut_line(motion, arm, p_WH):
    """Return length, elongation rate and direction of a strut.

    Args:
        motion: `TubMotion`.
        arm: From To to the tub end A, in W: R_WT p_ToA_T. [m]
        p_WH: Housing end H. [m]

    Returns:
        Length |HA| [m], its rate [m/s], unit vector from H to A, velocity of A [m/s], and 1 /
        length.
    """
    line = subtract(add(motion.position, arm), p_WH)
    square = dot(line, line)
    length = sqrt(square)
    inverse = length * (1.0 / square)  # root and quotient do not wait for each other
    direction = scale(inverse, line)
    v_A = add(motion.velocity, cross(motion.angular_velocity, arm))
    return length, dot(direction, v_A), direction, v_A, inverse


@law
def transverse(a, direction):
    """Return the part of a vector across a direction."""
    return subtract(a, scale(dot(a, direction), direction))


@law
def wrench_at_origin(arm, force, moment):
    """Return moment about To and force (six numbers) of a force at `arm` from To and a moment."""
    m = add(cross(arm, force), moment)
    return (m[0], m[1], m[2], force[0], force[1], force[2])
