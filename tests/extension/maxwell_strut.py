"""Spring and dashpot in series between tub and housing: an element kind with a state of its own.

    F = k z,    z' = v - F / c

v: rate of the distance between the two points, z: stretch of the spring, F: tension.
"""

from typing import Annotated

from pydantic import Field

import wm_drake as wm
from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import rotate, scale
from wm_drake.elements.strut import strut_line, wrench_at_origin
from wm_drake.parameters import units as u

NUMBERS = PackedLayout(
    "MaxwellStrutNumbers", hook=VECTOR, anchor=VECTOR, stiffness=SCALAR, damping=SCALAR
)
"""Point of the tub in T, point of the housing in W [m], k [N/m], c [N s/m]."""
read_numbers = NUMBERS.read


class MaxwellStrut(wm.Element):
    """A spring and a dashpot in series.

    Attributes:
        stiffness: Stiffness of the spring.
        damping: Damping of the dashpot.
    """

    stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)]
    damping: Annotated[u.LinearDamping, Field(gt=0.0)]


@law
def maxwell_strut(motion, state, p, at):
    """Return moment about To and force on the tub, the tension, and the rate of the stretch."""
    numbers = read_numbers(p, at)
    arm = rotate(motion.rotation, numbers.hook)
    _, rate, direction, _, _ = strut_line(motion, arm, numbers.anchor)
    tension = numbers.stiffness * state.stretch
    wrench = wrench_at_origin(arm, scale(-tension, direction), (0.0, 0.0, 0.0))
    return wrench, (tension,), (rate - tension / numbers.damping,)


def numbers_of(parameters, ends):
    """Return the packed numbers by name."""
    return {
        "hook": ends.tub_point,
        "anchor": ends.housing_point,
        "stiffness": parameters.stiffness,
        "damping": parameters.damping,
    }


MAXWELL_STRUT = wm.ElementKind(
    name="maxwell_strut",
    parameters=MaxwellStrut,
    layout=NUMBERS,
    numbers=numbers_of,
    evaluate=maxwell_strut,
    outputs=(wm.Output("tension", "N", "tension of the Maxwell struts"),),
    states=(wm.State("stretch", "m"),),
    words="spring and dashpot in series",
)
