"""Friction dampers along their line: tension, and the rate of their state if they have one.

The first argument of a damper law is the rate of elongation of the strut [m/s]; the tension is > 0
while the strut pulls its ends together [N]. A law with a sponge also takes the deformation of the
sponge and returns its rate; a law without one returns the tension alone. The deformation is delta =
Y - X [m] (driven end less slider) and needs no reference length; the slider of [C] is X = Y -
delta. The other arguments carry the names of the machine file (`wm_drake.parameters.damper_laws`),
where each law is registered; a docstring gives the symbol of the paper in brackets.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt, where
from wm_drake.laws.friction import coulomb_friction, havsin_friction, stv_friction
from wm_drake.laws.table import stiffness_force


@law
def coulomb_damper(rate, friction_force, damping):
    """Return the tension of Coulomb friction and a dashpot in parallel.

        tension = c v - f_coulomb(v)      [C] Eq. (4)

    Args:
        rate: Rate of elongation v. [m/s]
        friction_force: Friction force [f_max]. [N]
        damping: Dashpot [c]. [N s/m]
    """
    return damping * rate - coulomb_friction(rate, friction_force)


@law
def stv_damper(rate, friction_force, transition_velocity, damping):
    """Return the tension of STV friction and a dashpot in parallel.

        tension = c v - f_stv(v)      [C] Eq. (6)

    Args:
        rate: Rate of elongation v. [m/s]
        friction_force, transition_velocity: STV friction [f_max, v_st]. [N, m/s]
        damping: Dashpot [c]. [N s/m]
    """
    return damping * rate - stv_friction(rate, transition_velocity, friction_force)


@law
def havsin_damper(rate, friction_force, full_friction_velocity, damping):
    """Return the tension of smoothed Coulomb friction and a dashpot in parallel.

        tension = c v - HAVSIN(v)      [A] Eq. (2)

    Args:
        rate: Rate of elongation v. [m/s]
        friction_force, full_friction_velocity: HAVSIN friction [p, v_t]. [N, m/s]
        damping: Dashpot [c]. [N s/m]
    """
    return damping * rate - havsin_friction(rate, full_friction_velocity, friction_force)


@law
def slider_rate(b, v, c, friction_force, friction_damping, regularisation_velocity):
    """Solve for the velocity of a massless slider under MSTV friction, in closed form.

    Own derivation. Force balance of [C] Eq. (3) with m = 0, the friction `mstv_friction` and
    u = v - w:

        b = c w + g(w) sgn(w)               for |w| >= |u|   (slips)
        b = c w + g(w) w / (|u| + eps)      for |w| <  |u|   (sticks),     g(w) = f_max + c_m |w|

    w has the sign of b; turn signs so that b >= 0. Then the sticking branch is a quadratic with one
    positive root:

        v > 0, u = v - w:    (c_m - c) w^2 + (c (v + eps) + f_max + b) w - b (v + eps) = 0
        v <= 0, u = v - w:   (c_m + c) w^2 + (c (|v| + eps) + f_max - b) w - b (|v| + eps) = 0

    The first is valid up to w = v/2, the second always (at v = 0, where [C] has both branches meet,
    it is the limit from below). The slipping branch is w = (b - f_max) / (c + c_m). The right sides
    grow with w, so the balance has one solution. At w = v/2 the friction jumps by a relative eps/v;
    there the slider keeps w = v/2.

    Args:
        b: Force of the sponge on the slider less what depends on w: k1 delta + c1 v in [C],
            K(delta) delta in [A]. [N]
        v: Velocity of the driven end. [m/s]
        c: Sum of the dashpots that oppose w (c1 + c2 in [C], 0 in [A]), >= 0; c + c_m > 0. [N s/m]
        friction_force: Friction force at rest [f_max], >= 0. [N]
        friction_damping: Growth of the friction with slider velocity [c_m], >= 0. [N s/m]
        regularisation_velocity: Regularisation of MSTV [eps], > 0. [m/s]

    Returns:
        Slider velocity w = X'. [m/s] Its sensitivity to b is at most 1/c: the damper is no stiffer
        than k1/c.
    """
    f_max, c_m = friction_force, friction_damping
    sign = where(b >= 0.0, 1.0, -1.0)
    b = sign * b
    v = sign * v
    e = abs(v) + regularisation_velocity
    along = where(v > 0.0, 1.0, -1.0)
    a2, a1, a0 = c_m - along * c, c * e + f_max + along * b, b * e
    half = 0.5 * v
    # the sticking balance has its root beyond v/2
    slips = (v > 0.0) & ((a2 * half + a1) * half < a0)
    above, below = root_as_quotient(a2, a1, a0)
    w = where(slips, b - f_max, above) / where(slips, c + c_m, below)
    return sign * where(slips & (w < half), half, w)


@law
def root_as_quotient(a2, a1, a0):
    """Return the positive root of a2 w^2 + a1 w - a0 = 0, a0 >= 0 (the smaller one if a2 < 0 < a1).

    Returns:
        Numerator and denominator, without cancellation; 0 and 1 where there is neither friction nor
        force.
    """
    radicand = a1 * a1 + 4.0 * a2 * a0
    free = radicand <= 0.0  # the root of zero has no derivative
    root = sqrt(where(free, 1.0, radicand))
    rises = a1 > 0.0
    above = where(free, 0.0 * a1, where(rises, 2.0 * a0, root - a1))
    return above, where(free, 1.0, where(rises, a1 + root, 2.0 * a2))


@law
def mstv_damper(
    rate,
    deformation,
    friction_force,
    friction_damping,
    regularisation_velocity,
    sponge_stiffness,
    sponge_damping,
    slider_damping,
):
    """Return tension and deformation rate of a friction damper with a massless sponge.

        s = k1 delta + c1 (v - w),   s = c2 w - f_mstv(w, v - w)      [C] Eq. (2), (3), M = m = 0

    Args:
        rate: Rate of elongation v. [m/s]
        deformation: Deformation of the sponge delta. [m]
        friction_force, friction_damping, regularisation_velocity: MSTV friction [f_max, c_m,
            epsilon]. [N, N s/m, m/s]
        sponge_stiffness, sponge_damping: Sponge [k1, c1]. [N/m, N s/m]
        slider_damping: Air resistance of the slider [c2]. [N s/m]

    Returns:
        Tension s [N] and the rate of deformation v - w [m/s].
    """
    w = slider_rate(
        sponge_stiffness * deformation + sponge_damping * rate,
        rate,
        sponge_damping + slider_damping,
        friction_force,
        friction_damping,
        regularisation_velocity,
    )
    return sponge_stiffness * deformation + sponge_damping * (rate - w), rate - w


@law
def mstv_sponge_with_mass(
    deformation,
    rate,
    slider_velocity,
    step,
    mass,
    friction_force,
    friction_damping,
    regularisation_velocity,
    sponge_stiffness,
    sponge_damping,
    slider_damping,
):
    """Take a step of implicit Euler of a friction damper whose sponge has a mass.

        s = k1 (Y - X) + c1 (Y' - X')                             [C] Eq. (2)
        m X'' = s - c2 X' + f_mstv(X', Y' - X')                   [C] Eq. (3), (7)

    Own derivation of the step: with X = X0 + h w and X'' = (w - w0) / h, the balance at the end of
    the step is that of a massless slider, `slider_rate`, with more force and more damping:

        (k1 h + c1 + c2 + m/h) w - f_mstv(w, Y' - w) = k1 (Y - X0) + c1 Y' + m/h w0

    Args:
        deformation: Y - X0: displacement of the driven end at the end of the step less that of the
            slider at its beginning. [m]
        rate: Rate of elongation Y' at the end of the step. [m/s]
        slider_velocity: Velocity w0 of the slider at the beginning of the step. [m/s]
        step: Time step h, > 0. [s]
        mass: Mass of the sponge m, >= 0. [kg]
        friction_force, friction_damping, regularisation_velocity: As for `mstv_damper`. [N, N s/m,
            m/s]
        sponge_stiffness, sponge_damping, slider_damping: As for `mstv_damper`. [N/m, N s/m, N s/m]

    Returns:
        Tension s [N] and velocity w of the slider [m/s], both at the end of the step.
    """
    w = slider_rate(
        sponge_stiffness * deformation + sponge_damping * rate + mass / step * slider_velocity,
        rate,
        sponge_stiffness * step + sponge_damping + slider_damping + mass / step,
        friction_force,
        friction_damping,
        regularisation_velocity,
    )
    tension = sponge_stiffness * (deformation - step * w) + sponge_damping * (rate - w)
    return tension, w


@law
def stv_sponge_damper(
    rate,
    deformation,
    friction_force,
    transition_velocity,
    sponge_stiffness,
    sponge_damping,
    slider_damping,
):
    """Return tension and deformation rate of a massless sponge under STV or Coulomb friction.

        s = k1 delta + c1 (v - w),   s = c2 w - f_stv(w)   [C] Eq. (2), (3), (4), (6), M = m = 0

    Own derivation: with b = k1 delta + c1 v and c = c1 + c2 the balance c w + f_max clip(w / v_st,
    -1, 1) = b has the one solution w = b v_st / (f_max + c v_st) for |b| <= f_max + c v_st, else
    sgn(b) (|b| - f_max) / c.

    Args:
        rate: Rate of elongation v. [m/s]
        deformation: Deformation of the sponge delta. [m]
        friction_force: Full friction force [f_max]. [N]
        transition_velocity: Stick transition velocity [v_st], >= 0; Coulomb friction if 0. [m/s]
        sponge_stiffness, sponge_damping: Sponge [k1, c1]. [N/m, N s/m]
        slider_damping: Air resistance of the slider [c2]; c1 + c2 > 0. [N s/m]

    Returns:
        Tension s [N] and the rate of deformation v - w [m/s].
    """
    b = sponge_stiffness * deformation + sponge_damping * rate
    c = sponge_damping + slider_damping
    size, full = abs(b), friction_force + c * transition_velocity
    sticks = size <= full
    creep = size * transition_velocity / where(full > 0.0, full, 1.0)
    w = where(b >= 0.0, 1.0, -1.0) * where(sticks, creep, (size - friction_force) / c)
    return sponge_stiffness * deformation + sponge_damping * (rate - w), rate - w


@law
def free_stroke_damper(
    rate,
    deformation,
    friction_force,
    friction_damping,
    regularisation_velocity,
    basic_friction_force,
    basic_full_friction_velocity,
    sponge,
):
    """Return tension and deformation rate of a free-stroke damper with a massless sponge.

        tension = f_d(delta) + f_b,   f_d = K(delta) delta = f_m,   f_b = HAVSIN(v)   [A] (2)-(6)

    Inside the free stroke f_d = 0 and the sponge stays with the inner tube: w = 0.

    Args:
        rate: Rate of elongation v, outer tube less inner tube. [m/s]
        deformation: Outer tube less sponge, delta. [m]
        friction_force, friction_damping, regularisation_velocity: Main friction, MSTV
            [f_max, c_m, epsilon]. [N, N s/m, m/s]
        basic_friction_force, basic_full_friction_velocity: Basic friction, HAVSIN [p_b, v_b]. [N,
            m/s]
        sponge: Sponge curve f_d over delta, packed, as array and index (`wm_drake.laws.table`). [m,
            N]

    Returns:
        Tension [N] and the rate of deformation v - w [m/s].
    """
    f_d = stiffness_force(deformation, *sponge)
    w = slider_rate(f_d, rate, 0.0, friction_force, friction_damping, regularisation_velocity)
    basic = havsin_friction(rate, basic_full_friction_velocity, basic_friction_force)
    return f_d - basic, rate - w


@law
def free_stroke_sponge_with_mass(
    deformation,
    rate,
    slider_velocity,
    step,
    mass,
    friction_force,
    friction_damping,
    regularisation_velocity,
    basic_friction_force,
    basic_full_friction_velocity,
    sponge,
):
    """Take a step of linearly implicit Euler of a free-stroke damper whose sponge has a mass.

        tension = f_d + f_b,   m xs'' = f_d - f_m                  [A] Eq. (2)-(6)

    Own derivation of the step: with xs = xs0 + h w, xs'' = (w - w0) / h and the sponge curve
    replaced by its tangent k, the balance at the end of the step is that of a massless slider,
    `slider_rate`:

        (k h + m/h) w + f_m(w, Y' - w) = f_d(Y - xs0) + m/h w0

    Args:
        deformation: Y - xs0: displacement of the outer tube at the end of the step less that of the
            sponge at its beginning. [m]
        rate: Rate of elongation Y' at the end of the step. [m/s]
        slider_velocity: Velocity w0 of the sponge at the beginning of the step. [m/s]
        step: Time step h, > 0. [s]
        mass: Mass of the sponge m, > 0. [kg]
        friction_force, friction_damping, regularisation_velocity: As for `free_stroke_damper`. [N,
            N s/m, m/s]
        basic_friction_force, basic_full_friction_velocity, sponge: As for `free_stroke_damper`. [N,
            m/s; m, N]

    Returns:
        Tension [N] and velocity w of the sponge [m/s], both at the end of the step.
    """
    f_d = stiffness_force(deformation, *sponge)
    near = 1e-9  # m, within which the curve is its tangent
    slope = (
        stiffness_force(deformation + near, *sponge) - stiffness_force(deformation - near, *sponge)
    ) / (2.0 * near)
    w = slider_rate(
        f_d + mass / step * slider_velocity,
        rate,
        slope * step + mass / step,
        friction_force,
        friction_damping,
        regularisation_velocity,
    )
    basic = havsin_friction(rate, basic_full_friction_velocity, basic_friction_force)
    return stiffness_force(deformation - step * w, *sponge) - basic, w
