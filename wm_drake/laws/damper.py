"""Friction dampers along their line: tension and the rate of their state.

Every damper law has the same face, ``(rate, deformation, packed) -> (tension, deformation_rate)``: `rate` is the rate of
elongation of the strut [m/s], tension > 0 while it pulls its ends together [N]. A law without a sponge ignores the
deformation and answers a rate of zero. The state is the deformation of the sponge delta = Y - X [m] (driven end less
slider), which needs no reference length; the slider of [C] is X = Y - delta.

Packed parameters, by law:

    COULOMB      f_max, damping
    STV          f_max, v_st, damping
    HAVSIN       p, v_t, damping
    MSTV         f_max, c_m, epsilon, k1, c1, c2
    FREE_STROKE  f_max, c_m, epsilon, p_b, v_b, then the packed sponge curve
    STV_SPONGE   f_max, v_st, k1, c1, c2
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt, where
from wm_drake.laws.friction import coulomb_friction, havsin_friction, stv_friction
from wm_drake.laws.table import stiffness_force

COULOMB = 0
STV = 1
HAVSIN = 2
MSTV = 3
FREE_STROKE = 4
STV_SPONGE = 5


@law
def slider_rate(b, v, c, f_max, c_m, epsilon):
    """Velocity of a massless slider under MSTV friction, in closed form.

    Own derivation. Force balance of [C] Eq. (3) with m = 0, with the friction `mstv_friction` and u = v - w:

        b = c w + g(w) sgn(w)               for |w| >= |u|   (slips)
        b = c w + g(w) w / (|u| + eps)      for |w| <  |u|   (sticks),     g(w) = f_max + c_m |w|

    w has the sign of b; turn signs so that b >= 0. Then the sticking branch is a quadratic with one positive root:

        v > 0, u = v - w:    (c_m - c) w^2 + (c (v + eps) + f_max + b) w - b (v + eps) = 0,   valid up to w = v/2
        v <= 0, u = v - w:   (c_m + c) w^2 + (c (|v| + eps) + f_max - b) w - b (|v| + eps) = 0,   always valid

    (at v = 0, where [C] has both branches meet, the limit from below), and the slipping one is w = (b - f_max) / (c + c_m).
    The right sides grow with w, so the balance has one solution; at w = v/2 the friction jumps by a relative eps/v, where the
    slider keeps w = v/2.

    Args:
        b: Force of the sponge on the slider less what depends on w: k1 delta + c1 v in [C], K(delta) delta in [A]. [N]
        v: Velocity of the driven end. [m/s]
        c: Sum of the dashpots that oppose w (c1 + c2 in [C], 0 in [A]), >= 0; c + c_m > 0. [N s/m]
        f_max: Friction force at rest, >= 0. [N]
        c_m: Growth of the friction with slider velocity, >= 0. [N s/m]
        epsilon: Regularisation of MSTV, > 0. [m/s]

    Returns:
        Slider velocity w = X'. [m/s] Its sensitivity to b is at most 1/c: the damper is no stiffer than k1/c.
    """
    sign = where(b >= 0.0, 1.0, -1.0)
    b = sign * b
    v = sign * v
    e = abs(v) + epsilon
    along = where(v > 0.0, 1.0, -1.0)
    a2, a1, a0 = c_m - along * c, c * e + f_max + along * b, b * e
    half = 0.5 * v
    slips = (v > 0.0) & (
        (a2 * half + a1) * half < a0
    )  # the sticking balance has its root beyond v/2
    above, below = root_as_quotient(a2, a1, a0)
    w = where(slips, b - f_max, above) / where(slips, c + c_m, below)
    return sign * where(slips & (w < half), half, w)


@law
def root_as_quotient(a2, a1, a0):
    """Positive root of a2 w^2 + a1 w - a0 = 0 for a0 >= 0 (smaller one if a2 < 0 < a1), without cancellation.

    Returns:
        Numerator and denominator; 0 and 1 where there is neither friction nor force.
    """
    radicand = a1 * a1 + 4.0 * a2 * a0
    free = radicand <= 0.0  # the root of zero has no derivative
    root = sqrt(where(free, 1.0, radicand))
    rises = a1 > 0.0
    above = where(free, 0.0 * a1, where(rises, 2.0 * a0, root - a1))
    return above, where(free, 1.0, where(rises, a1 + root, 2.0 * a2))


@law
def mstv_damper(rate, deformation, f_max, c_m, epsilon, k1, c1, c2):
    """Friction damper with a massless sponge.

        s = k1 delta + c1 (v - w),   s = c2 w - f_mstv(w, v - w)      [C] Eq. (2), (3) with M = m = 0

    Args:
        rate: Rate of elongation v. [m/s]
        deformation: Deformation of the sponge delta. [m]
        f_max, c_m, epsilon: MSTV friction. [N, N s/m, m/s]
        k1, c1: Stiffness and damping of the sponge. [N/m, N s/m]
        c2: Air resistance of the slider. [N s/m]

    Returns:
        Tension s [N] and the rate of deformation v - w [m/s].
    """
    w = slider_rate(k1 * deformation + c1 * rate, rate, c1 + c2, f_max, c_m, epsilon)
    return k1 * deformation + c1 * (rate - w), rate - w


@law
def stv_sponge_damper(rate, deformation, f_max, v_st, k1, c1, c2):
    """Friction damper with a massless sponge under STV friction; under Coulomb friction if v_st = 0.

        s = k1 delta + c1 (v - w),   s = c2 w - f_stv(w)      [C] Eq. (2), (3), (4), (6) with M = m = 0

    Own derivation: with b = k1 delta + c1 v and c = c1 + c2 the balance c w + f_max clip(w / v_st, -1, 1) = b has the one
    solution w = b v_st / (f_max + c v_st) for |b| <= f_max + c v_st, else sgn(b) (|b| - f_max) / c.

    Args:
        rate: Rate of elongation v. [m/s]
        deformation: Deformation of the sponge delta. [m]
        f_max, v_st: STV friction; v_st >= 0. [N, m/s]
        k1, c1: Stiffness and damping of the sponge. [N/m, N s/m]
        c2: Air resistance of the slider; c1 + c2 > 0. [N s/m]

    Returns:
        Tension s [N] and the rate of deformation v - w [m/s].
    """
    b = k1 * deformation + c1 * rate
    c = c1 + c2
    size, full = abs(b), f_max + c * v_st
    sticks = size <= full
    creep = size * v_st / where(full > 0.0, full, 1.0)
    w = where(b >= 0.0, 1.0, -1.0) * where(sticks, creep, (size - f_max) / c)
    return k1 * deformation + c1 * (rate - w), rate - w


@law
def free_stroke_damper(rate, deformation, f_max, c_m, epsilon, p_b, v_b, packed, at):
    """Free-stroke damper with a massless sponge.

        tension = f_d(delta) + f_b,   f_d = K(delta) delta = f_m,   f_b = HAVSIN(v)      [A] Eq. (2)-(6)

    Inside the free stroke f_d = 0 and the sponge stays with the inner tube: w = 0.

    Args:
        rate: Rate of elongation v, outer tube less inner tube. [m/s]
        deformation: Outer tube less sponge, delta. [m]
        f_max, c_m, epsilon: Main friction, MSTV. [N, N s/m, m/s]
        p_b, v_b: Basic friction, HAVSIN. [N, m/s]
        packed, at: Sponge curve f_d over delta, packed (`wm_drake.laws.table`). [m, N]

    Returns:
        Tension [N] and the rate of deformation v - w [m/s].
    """
    f_d = stiffness_force(deformation, packed, at)
    w = slider_rate(f_d, rate, 0.0, f_max, c_m, epsilon)
    return f_d - havsin_friction(rate, v_b, p_b), rate - w


@law
def damper_response(law_number, rate, deformation, p, at):
    """Tension and deformation rate of a damper of any law; parameters packed as the module's docstring lists them."""
    if law_number == MSTV:
        return mstv_damper(
            rate, deformation, p[at], p[at + 1], p[at + 2], p[at + 3], p[at + 4], p[at + 5]
        )
    if law_number == FREE_STROKE:
        return free_stroke_damper(
            rate, deformation, p[at], p[at + 1], p[at + 2], p[at + 3], p[at + 4], p, at + 5
        )
    if law_number == STV_SPONGE:
        return stv_sponge_damper(
            rate, deformation, p[at], p[at + 1], p[at + 2], p[at + 3], p[at + 4]
        )
    if law_number == HAVSIN:
        return p[at + 2] * rate - havsin_friction(rate, p[at + 1], p[at]), 0.0 * rate
    if law_number == STV:
        return p[at + 2] * rate - stv_friction(rate, p[at + 1], p[at]), 0.0 * rate
    return p[at + 1] * rate - coulomb_friction(rate, p[at]), 0.0 * rate
