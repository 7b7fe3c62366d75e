"""Rigid-body mechanics of a telescopic damper: a floating outer tube and an inner one that slides.

Own derivation; the tests compare it with the Drake plant. In the frame of the outer tube, with
moments about its origin O, the joint's direction a and extension s, and F, tau, f the force, the
moment about O and the force along the joint:

    M a_O + w' x S + w x (w x S) + m s'' a + 2 m s' w x a                                  = F
    S x a_O + I w' + w x (I w) + S_i x a s'' + 2 s' S_i x (w x a)                          = tau
    a . (m a_O + w' x S_i + w x (w x S_i)) + m s''                                         = f
    S = S_0 + m s a,    S_i = S_i0 + m s a,    I = I_0 + s I_1 + s^2 I_2

M: mass of both tubes, m: of the inner one; S, S_i: first moments of both and of the inner one; I:
inertia of both. The first equation gives a_O and the third s''. Three equations with a symmetric
matrix remain for w'.

Packed numbers, from the index of each damper: 1/M [1/kg]; m; a; S_0 and S_i0 [kg m]; I_0, I_1, I_2
as xx, yy, zz, xy, xz, yz [kg m^2, kg m, kg]; then those of `TelescopicDamperParameters`.

State of a damper, behind the deformations of the strut dampers: roll, pitch, yaw, position of the
outer tube, extension; angular velocity, velocity, rate of extension; deformation of the sponge.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.matrices import about_centre, inverse, less_square, plus, six, three, times
from wm_drake.compiler.vectors import add, cross, dot, rotate, rotate_back, scale, subtract
from wm_drake.elements.motion import motion_from_sines, rpy_rates
from wm_drake.elements.telescopic_damper import telescopic_damper_forces

INVERSE_MASS, INNER_MASS, AXIS, MOMENT, INNER_MOMENT, INERTIA = 0, 1, 2, 5, 8, 11
TUBES_SIZE = 29
"""Numbers of the bodies of a damper."""
TUBES_STATE_SIZE = 15
"""Numbers of a damper in the state."""


@law
def tube_accelerations(motion, s, s_rate, wrench, along, gravity, p, at):
    """Return the accelerations of the tubes of a damper.

    Args:
        motion: `TubMotion` of the outer tube.
        s, s_rate: Extension and its rate. [m, m/s]
        wrench: Moment about O and force on both tubes, in W, without gravity. [N m, N]
        along: Force on the joint. [N]
        gravity: Acceleration in W. [m/s^2]
        p, at: Packed numbers and index of the damper in them.

    Returns:
        Angular acceleration and acceleration of O, in W [rad/s^2, m/s^2], and s'' [m/s^2].
    """
    q, m, a = p[at + INVERSE_MASS], p[at + INNER_MASS], three(p, at + AXIS)
    moved = scale(m * s, a)
    first, inner = add(three(p, at + MOMENT), moved), add(three(p, at + INNER_MOMENT), moved)
    i_0, i_1, i_2 = six(p, at + INERTIA), six(p, at + INERTIA + 6), six(p, at + INERTIA + 12)
    i = (
        i_0[0] + s * (i_1[0] + s * i_2[0]),
        i_0[1] + s * (i_1[1] + s * i_2[1]),
        i_0[2] + s * (i_1[2] + s * i_2[2]),
        i_0[3] + s * (i_1[3] + s * i_2[3]),
        i_0[4] + s * (i_1[4] + s * i_2[4]),
        i_0[5] + s * (i_1[5] + s * i_2[5]),
    )
    w = rotate_back(motion.rotation, motion.angular_velocity)
    turn = scale(2.0 * s_rate, cross(w, a))  # Coriolis
    force = rotate_back(motion.rotation, (wrench[3], wrench[4], wrench[5]))
    force = subtract(force, add(cross(w, cross(w, first)), scale(m, turn)))
    moment = rotate_back(motion.rotation, (wrench[0], wrench[1], wrench[2]))
    moment = subtract(moment, add(cross(w, times(i, w)), cross(inner, turn)))
    moment = subtract(moment, scale(q, cross(first, force)))
    share = m * q
    b = cross(subtract(inner, scale(share, first)), a)
    f = along - dot(a, cross(w, cross(w, inner))) - share * dot(a, force)
    inverse_reduced = 1.0 / (m - m * share)
    # inertia about the common centre of mass, reduced by the freedom of the joint
    central = less_square(about_centre(i, first, q), b, inverse_reduced)
    w_rate = times(inverse(central), subtract(moment, scale(f * inverse_reduced, b)))
    s_acceleration = (f - dot(b, w_rate)) * inverse_reduced
    a_O = scale(q, subtract(force, add(cross(w_rate, first), scale(m * s_acceleration, a))))
    return (
        rotate(motion.rotation, w_rate),
        add(rotate(motion.rotation, a_O), gravity),
        s_acceleration,
    )


@law
def add_telescopic_dampers(x, dx, motion, gravity, p, telescopes, first, total):
    """Return the wrench on the tub with that of all telescopic dampers.

    The time derivatives of the tubes' states are written into `dx`.

    Args:
        x, dx: State and its derivative.
        motion: `TubMotion` of the tub.
        gravity: Acceleration in W. [m/s^2]
        p: Packed numbers.
        telescopes: Index of each damper in them; None if there are none.
        first: Index in the state where the first damper begins.
        total: Wrench of other elements on the tub: moment about To and force, in W. [N m, N]
    """
    if telescopes is None:
        return total
    for i in range(len(telescopes)):
        at, k = telescopes[i], first + TUBES_STATE_SIZE * i
        roll, pitch, yaw = sine_cosine(x[k]), sine_cosine(x[k + 1]), sine_cosine(x[k + 2])
        outer = motion_from_sines(x, k, roll, pitch, yaw)
        s, s_rate = x[k + 6], x[k + 13]
        forces = telescopic_damper_forces(motion, outer, s, s_rate, x[k + 14], p, at + TUBES_SIZE)
        on_tub, on_tubes, along, deformation_rate, _, _, _ = forces
        w_rate, v_rate, s_acceleration = tube_accelerations(
            outer, s, s_rate, on_tubes, along, gravity, p, at
        )
        dx[k], dx[k + 1], dx[k + 2] = rpy_rates(outer.angular_velocity, pitch, yaw)
        dx[k + 3], dx[k + 4], dx[k + 5] = outer.velocity
        dx[k + 6] = s_rate
        dx[k + 7], dx[k + 8], dx[k + 9] = w_rate
        dx[k + 10], dx[k + 11], dx[k + 12] = v_rate
        dx[k + 13] = s_acceleration
        dx[k + 14] = deformation_rate
        total = plus(total, on_tub)
    return total


@law
def telescopic_damper_count(telescopes):
    """Return the number of telescopic dampers; `telescopes` is None if there are none."""
    if telescopes is None:
        return 0
    return len(telescopes)
