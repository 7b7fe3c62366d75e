"""Branches of rubber beside spring and dashpot: rate-independent friction, and a Maxwell element.

A branch sees the displacement of one axis only, a length or an angle. Its one state, the stretch of
its spring, has the unit of the displacement and is zero while the branch is relaxed.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import decay_factor, where


@law
def dahl_rate(stretch, rate, displacement):
    """Return the rate of the stretch of a Dahl friction element.

        z' = v - |v| z / x_c,    force = F_max z / x_c       Dahl (1968), exponent 1

    The force depends on the path and not on its speed: v dt may be replaced by the path. From rest
    it is F_max (1 - exp(-x / x_c)); after a reversal at z_0 it is that of `dahl_after_path`. |z|
    stays below x_c, so the force stays below F_max.

    Args:
        stretch: Stretch z. [m or rad]
        rate: Rate v of the displacement. [m/s or rad/s]
        displacement: x_c, > 0: F_max / x_c is the stiffness from rest. [m or rad]
    """
    return rate - abs(rate) * stretch / displacement


@law
def dahl_after_path(stretch, path, displacement):
    """Return the stretch of a Dahl element after a path without reversal, in closed form.

        z = s x_c + (z_0 - s x_c) exp(-|path| / x_c),   s = sgn(path)       own derivation

    Args:
        stretch: Stretch z_0 before. [m or rad]
        path: Signed length of the path. [m or rad]
        displacement: x_c, > 0. [m or rad]
    """
    full = where(path >= 0.0, displacement, -displacement)
    return full + (stretch - full) * decay_factor(abs(path) / displacement)


@law
def dahl_after_step(stretch, path, rate, step, displacement):
    """Return the stretch of a Dahl element after a time step, whatever its length.

    The rate is taken as linear over the step. If it changes its sign, the path there and the path
    back are followed one after the other. Own derivation: with v_0 = 2 path / h - v_1 they are
    h v_0^2 / (2 (v_0 - v_1)) and -h v_1^2 / (2 (v_0 - v_1)).

    Args:
        stretch: Stretch before. [m or rad]
        path: Displacement over the step. [m or rad]
        rate: Rate v_1 at the end of the step. [m/s or rad/s]
        step: Time step h, > 0. [s]
        displacement: x_c, > 0. [m or rad]
    """
    first = 2.0 * path / step - rate
    turns = first * rate < 0.0
    change = where(turns, first - rate, 1.0)
    there = where(turns, 0.5 * step * first * first / change, path)
    back = where(turns, -0.5 * step * rate * rate / change, 0.0 * path)
    return dahl_after_path(dahl_after_path(stretch, there, displacement), back, displacement)


@law
def maxwell_rate(stretch, rate, stiffness, damping):
    """Return the rate of the stretch of the spring of a Maxwell element.

        z' = v - k z / c,    force = k z

    At the angular frequency w the element has the stiffness k (w t)^2 / (1 + (w t)^2) and the
    dashpot c / (1 + (w t)^2), t = c / k.

    Args:
        stretch: Stretch z of its spring. [m or rad]
        rate: Rate v of the displacement. [m/s or rad/s]
        stiffness: Spring k, > 0. [N/m or N m/rad]
        damping: Dashpot c in series with it, > 0. [N s/m or N m s/rad]
    """
    return rate - stiffness * stretch / damping


@law
def maxwell_after_step(stretch, start, middle, end, step, stiffness, damping):
    """Return the stretch of a Maxwell element after a step of the classical Runge-Kutta scheme.

    Args:
        stretch: Stretch before. [m or rad]
        start, middle, end: Rate of the displacement in the step. [m/s or rad/s]
        step: Time step h. [s]
        stiffness, damping: Spring and dashpot in series.
    """
    first = maxwell_rate(stretch, start, stiffness, damping)
    second = maxwell_rate(stretch + 0.5 * step * first, middle, stiffness, damping)
    third = maxwell_rate(stretch + 0.5 * step * second, middle, stiffness, damping)
    fourth = maxwell_rate(stretch + step * third, end, stiffness, damping)
    return stretch + step / 6.0 * ((first + fourth) + 2.0 * (second + third))


@law
def maxwell_after_path(stretch, path, step, stiffness, damping):
    """Return the stretch of a Maxwell element after a step at a constant rate, in closed form.

        z = z_0 e + v t (1 - e),    e = exp(-h / t),   t = c / k,   v = path / h    own derivation

    Args:
        stretch: Stretch z_0 before. [m or rad]
        path: Displacement over the step. [m or rad]
        step: Time step h, > 0, of any length. [s]
        stiffness, damping: Spring k and dashpot c in series. [N/m, N s/m; N m/rad, N m s/rad]
    """
    decay = stiffness * step / damping
    factor, small = decay_factor(decay), decay < 1e-5
    mean = where(small, 1.0 - 0.5 * decay, (1.0 - factor) / where(small, 1.0, decay))
    return stretch * factor + path * mean
