"""Stop: a rubber buffer on the housing that a point of the tub may touch.

The axis of the buffer is the line from its foot, the housing frame, to the point of the tub as
drawn. Its face is across that axis, at the distance `gap` from the point as drawn.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, cross, dot, rotate, scale
from wm_drake.elements.kind import ElementKind, Ends, Output
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.strut import transverse, wrench_at_origin
from wm_drake.errors import input_error
from wm_drake.laws.stop import rubbing_force, stop_force
from wm_drake.laws.table import CURVE
from wm_drake.parameters import units as u
from wm_drake.parameters.element_kinds import Element
from wm_drake.parameters.elements import ForceTable, Stiffness
from wm_drake.parameters.units import Unit

NUMBERS = PackedLayout(
    "StopNumbers",
    point=VECTOR,
    axis=VECTOR,
    reach=SCALAR,
    loss=SCALAR,
    friction=SCALAR,
    full_friction=SCALAR,
    stiffness=CURVE,
)
"""Point of the tub in T [m]; axis of the buffer in W, towards the tub; place of its face along the
axis, from Wo [m]; loss [s/m], friction coefficient, velocity of full friction [m/s], stiffness."""
read_numbers = NUMBERS.read


class Stop(Element):
    """A rubber buffer on the housing that a point of the tub may touch.

    Attributes:
        gap: Distance of the point of the tub from the face of the buffer, as drawn; None for that
            of the two ends: the bare parts touch.
        stiffness: Force over compression. A table makes a progressive buffer; it has its first
            point at 0.
        loss: Loss over the velocity of compression. A body that comes with a small velocity v
            leaves with about v (1 - 2/3 loss v).
        friction: Friction coefficient along the face.
        full_friction_velocity: Velocity along the face at which friction is 71 % of its full value.
    """

    gap: Annotated[u.Length, Field(ge=0.0)] | None = None
    stiffness: Stiffness
    loss: Annotated[float, Unit("s/m", "s/m"), Field(ge=0.0)] = 0.0
    friction: Annotated[u.Ratio, Field(ge=0.0)] = 0.0
    full_friction_velocity: Annotated[u.Velocity, Field(gt=0.0)] = 0.01

    @model_validator(mode="after")
    def _force_begins_at_zero(self) -> Self:
        """Check that the force does not jump at the first touch."""
        table = self.stiffness
        if isinstance(table, ForceTable) and (table.displacement[0], table.force[0]) != (0.0, 0.0):
            raise ValueError("stiffness: the first point of the table must be 0 N at 0 mm")
        return self


@law
def stop_approach(motion, stop):
    """Return how the tub is placed before a buffer.

    Args:
        motion: `TubMotion` of the tub.
        stop: Numbers of `NUMBERS` by name.

    Returns:
        Arm of the point from To, and its velocity, in W; compression of the buffer, below 0 where
        the point is away from it, and its rate. [m, m/s, m, m/s]
    """
    arm = rotate(motion.rotation, stop.point)
    velocity = add(motion.velocity, cross(motion.angular_velocity, arm))
    compression = stop.reach - dot(stop.axis, add(motion.position, arm))
    return arm, velocity, compression, -dot(stop.axis, velocity)


@law
def stop_wrench(motion, _state, p, at):
    """Return moment about To and force on the tub, and force, compression and its rate."""
    stop = read_numbers(p, at)
    arm, velocity, compression, rate = stop_approach(motion, stop)
    force = stop_force(compression, rate, stop.loss, stop.stiffness)
    along = transverse(velocity, stop.axis)
    rubbing = rubbing_force(force, along, stop.friction, stop.full_friction)
    on_tub = add(scale(force, stop.axis), rubbing)
    wrench = wrench_at_origin(arm, on_tub, (0.0, 0.0, 0.0))
    return wrench, (force, compression, rate), ()


def numbers_of(parameters: Stop, ends: Ends) -> Mapping[str, Any]:
    """Return the packed numbers by name.

    Raises:
        InputError: the two frames are at the same place, so that the buffer has no axis, or the gap
            is longer than their distance.
    """
    line = ends.tub_point - ends.housing_point
    length = float(np.linalg.norm(line))
    gap = length if parameters.gap is None else parameters.gap
    if parameters.gap is not None and gap >= length:
        text = "must be smaller than the distance of the two frames as drawn"
        raise input_error(f"{text}, {1e3 * length:.4g} mm", key="gap")
    axis = line / length
    return {
        "point": ends.tub_point,
        "axis": axis,
        "reach": float(axis @ ends.tub_point) - gap,
        "loss": parameters.loss,
        "friction": parameters.friction,
        "full_friction": parameters.full_friction_velocity,
        "stiffness": packed_stiffness(parameters.stiffness),
    }


STOP = ElementKind(
    name="stop",
    parameters=Stop,
    layout=NUMBERS,
    numbers=numbers_of,
    evaluate=stop_wrench,
    outputs=(
        Output("force", "N", "normal force of a stop on the tub, >= 0"),
        Output("compression", "m", "compression of a stop, < 0 where the tub does not touch it"),
        Output("closing_velocity", "m/s", "velocity of the tub towards a stop"),
    ),
    frictionless={"friction": 0.0},
    words="rubber buffer on the housing that the tub may touch",
)
