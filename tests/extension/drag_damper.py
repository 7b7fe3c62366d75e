"""Quadratic drag damper: an element kind of another package, in one file.

    F = c |v| v

v: rate of the distance between a point of the tub and a point of the housing, F: tension. It is a
dashpot whose fluid flows fast through an orifice.
"""

from typing import Annotated

from pydantic import Field

import wm_drake as wm
from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import rotate, scale
from wm_drake.elements.strut import strut_line, wrench_at_origin
from wm_drake.parameters.units import Unit

NUMBERS = PackedLayout("DragDamperNumbers", hook=VECTOR, anchor=VECTOR, coefficient=SCALAR)
"""Point of the tub in T, point of the housing in W [m], coefficient c [N s^2/m^2]."""
read_numbers = NUMBERS.read


class DragDamper(wm.Element):
    """A damper whose force grows with the square of the velocity.

    Attributes:
        coefficient: Tension over the square of the velocity.
    """

    coefficient: Annotated[float, Unit("N*s^2/m^2", "N*s^2/m^2"), Field(ge=0.0)]


@law
def drag_damper(motion, _state, p, at):
    """Return moment about To and force on the tub, the tension, and no rates of states."""
    numbers = read_numbers(p, at)
    arm = rotate(motion.rotation, numbers.hook)
    _, rate, direction, _, _ = strut_line(motion, arm, numbers.anchor)
    tension = numbers.coefficient * abs(rate) * rate
    wrench = wrench_at_origin(arm, scale(-tension, direction), (0.0, 0.0, 0.0))
    return wrench, (tension,), ()


DRAG_DAMPER = wm.ElementKind(
    name="drag_damper",
    parameters=DragDamper,
    layout=NUMBERS,
    numbers=lambda parameters, ends: {
        "hook": ends.tub_point,
        "anchor": ends.housing_point,
        "coefficient": parameters.coefficient,
    },
    evaluate=drag_damper,
    outputs=(wm.Output("tension", "N", "tension of the drag dampers"),),
    acts_at_rest=False,
    words="damper with a force proportional to the square of the velocity",
)
