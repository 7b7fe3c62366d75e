"""Contact of a body with a rubber buffer: it pushes, loses energy, rubs, and never pulls."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt, where
from wm_drake.compiler.vectors import dot, scale
from wm_drake.laws.table import stiffness_force


@law
def stop_force(compression, rate, loss, stiffness):
    """Return the normal force of a buffer.

        N = F(d) (1 + a d'),   d > 0 and N > 0;   N = 0 otherwise      Hunt and Crossley 1975

    F = k d, or a table. The loss grows with the force, so that N does not jump at the first touch,
    and a buffer that is left faster than it springs back lets go. The restitution does not depend
    on F: a body that comes with v leaves with w, and

        a v - ln(1 + a v) = -a w - ln(1 - a w)                          own derivation

    Source: K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in
    vibroimpact, Journal of Applied Mechanics 42 (1975) 440-445.

    Args:
        compression: d, how far the buffer is compressed; below 0 for a body away from it. [m]
        rate: d'. [m/s]
        loss: a, >= 0. [s/m]
        stiffness: Packed stiffness, as array and index (`wm_drake.laws.table`).

    Returns:
        Force on the body, away from the buffer, >= 0. [N]
    """
    zero = 0.0 * compression
    touching = where(compression > 0.0, compression, zero)
    force = stiffness_force(touching, *stiffness) * (1.0 + loss * rate)
    return where((compression > 0.0) & (force > 0.0), force, zero)


@law
def rubbing_force(normal_force, velocity, friction, full_friction_velocity):
    """Return the friction force on a body that rubs against a surface.

        f = -mu N v / w,   w^2 = v . v + v_t^2      own choice: Coulomb's law, smooth at rest

    Args:
        normal_force: N, >= 0. [N]
        velocity: v of the body along the surface. [m/s]
        friction: mu, >= 0.
        full_friction_velocity: v_t, > 0, at which friction is 71 % of mu N. [m/s]

    Returns:
        Force on the body, against its velocity. [N]
    """
    square = dot(velocity, velocity) + full_friction_velocity * full_friction_velocity
    return scale(-friction * normal_force / sqrt(square), velocity)
