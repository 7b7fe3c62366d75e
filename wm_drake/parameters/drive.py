"""Drive of the drum: prescribed speed, or a motor with a torque limit and a speed controller."""

import itertools
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen, NonNegativeRotationalDamping, NonNegativeTorque


class Drive(Frozen):
    """A drive that turns the drum exactly as the spin profile says, whatever torque it takes.

    Attributes:
        kind: prescribed; may be left out.
        joint: Revolute joint of the SDF between tub and drum.
    """

    kind: Literal["prescribed"] = "prescribed"
    joint: str = "drum_axis"


class TorqueLimit(Frozen):
    """Largest torque of a motor: constant, and from a speed on limited by constant power.

    Attributes:
        torque: Largest torque at the motor's shaft. [N m]
        power: Largest mechanical power; None for a torque that does not depend on the speed. [W]
    """

    torque: Annotated[u.MotorTorque, Field(gt=0.0)]
    power: Annotated[u.Power, Field(gt=0.0)] | None = None


class TorqueLimitTable(Frozen):
    """Largest torque of a motor over its speed: a monotone cubic, constant beyond the last point.

    Attributes:
        speed: Speeds of the motor's shaft, from 0 on. [rad/s]
        torque: Largest torque at each. [N m]
    """

    speed: u.Speeds
    torque: u.MotorTorques

    @model_validator(mode="after")
    def _usable(self) -> "TorqueLimitTable":
        if len(self.speed) != len(self.torque) or len(self.speed) < 2:
            raise ValueError(
                "needs as many speeds as torques, at least two; "
                f"has {len(self.speed)} and {len(self.torque)}"
            )
        if self.speed[0] != 0.0:
            raise ValueError("the first speed must be 0 rpm")
        if any(left >= right for left, right in itertools.pairwise(self.speed)):
            raise ValueError("speed must rise from point to point")
        if min(self.torque) < 0.0 or self.torque[0] == 0.0:
            raise ValueError("torque must not be negative, and at standstill it must be above 0")
        return self


class SpeedController(Frozen):
    """PI controller of the motor's speed; its reference is the spin profile.

    Attributes:
        proportional_gain: Torque per speed error, both at the motor's shaft. [N m s/rad]
        integral_gain: Rate of the torque per speed error. [N m/rad]
        tracking_time: Time constant with which the integral part follows a limited torque
            (anti-windup); None for the quotient of the gains. [s]
        sample_time: Time between two samples of a digital controller, which holds its demand in
            between; None for a continuous one. [s]
    """

    proportional_gain: Annotated[u.RotationalDamping, Field(gt=0.0)]
    integral_gain: Annotated[u.RotationalStiffness, Field(ge=0.0)] = 0.0
    tracking_time: Annotated[u.Duration, Field(gt=0.0)] | None = None
    sample_time: Annotated[u.Duration, Field(ge=1e-4, le=0.1)] | None = None

    @model_validator(mode="after")
    def _follows(self) -> "SpeedController":
        if self.sample_time and self.sample_time * self.tracking_rate > 1.0:
            raise ValueError(
                f"sample_time: {self.sample_time:g} s is longer than the time constant of the "
                f"anti-windup, {1.0 / self.tracking_rate:g} s; shorten it, or set tracking_time"
            )
        return self

    @property
    def tracking_rate(self) -> float:
        """Return the inverse of the time constant of the anti-windup; 0 without integral. [1/s]"""
        if not self.integral_gain:
            return 0.0
        return 1.0 / (self.tracking_time or self.proportional_gain / self.integral_gain)


class BearingFriction(Frozen):
    """Friction of the drum's bearing and seal, at the drum.

    Attributes:
        friction_torque: Dry friction. [N m]
        full_friction_rate: Speed of the drum at which it is full. [rad/s]
        damping: Viscous friction. [N m s/rad]
    """

    friction_torque: NonNegativeTorque = 0.0
    full_friction_rate: Annotated[u.AngularVelocity, Field(gt=0.0)] = 1.0
    damping: NonNegativeRotationalDamping = 0.0


def _form_of_limit(value: Any) -> str:
    given = value.get("speed") if isinstance(value, dict) else getattr(value, "speed", None)
    return "torque limit" if given is None else "torque limit table"


class MotorDrive(Frozen):
    """A motor with a belt and a speed controller that follows the spin profile as it can.

    The motor is fixed to the tub and turns parallel to the drum, in the same sense.

    Attributes:
        kind: motor.
        joint: Revolute joint of the SDF between tub and drum.
        belt_ratio: Speed of the motor over speed of the drum; 1 for a direct drive.
        rotor_inertia: Moment of inertia of rotor and pulley about the motor's axis. [kg m^2]
        torque_limit: Largest torque of the motor, at the motor's shaft.
        controller: Speed controller, at the motor's shaft.
        bearing_friction: Friction of the drum, at the drum.
        torque_constant: Torque of the motor's shaft per current; None if it is not known, so that
            there is no current in records and exports. [N m/A]
    """

    kind: Literal["motor"]
    joint: str = "drum_axis"
    belt_ratio: Annotated[u.Ratio, Field(ge=1.0)]
    rotor_inertia: Annotated[u.Inertia, Field(ge=0.0)]
    torque_limit: Annotated[
        Annotated[TorqueLimit, Tag("torque limit")]
        | Annotated[TorqueLimitTable, Tag("torque limit table")],
        Discriminator(_form_of_limit),
    ]
    controller: SpeedController
    bearing_friction: BearingFriction = BearingFriction()
    torque_constant: Annotated[u.TorqueConstant, Field(gt=0.0)] | None = None

    @property
    def reflected_inertia(self) -> float:
        """Return the part of the rotor's inertia that acts on the drum's joint alone. [kg m^2]

        See `wm_drake.model.rotor`.
        """
        return (self.belt_ratio - 1.0) * self.belt_ratio * self.rotor_inertia

    @property
    def current_per_drum_torque(self) -> float | None:
        """Return the current per torque on the drum; None without torque constant. [A/(N m)]

            i = T / (n k_t)    T: torque on the drum, n: belt ratio, k_t: torque constant

        It has the sign of the torque. Losses of the motor and its magnetising current are not in
        it.
        """
        if self.torque_constant is None:
            return None
        return 1.0 / (self.belt_ratio * self.torque_constant)


def _kind(value: Any) -> str:
    given = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return "prescribed drive" if given is None else f"{given} drive"


AnyDrive: TypeAlias = Annotated[
    Annotated[Drive, Tag("prescribed drive")] | Annotated[MotorDrive, Tag("motor drive")],
    Discriminator(
        _kind,
        custom_error_type="drive_kind",
        custom_error_message="kind must be 'prescribed' or 'motor'",
    ),
]
"""Drive of a machine file; without the key `kind` the speed is prescribed."""

DRIVE_TAGS = ("prescribed drive", "motor drive", "torque limit", "torque limit table")
"""Tags of unions in this module, which are no keys of a machine file."""


def motor_of(drive: Drive | MotorDrive) -> MotorDrive | None:
    """Return the motor of a drive; None if the speed is prescribed."""
    return drive if isinstance(drive, MotorDrive) else None
