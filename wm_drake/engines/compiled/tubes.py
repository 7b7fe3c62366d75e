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

The packed numbers of the bodies are those of `TUBES`; the state of a damper is a `TUBES_STATE`.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.matrices import about_centre, inverse, less_square, plus, times
from wm_drake.compiler.packed import SCALAR, SYMMETRIC, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, cross, dot, rotate, rotate_back, scale, subtract
from wm_drake.elements.motion import motion_from_sines, read_tree_state, rpy_rates, write_tree_state
from wm_drake.elements.telescopic_damper import (
    DEFORMATION,
    TUBES_STATE_SIZE,
    read_tubes_state,
    telescopic_damper_forces,
)

TUBES = PackedLayout(
    "TubesNumbers",
    inverse_mass=SCALAR,
    inner_mass=SCALAR,
    axis=VECTOR,
    moment=VECTOR,
    inner_moment=VECTOR,
    inertia=SYMMETRIC,
    inertia_slope=SYMMETRIC,
    inertia_curvature=SYMMETRIC,
)
"""Bodies of a damper: 1/M [1/kg], m [kg], a, S_0 and S_i0 [kg m], I_0 [kg m^2], I_1 [kg m], I_2
[kg]."""

read_tubes = TUBES.read


@law
def tube_accelerations(motion, s, s_rate, wrench, along, gravity, p, at):
    """Return the accelerations of the tubes of a damper.

    Args:
        motion: `TubMotion` of the outer tube.
        s, s_rate: Extension and its rate. [m, m/s]
        wrench: Moment about O and force on both tubes, in W, without gravity. [N m, N]
        along: Force on the joint. [N]
        gravity: Acceleration in W. [m/s^2]
        p, at: Array that holds the numbers of `TUBES`, and index where they begin.

    Returns:
        Angular acceleration and acceleration of O, in W [rad/s^2, m/s^2], and s'' [m/s^2].
    """
    tubes = read_tubes(p, at)
    q, m, a = tubes.inverse_mass, tubes.inner_mass, tubes.axis
    moved = scale(m * s, a)
    first, inner = add(tubes.moment, moved), add(tubes.inner_moment, moved)
    i_0, i_1, i_2 = tubes.inertia, tubes.inertia_slope, tubes.inertia_curvature
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
def add_telescopic_dampers(x, dx, motion, gravity, p, tubes, mounts, total):
    """Return the wrench on the tub with that of all telescopic dampers.

    The time derivatives of the tubes' states are written into `dx`.

    Args:
        x, dx: State and its derivative.
        motion: `TubMotion` of the tub.
        gravity: Acceleration in W. [m/s^2]
        p: Packed numbers.
        tubes: Index in them of the bodies of each damper; None without telescopic dampers.
        mounts: `Mounts`.
        total: Wrench of other elements on the tub: moment about To and force, in W. [N m, N]
    """
    if tubes is None:
        return total
    for i in range(len(tubes)):
        k = mounts.tube_states + TUBES_STATE_SIZE * i
        damper_state = read_tubes_state(x, k)
        state = read_tree_state(*damper_state.tubes)
        angles, s, s_rate = state.angles, state.joint_position, state.joint_rate
        roll, pitch, yaw = sine_cosine(angles[0]), sine_cosine(angles[1]), sine_cosine(angles[2])
        outer = motion_from_sines(x, k, roll, pitch, yaw)
        on_tub, on_tubes, along, deformation_rate, _, _, _ = telescopic_damper_forces(
            motion, outer, s, s_rate, damper_state.deformation, p, mounts.telescopes[i]
        )
        w_rate, v_rate, s_acceleration = tube_accelerations(
            outer, s, s_rate, on_tubes, along, gravity, p, tubes[i]
        )
        write_tree_state(
            dx,
            k,
            angles=rpy_rates(outer.angular_velocity, pitch, yaw),
            position=outer.velocity,
            joint_position=s_rate,
            angular_velocity=w_rate,
            velocity=v_rate,
            joint_rate=s_acceleration,
        )
        dx[k + DEFORMATION] = deformation_rate
        total = plus(total, on_tub)
    return total
