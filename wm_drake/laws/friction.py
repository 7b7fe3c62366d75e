"""Laws of dry friction.

Properties that each law has, and its tests hold: odd in velocity, never does positive work, bounded by its full force.
Reversing all velocities reverses the force. Misprints of the papers are corrected; the docstrings say which.
"""

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, sine_over_angle, sqrt, where


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
    return where(v > 0.0, -f_max + 0.0 * v, where(v < 0.0, f_max + 0.0 * v, 0.0 * v))


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
    return where(abs(v) < v_st, -f_max * v / v_st, coulomb_friction(v, f_max))


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
    x = (0.5 * np.pi) * (v / v_t)
    return where(abs(v) < v_t, -p * (x * sine_over_angle(x * x)), coulomb_friction(v, p))


@law
def havsin_friction_per_rate(rate_squared, slope, p):
    """f / v of `havsin_friction`, which multiplied with a vector of velocity or rate gives the friction against it.

    Args:
        rate_squared: Square of the magnitude of the vector. [m^2/s^2 or rad^2/s^2]
        slope: pi / (2 v_t), the relative slope of the friction at rest. [s/m or s/rad]
        p: As for `havsin_friction`.

    Returns:
        Force or torque per rate, <= 0; -p slope at rest, where it is smooth. [N s/m or N m s]
    """
    x_squared = slope * slope * rate_squared
    per_rate = -p * slope * sine_over_angle(x_squared)
    full = x_squared >= 0.25 * np.pi * np.pi
    if anywhere(full):
        per_rate = where(full, -p / sqrt(rate_squared), per_rate)
    return per_rate


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
    return where(abs(w) >= abs(u), coulomb_friction(w, g), -g * w / (abs(u) + epsilon))
