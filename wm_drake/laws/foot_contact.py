"""A foot of a cabinet on the floor: a pad that is pressed, sheared, and slides with dry friction.

The pad is massless, with a spring and a damper in each direction. Its lower end is on the floor.
Own derivations from Coulomb's law; that a stuck contact must not creep under a load that alternates
is the finding of Dupont, Hayward, Armstrong and Altpeter, Single state elastoplastic friction
models, IEEE Transactions on Automatic Control 47 (2002) 787-792.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, sqrt, where


@law
def pad_normal_force(compression, rate, stiffness, damping, growth):
    """Return the normal force of the floor on a pad.

        N = k d + c d' min(1, g d),    d > 0 and N > 0;    N = 0 else

    The damping grows with the compression from 0, so that the force does not jump where the pad
    touches the floor. The pad does not pull.

    Args:
        compression, rate: d and its rate; d < 0 for a foot above the floor. [m, m/s]
        stiffness, damping: k, > 0, and c, >= 0. [N/m, N s/m]
        growth: g, > 0; the damping is full from the compression 1 / g on. [1/m]

    Returns:
        Force, up, >= 0. [N]
    """
    share = growth * compression
    share = where(share < 1.0, share, 1.0)
    force = stiffness * compression + damping * rate * share
    return where((compression > 0.0) & (force > 0.0), force, 0.0 * force)


@law
def pad_friction(shear, velocity, stiffness, damping, limit):
    """Return the friction force of the floor on a pad, and the velocity at which its end slides.

    The end of the massless pad sticks as long as spring and damper hold less than Coulomb's limit.
    Else it slides along the force, just so fast that they hold the limit:

        F = k s + c v
        |F| <= mu N:   f = -F,                 w = 0
        |F| >  mu N:   f = -mu N F / |F|,      w = (|F| - mu N) / c  F / |F|

    s' = v - w. All three are continuous. A pad that sticks does not creep at all: w is exactly 0.
    One that slides springs back with the rate k / c. For c to 0 it is an elastic pad with Coulomb
    friction.

    Args:
        shear: s, how far the foot is moved against the end of its pad, x and y. [m]
        velocity: v of the foot, x and y. [m/s]
        stiffness, damping: k, > 0, and c, > 0. [N/m, N s/m]
        limit: mu N, >= 0. [N]

    Returns:
        Force on the foot, x and y [N]; velocity w of the end of the pad, x and y [m/s].
    """
    f_x = stiffness * shear[0] + damping * velocity[0]
    f_y = stiffness * shear[1] + damping * velocity[1]
    square = f_x * f_x + f_y * f_y
    slides = square > limit * limit
    share, rate = 1.0, 0.0
    if anywhere(slides):  # a root and quotients, which most states do not need
        share = where(slides, limit / sqrt(square), 1.0)
        # (1 - share) F / c, which is 0 without rounding where it sticks
        rate = where(slides, (1.0 - share) / damping, 0.0)
    return -share * f_x, -share * f_y, rate * f_x, rate * f_y
