"""Springs, dampers, bushings of a machine: frozen, SI; fields are the keys of the machine file."""

import itertools
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.monotone import monotone_cubics
from wm_drake.parameters.rubber import RubberBranches
from wm_drake.parameters.types import FloatArray


class Frozen(BaseModel):
    """A frozen type that allows no unknown fields."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_serialization_defaults_required=True
    )

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        """Yield what differs from its default: a gasket has 57 numbers, most of which are zero."""
        fields = type(self).model_fields
        for name, value in super().__repr_args__():
            if name not in fields or value != fields[name].default:
                yield name, value


LINEAR_PART = 0.2
"""Part of a table, on each side of zero, whose fitted line has the nominal stiffness as its slope.

[B] section 4: "slopes of linear fit to the first 20 % of the force-displacement and torque-angle
curves".
"""


class CurveTable(Frozen):
    """A curve through points: a monotone cubic between them, straight lines beyond them.

    The first field has the rising abscissas, at least two; the second the ordinates, never falling.
    """

    stiffness_unit: ClassVar[u.Unit]

    @model_validator(mode="after")
    def _monotone(self) -> Self:
        (x_name, x), (y_name, y) = self
        if len(x) != len(y) or len(x) < 2:
            raise ValueError(
                f"needs as many values of {x_name} as of {y_name}, at least two; "
                f"has {len(x)} and {len(y)}"
            )
        if any(left >= right for left, right in itertools.pairwise(x)):
            raise ValueError(f"{x_name} must rise from point to point")
        if any(left > right for left, right in itertools.pairwise(y)):
            raise ValueError(f"{y_name} must not fall from point to point")
        return self

    @property
    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Abscissas and ordinates."""
        x, y = vars(self).values()  # a study reads them thousands of times
        return x, y

    def values(self, x: FloatArray) -> FloatArray:
        """Return the ordinates at abscissas (n,)."""
        at, ordinates = map(np.array, self.curve)
        cubics = monotone_cubics(at, ordinates[:, None])[:, :, 0]
        inside = np.clip(x, at[0], at[-1])
        piece = np.clip(np.searchsorted(at, inside, side="right") - 1, 0, len(at) - 2)
        (y, a, b, c), d = cubics[:, piece], inside - at[piece]
        value, slope = y + d * (a + d * (b + d * c)), a + d * (2.0 * b + d * 3.0 * c)
        return np.asarray(value + slope * (x - inside))

    def scaled(self, factor: float) -> Self:
        """Return the table with its ordinates times a factor."""
        (_, _), (name, y) = self
        return self.model_copy(update={name: tuple(factor * number for number in y)})

    @property
    def nominal_stiffness(self) -> float:
        """Slope of the least-squares line through the first 20 % of the curve on both sides of 0.

        If the curve is flat there (a free stroke), it is the slope of the line through the whole
        curve. [N/m or N m/rad]
        """
        x = self.curve[0]
        for part in (LINEAR_PART, 1.0):
            points = np.linspace(part * min(x[0], 0.0), part * max(x[-1], 0.0), 201)
            slope = float(np.polyfit(points, self.values(points), 1)[0])
            if slope > 0.0:
                return slope
        return 0.0


class ForceTable(CurveTable):
    """Force over displacement: a monotone cubic through the points, straight lines beyond them.

    Attributes:
        displacement: Rising displacements, at least two.
        force: Force at each of them, never falling.
    """

    stiffness_unit = u.Unit("N/m", "N/mm")
    displacement: u.Lengths
    force: u.Forces


class TorqueTable(CurveTable):
    """Torque over angle: a monotone cubic through the points, straight lines beyond them.

    Attributes:
        angle: Rising angles, at least two.
        torque: Torque at each of them, never falling.
    """

    stiffness_unit = u.Unit("N*m/rad", "N*mm/rad")
    angle: u.Angles
    torque: u.Torques


def _form(value: Any) -> str:
    return "table" if isinstance(value, dict | Frozen) else "number"


Stiffness: TypeAlias = Annotated[
    Annotated[u.LinearStiffness, Field(ge=0.0), Tag("number")]
    | Annotated[ForceTable, Tag("table")],
    Discriminator(_form),
]
RotationalStiffness: TypeAlias = Annotated[
    Annotated[u.RotationalStiffness, Field(ge=0.0), Tag("number")]
    | Annotated[TorqueTable, Tag("table")],
    Discriminator(_form),
]
NonNegativeForce: TypeAlias = Annotated[u.Force, Field(ge=0.0)]
NonNegativeTorque: TypeAlias = Annotated[u.Torque, Field(ge=0.0)]
NonNegativeDamping: TypeAlias = Annotated[u.LinearDamping, Field(ge=0.0)]
NonNegativeRotationalDamping: TypeAlias = Annotated[u.RotationalDamping, Field(ge=0.0)]
PositiveVelocity: TypeAlias = Annotated[u.Velocity, Field(gt=0.0)]
PositiveRate: TypeAlias = Annotated[u.AngularVelocity, Field(gt=0.0)]


class SpringType(Frozen):
    """A suspension spring as bought.

    Attributes:
        stiffness: Tension over elongation from the drawn length.
        free_length: Length without tension. None: the preload follows from static equilibrium at
            the drawn pose.
        action: A tension-only spring hangs in hooks and goes slack; a tension-compression spring
            pushes too.
    """

    stiffness: Stiffness
    free_length: Annotated[u.Length, Field(gt=0.0)] | None = None
    action: Literal["tension-only", "tension-compression"] = "tension-only"


class Spring(Frozen):
    """A suspension spring in its place.

    Attributes:
        type: Name in spring_types.
        tub_frame, housing_frame: Frames at whose origins the spring hangs.
        preload: Tension as drawn. None: it follows from the free length of the type, or else from
            static equilibrium at the drawn pose.
    """

    type: str
    tub_frame: str
    housing_frame: str
    preload: u.Force | None = None


class EndBushing(Frozen):
    """Bushing at each end of a damper (Hooke joints of [B]). Zero is legal.

    Attributes:
        stiffness: Torque against bending, per angle from the drawn pose.
        damping: Torque against bending, per rate.
        friction_torque: Friction against bending, [A] Eq. (7).
        full_friction_rate: Rate from which on the friction is complete.
    """

    stiffness: Annotated[u.RotationalStiffness, Field(ge=0.0)] = 0.0
    damping: NonNegativeRotationalDamping = 0.0
    friction_torque: NonNegativeTorque = 0.0
    full_friction_rate: PositiveRate = 1.0


class Damper(Frozen):
    """A damper in its place.

    Attributes:
        type: Name in damper_types.
        tub_frame, housing_frame: Frames at whose origins the damper acts.
    """

    type: str
    tub_frame: str
    housing_frame: str


class BushingType(Frozen):
    """Six-component bushing [A] Eq. (7), (8).

    Attributes:
        stiffness_x, stiffness_y, stiffness_z: Force over displacement along each axis.
        rotational_stiffness_x, rotational_stiffness_y, rotational_stiffness_z: Torque over each
            component of the rotation vector.
        damping_x, damping_y, damping_z: Force per velocity along each axis.
        rotational_damping_x, rotational_damping_y, rotational_damping_z: Torque per rate about each
            axis.
        friction_torque_x, friction_torque_y, friction_torque_z: Friction about each axis.
        full_friction_rate_x, full_friction_rate_y, full_friction_rate_z: Rate from which on that
            friction is complete.
    """

    stiffness_x: Stiffness
    stiffness_y: Stiffness
    stiffness_z: Stiffness
    rotational_stiffness_x: RotationalStiffness
    rotational_stiffness_y: RotationalStiffness
    rotational_stiffness_z: RotationalStiffness
    damping_x: NonNegativeDamping = 0.0
    damping_y: NonNegativeDamping = 0.0
    damping_z: NonNegativeDamping = 0.0
    rotational_damping_x: NonNegativeRotationalDamping = 0.0
    rotational_damping_y: NonNegativeRotationalDamping = 0.0
    rotational_damping_z: NonNegativeRotationalDamping = 0.0
    friction_torque_x: NonNegativeTorque = 0.0
    friction_torque_y: NonNegativeTorque = 0.0
    friction_torque_z: NonNegativeTorque = 0.0
    full_friction_rate_x: PositiveRate = 1.0
    full_friction_rate_y: PositiveRate = 1.0
    full_friction_rate_z: PositiveRate = 1.0


class RubberBushingType(RubberBranches, BushingType):
    """A six-component bushing of rubber: the branches are beside spring and dashpot."""


class Bushing(RubberBushingType):
    """A six-component bushing in its place, such as the gasket of [B] Fig. 4.

    Its stiffness acts along the axes of the housing-side frame.

    Attributes:
        tub_frame, housing_frame: The two frames that the bushing connects, at the same place as
            drawn.
    """

    tub_frame: str
    housing_frame: str


class TelescopicDamper(Frozen):
    """A damper whose tubes are bodies ([A] Fig. 20).

    It is the chain tub - bushing - outer tube - joint - inner tube - bushing - housing.

    Attributes:
        type: Law along the joint, one of `damper_types`; its end_bushing is for dampers without
            tubes.
        joint: Prismatic joint of the SDF from the outer tube, which is otherwise free, to the inner
            one; positive when longer.
        tub_bushing, housing_bushing: Names in `bushing_types`. The stiffness of the first acts
            along the axes of outer_frame, that of the second along those of housing_frame.
        tub_frame, outer_frame: Frames of the first bushing, on tub and outer tube; at the same
            place when drawn.
        inner_frame, housing_frame: Frames of the second bushing, on inner tube and housing.
    """

    type: str
    joint: str
    tub_bushing: str
    housing_bushing: str
    tub_frame: str
    outer_frame: str
    inner_frame: str
    housing_frame: str
