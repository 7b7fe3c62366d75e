"""A wall that the tub meets after some way: an element kind of another package, stiff where hidden.

    F = k (d - g) for d > g, else 0

d: how much the distance of a point of the tub from a point of the housing is shorter than at rest.
Near rest it has no force, so that no eigenvalue of the machine at rest knows of it.
"""

from typing import Annotated

from pydantic import Field

import wm_drake as wm
from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import where
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import rotate, scale
from wm_drake.elements.strut import strut_line, wrench_at_origin
from wm_drake.parameters.units import Unit

NUMBERS = PackedLayout("HiddenWall", hook=VECTOR, anchor=VECTOR, stiffness=SCALAR, met_at=SCALAR)
"""Point of the tub in T, point of the housing in W [m], k [N/m], length below which F acts [m]."""
read_numbers = NUMBERS.read


class HiddenWall(wm.Element):
    """A wall beyond a gap.

    Attributes:
        stiffness: Force over the way behind the gap.
        met_at: Length of the strut below which it acts.
    """

    stiffness: Annotated[float, Unit("N/m", "N/mm"), Field(ge=0.0)]
    met_at: Annotated[float, Unit("m", "mm"), Field(ge=0.0)]


@law
def hidden_wall(motion, _state, p, at):
    """Return moment about To and force on the tub, the force, and no rates of states."""
    numbers = read_numbers(p, at)
    arm = rotate(motion.rotation, numbers.hook)
    length, _, direction, _, _ = strut_line(motion, arm, numbers.anchor)
    way = numbers.met_at - length
    force = where(way > 0.0, numbers.stiffness * way, 0.0 * way)
    return wrench_at_origin(arm, scale(force, direction), (0.0, 0.0, 0.0)), (force,), ()


HIDDEN_WALL = wm.ElementKind(
    name="hidden_wall",
    parameters=HiddenWall,
    layout=NUMBERS,
    numbers=lambda parameters, ends: {
        "hook": ends.tub_point,
        "anchor": ends.housing_point,
        "stiffness": parameters.stiffness,
        "met_at": parameters.met_at,
    },
    evaluate=hidden_wall,
    outputs=(wm.Output("force", "N", "force of the hidden walls"),),
    acts_at_rest=False,
    words="wall beyond a gap",
)
