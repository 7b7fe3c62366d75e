"""Bushings at the ends of a massless strut, and the force that they put on its ends."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.vectors import add, angle_over_sine, cross, dot, scale
from wm_drake.laws.friction import havsin_friction_per_rate


@law
def bending_moment(direction, rate, axis, stiffness, damping, friction_torque, full_friction_rate):
    """Return the moment on a strut of the bushing at one end (Hooke joint of [B] section 3).

        m = -(k a + c a') + HAVSIN(|a'|) a'/|a'|      [A] Eq. (7) for bending; own vector form

    a: angle between the strut and the axis fixed in the body, as a vector about which the strut is
    bent away; a': the transverse angular velocity of the strut against the body. Spin about the
    strut's own axis is free.

    Args:
        direction: Unit vector e along the strut, in W.
        rate: Angular velocity of the strut against the body, transverse to e. [rad/s]
        axis: Unit vector fixed in the body, in W. It equals e as drawn (T = W), which is the
            neutral pose of the bushing; the rest pose may differ slightly.
        stiffness: Rotational stiffness [k]. [N m/rad]
        damping: Rotational damping [c]. [N m s/rad]
        friction_torque: Full friction torque [p]. [N m]
        full_friction_rate: Rate at which friction is full [v_t]. [rad/s]

    Returns:
        Moment on the strut, in W, transverse to e. [N m]
    """
    sines = cross(axis, direction)
    angle = scale(angle_over_sine(dot(sines, sines), dot(axis, direction)), sines)
    friction = havsin_friction_per_rate(dot(rate, rate), full_friction_rate, friction_torque)
    return add(scale(-stiffness, angle), scale(friction - damping, rate))


@law
def transverse_couple(moment, direction, inverse_length):
    """Return the force on the tub end of a massless strut; that on its housing end is the opposite.

        f = (m_tub + m_housing) x e / L      own derivation: moments on the strut, [B] section 3

    Args:
        moment: Moment of the bushings at both ends on the strut, transverse to e. [N m]
        direction: Unit vector e from the housing end to the tub end.
        inverse_length: 1 / L. [1/m]
    """
    return scale(inverse_length, cross(moment, direction))
