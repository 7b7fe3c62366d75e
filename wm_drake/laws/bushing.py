"""Six-component bushing: connecting bushing of [A], gasket of [A] and [B]."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere
from wm_drake.compiler.vectors import (
    dot,
    moment_from_rotation_vector,
    rotation_vector_coefficient,
    rotation_vector_rate,
)
from wm_drake.laws.friction import havsin_friction
from wm_drake.laws.table import stiffness_force


@law
def bushing_force(d, d_rate, r, w, bushing):
    """Return force and moment of a six-component bushing on its tub-side frame.

        F = -(k d or curve(d)) - c d'                      per axis; [A] Eq. (7), (8); [B] Fig. 4
        T = -(k r or curve(r)) - c r' + HAVSIN(r'; v_t, p)      per axis of the rotation vector r

    The stiffness acts in the ground-side frame G: all vectors are expressed there. T does work on
    the rates r' of the rotation vector. The moment that does the same work on the angular velocity
    acts on the body, so elastic energy is stored and given back exactly. [A] writes angles, which
    agree for small ones.

    Args:
        d, d_rate: Position of the tub-side frame from the ground-side frame, and its rate, in G.
            [m, m/s]
        r: Rotation vector of the tub-side frame against G. [rad]
        w: Angular velocity of the tub-side frame against G, in G. [rad/s]
        bushing: Named numbers of a bushing, as `wm_drake.elements.bushing.BUSHING_LAW` reads them:
            stiffness [k, curve], damping [c], friction_torque [p] and full_friction_rate [v_t] of
            each axis.

    Returns:
        Force [N] and moment [N m] on the tub side at the tub-side point, in G; the reaction acts at
        the same point.
    """
    coefficient = rotation_vector_coefficient(dot(r, r))
    r_rate = rotation_vector_rate(r, w, coefficient)
    force = (
        -stiffness_force(d[0], *bushing.stiffness_x) - bushing.damping_x * d_rate[0],
        -stiffness_force(d[1], *bushing.stiffness_y) - bushing.damping_y * d_rate[1],
        -stiffness_force(d[2], *bushing.stiffness_z) - bushing.damping_z * d_rate[2],
    )
    torque = (
        -stiffness_force(r[0], *bushing.rotational_stiffness_x)
        - bushing.rotational_damping_x * r_rate[0],
        -stiffness_force(r[1], *bushing.rotational_stiffness_y)
        - bushing.rotational_damping_y * r_rate[1],
        -stiffness_force(r[2], *bushing.rotational_stiffness_z)
        - bushing.rotational_damping_z * r_rate[2],
    )
    p_x, p_y, p_z = (
        bushing.friction_torque_x,
        bushing.friction_torque_y,
        bushing.friction_torque_z,
    )
    if anywhere((p_x > 0.0) | (p_y > 0.0) | (p_z > 0.0)):
        torque = (
            torque[0] + havsin_friction(r_rate[0], bushing.full_friction_rate_x, p_x),
            torque[1] + havsin_friction(r_rate[1], bushing.full_friction_rate_y, p_y),
            torque[2] + havsin_friction(r_rate[2], bushing.full_friction_rate_z, p_z),
        )
    return force, moment_from_rotation_vector(r, torque, coefficient)
