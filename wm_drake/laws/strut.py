"""Geometry of a massless strut between the tub and the housing, and the bushings at its ends."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt
from wm_drake.compiler.vectors import add, angle_over_sine, cross, dot, scale, subtract
from wm_drake.laws.friction import havsin_friction_per_rate


@law
def strut_line(motion, arm, p_WH):
    """Length, elongation rate and direction of a strut.

    Args:
        motion: `TubMotion`.
        arm: From To to the tub end A, in W: R_WT p_ToA_T. [m]
        p_WH: Housing end H. [m]

    Returns:
        Length |HA| [m], its rate [m/s], unit vector from H to A, velocity of A [m/s], and 1 / length.
    """
    line = subtract(add(motion.position, arm), p_WH)
    square = dot(line, line)
    length = sqrt(square)
    inverse = length * (1.0 / square)  # root and quotient do not wait for each other
    direction = scale(inverse, line)
    v_A = add(motion.velocity, cross(motion.angular_velocity, arm))
    return length, dot(direction, v_A), direction, v_A, inverse


@law
def bending_moment(direction, rate, axis, k, c, p, slope):
    """Moment on a strut of the bushing at one end (Hooke joint of [B] section 3).

        m = -(k a + c a') + HAVSIN(|a'|) a'/|a'|      physics of [A] Eq. (7) for bending; own derivation of the vector form

    a: angle between the strut and the axis fixed in the body, as a vector about which the strut is bent away; a': the
    transverse angular velocity of the strut against the body. Spin about the strut's own axis is free.

    Args:
        direction: Unit vector e along the strut, in W.
        rate: Angular velocity of the strut against the body, transverse to e. [rad/s]
        axis: Unit vector fixed in the body, equal to e at the rest pose, in W.
        k, c: Rotational stiffness [N m/rad] and damping [N m s/rad].
        p, slope: Full friction torque [N m]; pi/2 over the rate at which it is full [s/rad].

    Returns:
        Moment on the strut, in W, transverse to e. [N m]
    """
    sines = cross(axis, direction)
    angle = scale(angle_over_sine(dot(sines, sines), dot(axis, direction)), sines)
    friction = havsin_friction_per_rate(dot(rate, rate), slope, p)
    return add(scale(-k, angle), scale(friction - c, rate))


@law
def transverse(a, direction):
    """Part of a vector across a direction."""
    return subtract(a, scale(dot(a, direction), direction))


@law
def transverse_couple(moment, direction, inverse_length):
    """Force on the tub end of a massless strut whose bushings put `moment` on it; the housing end gets its negative.

    f = (m_tub + m_housing) x e / L      balance of moments of the strut, own derivation (physics of [B] section 3)
    """
    return scale(inverse_length, cross(moment, direction))


@law
def wrench_at_origin(arm, force, moment):
    """Moment about To and force, as six numbers, of a force at `arm` from To and a moment."""
    m = add(cross(arm, force), moment)
    return (m[0], m[1], m[2], force[0], force[1], force[2])
