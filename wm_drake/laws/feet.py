"""Four feet of a rigid cabinet on a rigid level floor: loads, and margins against moving.

Own derivations from statics and Coulomb friction. That a machine turns before it slides is the
finding of Papadopoulos and Papadimitriou, Modeling, design and control of a portable washing
machine during the spinning cycle, IEEE/ASME AIM 2001, pp. 899-904. The limit of force and
moment together is the limit surface of Goyal, Ruina and Papadopoulos, Planar sliding with dry
friction, Wear 143 (1991) 307-330.

Positions are in a frame with its origin on the floor and z up. The load is the wrench on the
cabinet, weight included: force (fx, fy, -down), moment (mx, my, mz) about the origin. The feet are
the corners of a convex quadrilateral, counterclockwise from above.
"""

import math

from wm_drake.compiler.compilation import law

MOST_ITERATIONS = 60
"""Largest number of Newton steps of `least_turning_resistance`."""


@law
def normal_loads(down, moment_x, moment_y, x, y):
    """Return the normal load of each foot of a rigid cabinet on four equal vertical springs.

    Equilibrium gives three equations for four loads: sum N = down, sum y N = -mx, sum x N = my. The
    assumption of equal vertical stiffness makes N least in its sum of squares, N >= 0:

        N_i = a + b x_i + c y_i + t n_i,    n: sum n = sum x n = sum y n = 0

    t = 0 as long as all feet are loaded. If one lifts off, t is the number nearest to 0 for which
    no load is negative. This is the exact solution for springs that do not pull.

    Args:
        down: Vertical load. [N]
        moment_x, moment_y: Moments of the load. [N m]
        x, y: Positions of the feet. [m]

    Returns:
        Normal loads, >= 0. [N] If the cabinet tips over (`tilting_margin` < 0) there is no
        equilibrium; then the loads are those nearest to one, scaled to the vertical load, or 0 if
        it is lifted.
    """
    x_0, y_0 = 0.25 * (x[0] + x[1] + x[2] + x[3]), 0.25 * (y[0] + y[1] + y[2] + y[3])
    u = (x[0] - x_0, x[1] - x_0, x[2] - x_0, x[3] - x_0)
    v = (y[0] - y_0, y[1] - y_0, y[2] - y_0, y[3] - y_0)
    uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + u[3] * u[3]
    vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]
    uv = u[0] * v[0] + u[1] * v[1] + u[2] * v[2] + u[3] * v[3]
    p, q = moment_y - x_0 * down, -moment_x - y_0 * down
    determinant = uu * vv - uv * uv
    b, c, a = (vv * p - uv * q) / determinant, (uu * q - uv * p) / determinant, 0.25 * down
    n_0, n_1 = a + b * u[0] + c * v[0], a + b * u[1] + c * v[1]
    n_2, n_3 = a + b * u[2] + c * v[2], a + b * u[3] + c * v[3]
    # the null vector: areas of the triangles of the other three feet, with alternating signs
    k_0, k_1 = triangle(x, y, 1, 2, 3), triangle(x, y, 0, 2, 3)
    k_2, k_3 = triangle(x, y, 0, 1, 3), triangle(x, y, 0, 1, 2)
    low, high = max(-n_0 / k_0, -n_2 / k_2), min(n_1 / k_1, n_3 / k_3)
    stands = low <= high
    t = min(max(0.0, low), high) if stands else 0.5 * (low + high)
    loads = (
        max(0.0, n_0 + t * k_0),
        max(0.0, n_1 - t * k_1),
        max(0.0, n_2 + t * k_2),
        max(0.0, n_3 - t * k_3),
    )
    total = loads[0] + loads[1] + loads[2] + loads[3]
    share = 1.0 if stands else (max(0.0, down) / total if total > 0.0 else 0.0)
    return (share * loads[0], share * loads[1], share * loads[2], share * loads[3])


@law
def triangle(x, y, i, j, k):
    """Return twice the area of the triangle of three feet, > 0 if counterclockwise. [m^2]"""
    return (x[j] - x[i]) * (y[k] - y[i]) - (y[j] - y[i]) * (x[k] - x[i])


@law
def tilting_margin(down, moment_x, moment_y, x, y):
    """Return the moment that still keeps the cabinet from tipping over an edge between two feet.

        min over edges of  down * d

    d: distance of the centre of pressure from the edge, > 0 inside.

    Args:
        down, moment_x, moment_y, x, y: As for `normal_loads`.

    Returns:
        Smallest margin of the four edges; below 0 the cabinet tips over. [N m]
    """
    smallest = math.inf
    for i in range(4):
        j = (i + 1) % 4
        e_x, e_y = x[j] - x[i], y[j] - y[i]
        length = math.sqrt(e_x * e_x + e_y * e_y)
        held = (-moment_x - y[i] * down) * e_x - (moment_y - x[i] * down) * e_y
        smallest = min(smallest, held / length)
    return smallest


@law
def sliding_margin(force_x, force_y, holding):
    """Return the horizontal force that friction can still take. [N]

        margin = sum mu N_i - |f|

    Args:
        force_x, force_y: Horizontal load. [N]
        holding: Full friction force mu N of each foot. [N]

    Returns:
        The margin; below 0 the cabinet slides. Coulomb friction without a moment about the centre
        of pressure: all feet then reach their full friction at once.
    """
    total = holding[0] + holding[1] + holding[2] + holding[3]
    return total - math.sqrt(force_x * force_x + force_y * force_y)


@law
def turning_margin(force_x, force_y, moment, holding, x, y):
    """Return the vertical moment that friction can still take beside the present load.

    The loads (f, m) that four feet with full friction w_i = mu N_i can hold form a convex set. By
    the theorems of limit analysis, with the velocity v of the origin and angular velocity 1,

        m <= h(f) = min over v of  sum w_i |v + z x r_i| - f . v,    -m <= h(-f)

    Each v is a centre of rotation: the work of friction in turning about it is an upper bound, and
    the smallest is exact. For f = 0 and equal loads at the corners of a square h = mu W r, with the
    distance r of the corners from the centre.

    Args:
        force_x, force_y, moment: Horizontal load and its moment about z. [N, N m]
        holding: Full friction force mu N of each foot. [N]
        x, y: Positions of the feet. [m]

    Returns:
        The smallest additional moment that makes the cabinet turn, h(f) - m or h(-f) + m. [N m]
        Below 0 it turns. If it slides already, minus the moment about the centre of pressure, which
        is the limit at the threshold of sliding.
    """
    size, about = force_and_moment(force_x, force_y, moment, holding, x, y)
    if not holding[0] + holding[1] + holding[2] + holding[3] > size:
        return -abs(about)
    return min(
        least_turning_resistance(force_x, force_y, holding, x, y) - moment,
        least_turning_resistance(-force_x, -force_y, holding, x, y) + moment,
    )


@law
def turning_margin_bound(force_x, force_y, moment, holding, x, y):
    """Return a lower bound of `turning_margin`, in a fraction of its time.

    The set of loads that friction can hold is convex. It contains sliding at the threshold, and the
    moment of pairs of opposite forces at two feet without resultant. So it contains

        s (sliding along f) + (1 - s) (pairs),    s = |f| / sum w

    Args:
        force_x, force_y, moment, holding, x, y: As for `turning_margin`.

    Returns:
        The bound. [N m]
    """
    size, about = force_and_moment(force_x, force_y, moment, holding, x, y)
    total = holding[0] + holding[1] + holding[2] + holding[3]
    if not total > size:
        return -abs(about)
    a, b = (0 if holding[0] > holding[2] else 2), (1 if holding[1] > holding[3] else 3)
    pairs = (
        min(holding[0], holding[2]) * distance(x, y, 0, 2)
        + min(holding[1], holding[3]) * distance(x, y, 1, 3)
        + min(abs(holding[0] - holding[2]), abs(holding[1] - holding[3])) * distance(x, y, a, b)
    )
    return (1.0 - size / total) * pairs - abs(about)


@law
def force_and_moment(force_x, force_y, moment, holding, x, y):
    """Return the size of the horizontal load, and its moment about the centre of pressure.

    Args:
        force_x, force_y, moment, holding, x, y: As for `turning_margin`.
    """
    total = holding[0] + holding[1] + holding[2] + holding[3]
    c_x = holding[0] * x[0] + holding[1] * x[1] + holding[2] * x[2] + holding[3] * x[3]
    c_y = holding[0] * y[0] + holding[1] * y[1] + holding[2] * y[2] + holding[3] * y[3]
    inverse = 1.0 / total if total > 0.0 else 0.0
    size = math.sqrt(force_x * force_x + force_y * force_y)
    return size, moment - inverse * (c_x * force_y - c_y * force_x)


@law
def distance(x, y, i, j):
    """Return the distance of two feet. [m]"""
    return math.sqrt((x[i] - x[j]) * (x[i] - x[j]) + (y[i] - y[j]) * (y[i] - y[j]))


@law
def least_turning_resistance(force_x, force_y, holding, x, y):
    """Return h(f) of `turning_margin`, the minimum of a convex function of two velocities.

    The function has a kink where the centre of rotation is at a foot. These four points are tried
    first; elsewhere Newton's method with halved steps finds the minimum. Not for lanes.

    Args:
        force_x, force_y, holding, x, y: As for `turning_margin`, |f| < sum of holding.

    Returns:
        The minimum. [N m] It is never below the exact one, and above it by rounding only.
    """
    value, v_x, v_y, step_x, step_y, decrease = turning_about_a_foot(
        force_x, force_y, holding, x, y
    )
    least_decrease = 1e-13 * (holding[0] + holding[1] + holding[2] + holding[3])
    for _ in range(MOST_ITERATIONS):
        if not decrease > least_decrease:
            break
        share = 1.0
        power = turning_power(v_x + step_x, v_y + step_y, force_x, force_y, holding, x, y)
        while power > value - 1e-4 * share * decrease and share > 1e-9:
            share *= 0.5
            power = turning_power(
                v_x + share * step_x, v_y + share * step_y, force_x, force_y, holding, x, y
            )
        if not power < value:
            break
        value, v_x, v_y = power, v_x + share * step_x, v_y + share * step_y
        step_x, step_y, decrease = newton_step(v_x, v_y, force_x, force_y, holding, x, y)
    return value


@law
def turning_about_a_foot(force_x, force_y, holding, x, y):
    """Return the least power of turning about one of the feet, and the first step away from it.

    The power has a kink at a foot: it is the minimum if the slope of all other terms is at most the
    foot's own w. Else it falls along that slope.

    Args:
        force_x, force_y, holding, x, y: As for `turning_margin`.

    Returns:
        Power at angular velocity 1 [N m]; velocity of the origin [m]; step (two numbers) [m] and
        expected decrease [N m], 0 if the minimum is here.
    """
    value, v_x, v_y, step_x, step_y, decrease = math.inf, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(4):
        a_x, a_y = y[j], -x[j]
        power = turning_power(a_x, a_y, force_x, force_y, holding, x, y)
        if power < value:
            value, v_x, v_y = power, a_x, a_y
            g_x, g_y, spread = -force_x, -force_y, 0.0
            for i in range(4):
                inverse = 0.0 if i == j else 1.0 / distance(x, y, i, j)
                g_x += holding[i] * inverse * (a_x - y[i])
                g_y += holding[i] * inverse * (a_y + x[i])
                spread += holding[i] * inverse
            slope = math.sqrt(g_x * g_x + g_y * g_y)
            excess = max(0.0, slope - holding[j]) / max(slope * spread, 1e-300)
            step_x, step_y = -excess * g_x, -excess * g_y
            decrease = excess * slope * max(0.0, slope - holding[j])
    return value, v_x, v_y, step_x, step_y, decrease


@law
def newton_step(v_x, v_y, force_x, force_y, holding, x, y):
    """Return Newton's step (two numbers) towards the least power, and the expected decrease.

    Args:
        v_x, v_y: Velocity of the origin at angular velocity 1. [m]
        force_x, force_y, holding, x, y: As for `turning_margin`.
    """
    g_x, g_y, h_xx, h_yy, h_xy = -force_x, -force_y, 0.0, 0.0, 0.0
    for i in range(4):
        e_x, e_y = v_x - y[i], v_y + x[i]
        d = max(math.sqrt(e_x * e_x + e_y * e_y), 1e-12)
        e_x, e_y, k = e_x / d, e_y / d, holding[i] / d
        g_x += holding[i] * e_x
        g_y += holding[i] * e_y
        h_xx += k * e_y * e_y
        h_yy += k * e_x * e_x
        h_xy -= k * e_x * e_y
    determinant, trace = h_xx * h_yy - h_xy * h_xy, h_xx + h_yy
    if determinant > 1e-12 * trace * trace:
        step_x = -(h_yy * g_x - h_xy * g_y) / determinant
        step_y = -(h_xx * g_y - h_xy * g_x) / determinant
    else:
        step_x, step_y = -g_x / trace, -g_y / trace
    return step_x, step_y, -(g_x * step_x + g_y * step_y)


@law
def turning_power(v_x, v_y, force_x, force_y, holding, x, y):
    """Return sum w_i |v + z x r_i| - f . v, see `turning_margin`. [N m]"""
    power = -force_x * v_x - force_y * v_y
    for i in range(4):
        e_x, e_y = v_x - y[i], v_y + x[i]
        power += holding[i] * math.sqrt(e_x * e_x + e_y * e_y)
    return power


@law
def tangential_loads(force_x, force_y, moment, normal, x, y):
    """Return the size of the horizontal force of each foot on the floor, below the limits.

    Equilibrium does not decide how feet share a horizontal load. Assumption: they creep as one
    rigid body, and each resists in proportion to its normal load and its velocity (regularised
    Coulomb friction at small speeds):

        T_i = N_i (f / N + m_c z x (r_i - c) / sum N_j |r_j - c|^2)

    Args:
        force_x, force_y, moment: Horizontal load and its moment about z. [N, N m]
        normal: Normal load of each foot. [N]
        x, y: Positions of the feet. [m]

    Returns:
        |T_i|. [N] A foot without normal load has none.
    """
    total = normal[0] + normal[1] + normal[2] + normal[3]
    _, about = force_and_moment(force_x, force_y, moment, normal, x, y)
    inverse = 1.0 / total if total > 0.0 else 0.0
    c_x, c_y, polar = 0.0, 0.0, 0.0
    for i in range(4):
        c_x += inverse * normal[i] * x[i]
        c_y += inverse * normal[i] * y[i]
    for i in range(4):
        polar += normal[i] * ((x[i] - c_x) * (x[i] - c_x) + (y[i] - c_y) * (y[i] - c_y))
    turn = about / polar if polar > 0.0 else 0.0
    f_x, f_y = inverse * force_x, inverse * force_y
    return (
        tangential(normal[0], f_x, f_y, turn, x[0] - c_x, y[0] - c_y),
        tangential(normal[1], f_x, f_y, turn, x[1] - c_x, y[1] - c_y),
        tangential(normal[2], f_x, f_y, turn, x[2] - c_x, y[2] - c_y),
        tangential(normal[3], f_x, f_y, turn, x[3] - c_x, y[3] - c_y),
    )


@law
def tangential(normal, f_x, f_y, turn, r_x, r_y):
    """Return N |f + turn z x r| of one foot, see `tangential_loads`. [N]"""
    t_x, t_y = f_x - turn * r_y, f_y + turn * r_x
    return normal * math.sqrt(t_x * t_x + t_y * t_y)
