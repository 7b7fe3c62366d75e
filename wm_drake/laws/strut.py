"""Geometry of a massless strut between the tub and the housing, and the bushings at its ends."""

import numpy as np

from wm_drake.laws.compilation import law
from wm_drake.laws.friction import havsin_friction
from wm_drake.laws.vectors import add, angle_over_sine, cross, dot, scale, subtract


@law
def strut_line(arm, p_WT, w, v, p_WH):
    """Length, elongation rate and direction of a strut.

    Args:
        arm: From To to the tub end A, in W: R_WT p_ToA_T. [m]
        p_WT: Position of To. [m]
        w: Angular velocity of the tub, in W. [rad/s]
        v: Velocity of To, in W. [m/s]
        p_WH: Housing end H. [m]

    Returns:
        Length |HA| [m], its rate [m/s], unit vector from H to A, and the velocity of A [m/s].
    """
    line = subtract(add(p_WT, arm), p_WH)
    length = np.sqrt(dot(line, line))
    direction = scale(1.0 / length, line)
    v_A = add(v, cross(w, arm))
    return length, dot(direction, v_A), direction, v_A


@law
def bending_moment(direction, w_strut, axis, w_body, k, c, p, v_t):
    """Moment on a strut of the bushing at one end (Hooke joint of [B] section 3).

        m = -(k a + c a') + HAVSIN(|a'|) a'/|a'|      physics of [A] Eq. (7) for bending; own derivation of the vector form

    a: angle between the strut and the axis fixed in the body, as a vector about which the strut is bent away; a': the
    transverse angular velocity of the strut against the body. Spin about the strut's own axis is free.

    Args:
        direction: Unit vector e along the strut, in W.
        w_strut: Angular velocity of the strut, transverse to e. [rad/s]
        axis: Unit vector fixed in the body, equal to e at the rest pose, in W.
        w_body: Angular velocity of the body. [rad/s]
        k, c: Rotational stiffness [N m/rad] and damping [N m s/rad].
        p, v_t: Full friction torque [N m] and the rate at which it is full [rad/s].

    Returns:
        Moment on the strut, in W, transverse to e. [N m]
    """
    sines = cross(axis, direction)
    angle = scale(angle_over_sine(dot(sines, sines), dot(axis, direction)), sines)
    relative = subtract(w_strut, w_body)
    rate = subtract(relative, scale(dot(relative, direction), direction))
    speed_squared = dot(rate, rate)
    if speed_squared > 1e-16 * v_t * v_t:
        speed = np.sqrt(speed_squared)
        friction = havsin_friction(speed, v_t, p) / speed
    else:
        friction = -0.5 * np.pi * p / v_t + 0.0 * speed_squared
    return add(scale(-k, angle), scale(friction - c, rate))


@law
def transverse_couple(moment, direction, length):
    """Force on the tub end of a massless strut whose bushings put `moment` on it; the housing end gets its negative.

    f = (m_tub + m_housing) x e / L      balance of moments of the strut, own derivation (physics of [B] section 3)
    """
    return scale(1.0 / length, cross(moment, direction))


@law
def wrench_at_origin(arm, force, moment):
    """Moment about To and force, as six numbers, of a force at `arm` from To and a moment."""
    m = add(cross(arm, force), moment)
    return (m[0], m[1], m[2], force[0], force[1], force[2])
