"""Suspension spring."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, where
from wm_drake.laws.table import stiffness_force


@law
def spring_tension(length, rest_length, preload, taut_from, stiffness):
    """Return the tension of a suspension spring that may go slack.

        t = h                       h >= w    own derivation: Hooke's law about the drawn pose
        t = w s^2 (2 - s)           0 < h < w, s = h / w
        t = 0                       h <= 0    slack: shorter than the free length
        h = preload + F(length - rest_length)

    F = k x, or a table. The cubic between slack and taut has the value and slope of both sides, so
    that t is continuously differentiable. Its slope is at most 4/3 of that of h.

    Args:
        length: Distance between the hooks. [m]
        rest_length: Distance between the hooks as drawn (T = W). [m]
        preload: Tension as drawn; follows from static equilibrium. [N]
        taut_from: w, the tension from which the spring is fully taut, > 0; -inf for a spring that
            pushes too. [N]
        stiffness: Packed stiffness, as array and index (`wm_drake.laws.table`).

    Returns:
        Tension, > 0 when it pulls the hooks together. [N]
    """
    hooke = preload + stiffness_force(length - rest_length, *stiffness)
    below = hooke < taut_from
    if anywhere(below):
        s = where(hooke > 0.0, hooke, 0.0 * hooke) / taut_from
        hooke = where(below, taut_from * (s * s) * (2.0 - s), hooke)
    return hooke
