"""A shaft in a round hole with play: no force within the clearance, then a linear contact.

Own derivation; the contact is that of `wm_drake.laws.foot_contact.pad_normal_force`.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, sqrt, where
from wm_drake.laws.foot_contact import pad_normal_force


@law
def clearance_force(d, d_rate, clearance, stiffness, damping):
    """Return the force of a round hole on a shaft that is moved by d from its centre.

        rho = |d|,  e = rho - c
        F = -N d / rho,    N = k e + b e' min(1, 10 e / c),    e > 0 and N > 0;    F = 0 else

    The damping grows with the compression e and is full from a tenth of the clearance on, so the
    force is continuous. It never pulls. There is no friction: the shaft is in the inner ring of a
    rolling bearing, which turns with it.

    Args:
        d, d_rate: Displacement of the shaft across the axis, two components, and its rate.
            [m, m/s]
        clearance: c, radial, > 0; 0 for a bearing without clearance, whose force is 0. [m]
        stiffness, damping: k of the contact, > 0, and b, >= 0. [N/m, N s/m]

    Returns:
        Force on the shaft, two components. [N]
    """
    square = d[0] * d[0] + d[1] * d[1]
    touches = (clearance > 0.0) & (square > clearance * clearance)
    pull = 0.0
    if anywhere(touches):  # a root and quotients, which most states do not need
        rho = sqrt(where(touches, square, 1.0))
        growth = 10.0 / where(touches, clearance, 1.0)
        rate = (d[0] * d_rate[0] + d[1] * d_rate[1]) / rho
        force = pad_normal_force(rho - clearance, rate, stiffness, damping, growth)
        pull = where(touches, force / rho, 0.0)
    return -pull * d[0], -pull * d[1]
