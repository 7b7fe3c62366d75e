"""Laws of dry friction.

Each law is odd in the velocity, never does positive work, and is bounded by its full force; the
tests check this. Reversing all velocities reverses the force. Misprints of the papers are
corrected; the docstrings name them. Arguments carry the names of the machine file; a docstring
gives the symbol of the paper in brackets.
"""

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, sine_over_angle, sqrt, where


@law
def coulomb_friction(v, friction_force):
    """Return the Coulomb friction force.

        f = -f_max sgn(v),  f(0) = 0      [C] Eq. (4); printed -sgn|v|, which would not change sign

    Args:
        v: Sliding velocity. [m/s]
        friction_force: Friction force [f_max], >= 0. [N]

    Returns:
        Force on the slider. [N]
    """
    return where(
        v > 0.0, -friction_force + 0.0 * v, where(v < 0.0, friction_force + 0.0 * v, 0.0 * v)
    )


@law
def stv_friction(v, transition_velocity, friction_force):
    """Return the friction force with a stick transition velocity (STV).

        f = -f_max v / v_st,  |v| < v_st;   f = -f_max sgn(v) beyond      [C] Eq. (6)

    Args:
        v: Sliding velocity. [m/s]
        transition_velocity: Stick transition velocity [v_st], > 0. [m/s]
        friction_force: Full friction force [f_max], >= 0. [N]

    Returns:
        Force on the slider. [N]
    """
    return where(
        abs(v) < transition_velocity,
        -friction_force * v / transition_velocity,
        coulomb_friction(v, friction_force),
    )


@law
def havsin_friction(v, full_friction_velocity, friction_force):
    """Return the smoothed Coulomb friction force or torque (HAVSIN).

        f = -p sin(pi v / (2 v_t)),  |v| < v_t;   f = -p sgn(v) beyond   [A] Eq. (2), (3) corrected

    The printed HAVSIN of (3) is discontinuous at both ends. With pi inside the sine and (h1 - h0)/2
    before it, it is this function. It serves forces [N, m/s] and torques [N m, rad/s].

    Args:
        v: Sliding velocity. [m/s or rad/s]
        full_friction_velocity: Velocity at which friction is full [v_t], > 0. [m/s or rad/s]
        friction_force: Full friction force or torque [p], >= 0. [N or N m]

    Returns:
        Force or torque on the slider. [N or N m] Odd in v, never does positive work, |f| <= p.
    """
    x = (0.5 * np.pi) * (v / full_friction_velocity)
    return where(
        abs(v) < full_friction_velocity,
        -friction_force * (x * sine_over_angle(x * x)),
        coulomb_friction(v, friction_force),
    )


@law
def havsin_friction_per_rate(rate_squared, full_friction_rate, friction_torque):
    """Return f / v of `havsin_friction`: times a vector of velocity, it is the friction against it.

    Args:
        rate_squared: Square of the magnitude of the vector. [m^2/s^2 or rad^2/s^2]
        full_friction_rate: Velocity or rate at which friction is full [v_t], > 0. [m/s or rad/s]
        friction_torque: Full friction force or torque [p], >= 0. [N or N m]

    Returns:
        Force or torque per rate, <= 0. [N s/m or N m s] Smooth at rest, where it is -pi p / (2
        v_t).
    """
    slope = (0.5 * np.pi) / full_friction_rate
    x_squared = slope * slope * rate_squared
    per_rate = -friction_torque * slope * sine_over_angle(x_squared)
    full = x_squared >= 0.25 * np.pi * np.pi
    if anywhere(full):
        per_rate = where(full, -friction_torque / sqrt(rate_squared), per_rate)
    return per_rate


@law
def mstv_friction(w, u, friction_force, friction_damping, regularisation_velocity):
    """Return the friction force of the modified stick transition velocity model (MSTV).

        g = f_max + c_m |w|
        f = -g sgn(w),                |w| >= |u|      [C] Eq. (7), [A] Eq. (4) corrected
        f = -g w / (|u| + epsilon),   |w| <  |u|

    The stick transition velocity is the deformation rate of the sponge. Both papers print the
    second branch with the wrong sign (it would feed energy in), and [A] prints c_m w for c_m |w|
    (the force must be odd). [C] has c_m = 0.

    Args:
        w: Slider velocity. [m/s]
        u: Deformation rate of the sponge: velocity of the driven end less that of the slider. [m/s]
        friction_force: Friction force at rest [f_max], >= 0. [N]
        friction_damping: Growth of the friction with slider velocity [c_m], >= 0. [N s/m]
        regularisation_velocity: Keeps the quotient finite [epsilon], > 0; 1e-6 in the papers. [m/s]

    Returns:
        Force on the slider. [N]
    """
    g = friction_force + friction_damping * abs(w)
    return where(
        abs(w) >= abs(u), coulomb_friction(w, g), -g * w / (abs(u) + regularisation_velocity)
    )
