"""Laws of dry friction.

Properties that each law has, and its tests hold: odd in velocity, never does positive work, bounded by its full force.
Reversing all velocities reverses the force. Misprints of the papers are corrected; the docstrings say which.
"""

import numpy as np

from wm_drake.laws.compilation import law


@law
def coulomb_friction(v, f_max):
    """Coulomb friction force.

        f = -f_max sgn(v),  f(0) = 0      [C] Eq. (4); printed -sgn|v|, a misprint: it would not change sign

    Args:
        v: Sliding velocity. [m/s]
        f_max: Friction force, >= 0. [N]

    Returns:
        Force on the slider. [N]
    """
    if v > 0.0:
        return -f_max + 0.0 * v
    if v < 0.0:
        return f_max + 0.0 * v
    return 0.0 * v


@law
def stv_friction(v, v_st, f_max):
    """Friction with a stick transition velocity.

        f = -f_max v / v_st,  |v| < v_st;   f = -f_max sgn(v) beyond      [C] Eq. (6)

    Args:
        v: Sliding velocity. [m/s]
        v_st: Stick transition velocity, > 0. [m/s]
        f_max: Full friction force, >= 0. [N]

    Returns:
        Force on the slider. [N]
    """
    if abs(v) < v_st:
        return -f_max * v / v_st
    return coulomb_friction(v, f_max)


@law
def havsin_friction(v, v_t, p):
    """Smoothed Coulomb friction force.

        f = -p sin(pi v / (2 v_t)),  |v| < v_t;   f = -p sgn(v) beyond      [A] Eq. (2), (3) corrected

    The printed HAVSIN of (3) is discontinuous at both ends; with pi inside the sine and (h1 - h0)/2 before it, it is this
    function. Serves forces [N, m/s] and torques [N m, rad/s] alike.

    Args:
        v: Sliding velocity. [m/s or rad/s]
        v_t: Velocity at which friction is full, > 0. [m/s or rad/s]
        p: Full friction force or torque, >= 0. [N or N m]

    Returns:
        Force or torque on the slider. [N or N m] Odd in v, never does positive work, |f| <= p.
    """
    if abs(v) < v_t:
        return -p * np.sin(0.5 * np.pi * v / v_t)
    return coulomb_friction(v, p)


@law
def mstv_friction(w, u, f_max, c_m, epsilon):
    """Friction with a stick transition velocity that is the deformation rate of the sponge (MSTV).

        g = f_max + c_m |w|
        f = -g sgn(w),               |w| >= |u|      [C] Eq. (7), [A] Eq. (4) corrected
        f = -g w / (|u| + epsilon),  |w| <  |u|

    Both papers print the second branch with the wrong sign (it would feed energy in), and [A] prints c_m w for c_m |w|
    (the force must be odd). [C] has c_m = 0.

    Args:
        w: Slider velocity. [m/s]
        u: Deformation rate of the sponge: velocity of the driven end less that of the slider. [m/s]
        f_max: Friction force at rest, >= 0. [N]
        c_m: Growth of the friction with slider velocity, >= 0. [N s/m]
        epsilon: Keeps the quotient finite, > 0; 1e-6 m/s in the papers. [m/s]

    Returns:
        Force on the slider. [N]
    """
    g = f_max + c_m * abs(w)
    if abs(w) >= abs(u):
        return coulomb_friction(w, g)
    return -g * w / (abs(u) + epsilon)
