"""Springs, dampers, bushings of a machine: frozen, SI; fields are the keys of the machine file."""

import itertools
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.rubber import RubberBranches
from wm_drake.parameters.types import FloatArray


class Frozen(BaseModel):
    """A frozen type that allows no unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ForceTable(Frozen):
    """Force over displacement: a monotone cubic through the points, straight lines beyond them.

    Attributes:
        displacement: Rising displacements, at least two.
        force: Force at each of them, never falling.
    """

    displacement: u.Lengths
    force: u.Forces

    @model_validator(mode="after")
    def _monotone(self) -> "ForceTable":
        check_curve("displacement", self.displacement, "force", self.force)
        return self

    @property
    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Abscissas and ordinates."""
        return self.displacement, self.force

    def values(self, displacement: FloatArray) -> FloatArray:
        """Return the force at displacements (n,). [m -> N]"""
        return _curve_values(self.curve, displacement)


class TorqueTable(Frozen):
    """Torque over angle: a monotone cubic through the points, straight lines beyond them.

    Attributes:
        angle: Rising angles, at least two.
        torque: Torque at each of them, never falling.
    """

    angle: u.Angles
    torque: u.Torques

    @model_validator(mode="after")
    def _monotone(self) -> "TorqueTable":
        check_curve("angle", self.angle, "torque", self.torque)
        return self

    @property
    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Abscissas and ordinates."""
        return self.angle, self.torque

    def values(self, angle: FloatArray) -> FloatArray:
        """Return the torque at angles (n,). [rad -> N m]"""
        return _curve_values(self.curve, angle)


def _curve_values(curve: tuple[tuple[float, ...], tuple[float, ...]], x: FloatArray) -> FloatArray:
    """Return the ordinates of a monotone cubic with straight ends at abscissas (n,)."""
    from scipy.interpolate import PchipInterpolator  # half a second to import: machines with tables

    cubic = PchipInterpolator(*curve)
    inside = np.clip(x, curve[0][0], curve[0][-1])
    return np.asarray(cubic(inside) + cubic.derivative()(inside) * (x - inside))


def check_curve(x_name: str, x: tuple[float, ...], y_name: str, y: tuple[float, ...]) -> None:
    """Check that a curve is a function of rising abscissa with never falling ordinate.

    Raises:
        ValueError: It is not.
    """
    if len(x) != len(y) or len(x) < 2:
        raise ValueError(
            f"needs as many values of {x_name} as of {y_name}, at least two; "
            f"has {len(x)} and {len(y)}"
        )
    if any(left >= right for left, right in itertools.pairwise(x)):
        raise ValueError(f"{x_name} must rise from point to point")
    if any(left > right for left, right in itertools.pairwise(y)):
        raise ValueError(f"{y_name} must not fall from point to point")


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
