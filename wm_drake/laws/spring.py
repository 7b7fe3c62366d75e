"""Suspension spring."""

from wm_drake.compiler.compilation import law
from wm_drake.laws.table import stiffness_force


@law
def spring_tension(length, rest_length, preload, stiffness):
    """Return the tension of a suspension spring under a preload.

        t = preload + F(length - rest_length)      own derivation: Hooke's law about the drawn pose

    F = k x, or a table.

    Args:
        length: Distance between the hooks. [m]
        rest_length: Distance between the hooks as drawn (T = W). [m]
        preload: Tension as drawn; follows from static equilibrium. [N]
        stiffness: Packed stiffness, as array and index (`wm_drake.laws.table`).

    Returns:
        Tension, > 0 when it pulls the hooks together. [N]
    """
    return preload + stiffness_force(length - rest_length, *stiffness)
