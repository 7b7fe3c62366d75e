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
from wm_drake.laws.table import packed_size, stiffness_force


@law
def bushing_force(d, d_rate, r, w, p, at):
    """Force and moment of a six-component bushing on its tub-side frame.

        F = -(k d or curve(d)) - c d'                           per axis; [A] Eq. (7), (8); [B] Fig. 4
        T = -(k r or curve(r)) - c r' + HAVSIN(r'; v_t, p)      per axis of the rotation vector r

    The stiffness lives in the ground-side frame G: all vectors are expressed there. T does work on the rates r' of the
    rotation vector; the moment that does the same work on the angular velocity is what acts on the body, so elastic energy
    is stored and given back exactly. [A] writes angles, which agree for small ones.

    Packed parameters from index `at`: damping x, y, z [N s/m]; rotational damping x, y, z [N m s/rad]; friction torque
    x, y, z [N m]; full-friction rate x, y, z [rad/s]; then six packed stiffnesses, x, y, z and about x, y, z.

    Args:
        d, d_rate: Position of the tub-side frame from the ground-side frame, and its rate, in G. [m, m/s]
        r: Rotation vector of the tub-side frame against G. [rad]
        w: Angular velocity of the tub-side frame against G, in G. [rad/s]
        p: Array that holds the packed parameters.
        at: Index where they begin.

    Returns:
        Force [N] and moment [N m] on the tub side at the tub-side point, in G; the reaction acts at the same point.
    """
    coefficient = rotation_vector_coefficient(dot(r, r))
    r_rate = rotation_vector_rate(r, w, coefficient)
    kx = at + 12
    ky = kx + packed_size(p, kx)
    kz = ky + packed_size(p, ky)
    tx = kz + packed_size(p, kz)
    ty = tx + packed_size(p, tx)
    tz = ty + packed_size(p, ty)
    force = (
        -stiffness_force(d[0], p, kx) - p[at] * d_rate[0],
        -stiffness_force(d[1], p, ky) - p[at + 1] * d_rate[1],
        -stiffness_force(d[2], p, kz) - p[at + 2] * d_rate[2],
    )
    torque = (
        -stiffness_force(r[0], p, tx) - p[at + 3] * r_rate[0],
        -stiffness_force(r[1], p, ty) - p[at + 4] * r_rate[1],
        -stiffness_force(r[2], p, tz) - p[at + 5] * r_rate[2],
    )
    if anywhere((p[at + 6] > 0.0) | (p[at + 7] > 0.0) | (p[at + 8] > 0.0)):
        torque = (
            torque[0] + havsin_friction(r_rate[0], p[at + 9], p[at + 6]),
            torque[1] + havsin_friction(r_rate[1], p[at + 10], p[at + 7]),
            torque[2] + havsin_friction(r_rate[2], p[at + 11], p[at + 8]),
        )
    return force, moment_from_rotation_vector(r, torque, coefficient)
