"""Force elements of a machine: springs, dampers, bushings. Frozen, SI; field names are the key paths of the machine file."""

import functools
import itertools
from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator
from scipy.interpolate import PchipInterpolator

from wm_drake.laws.table import PIECE_SIZE, packed_table_size
from wm_drake.parameters import units as u
from wm_drake.parameters.types import FloatArray


class Frozen(BaseModel):
    """A frozen record that refuses unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ForceTable(Frozen):
    """Force over displacement: a monotone cubic through the points, straight lines beyond them."""

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


class TorqueTable(Frozen):
    """Torque over angle: a monotone cubic through the points, straight lines beyond them."""

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


def check_curve(x_name: str, x: tuple[float, ...], y_name: str, y: tuple[float, ...]) -> None:
    """Refuses curves that are not functions of rising abscissa with never falling ordinate."""
    if len(x) != len(y) or len(x) < 2:
        raise ValueError(
            f"needs as many values of {x_name} as of {y_name}, at least two; has {len(x)} and {len(y)}"
        )
    if any(left >= right for left, right in itertools.pairwise(x)):
        raise ValueError(f"{x_name} must rise from point to point")
    if any(left > right for left, right in itertools.pairwise(y)):
        raise ValueError(f"{y_name} must not fall from point to point")


def packed_stiffness(stiffness: "float | ForceTable | TorqueTable") -> FloatArray:
    """A stiffness in the packed form of `wm_drake.laws.table`."""
    return packed_stiffnesses([stiffness])[0]


def packed_stiffnesses(
    stiffnesses: "Sequence[float | ForceTable | TorqueTable]",
) -> list[FloatArray]:
    """Several at once: tables over the same points share one call of scipy, of which a study makes thousands."""
    packed = [
        np.array([0.0, s]) if isinstance(s, float | int) else np.empty(0) for s in stiffnesses
    ]
    curves = {
        index: s.curve
        for index, s in enumerate(stiffnesses)
        if isinstance(s, ForceTable | TorqueTable)
    }
    for points in dict.fromkeys(x for x, _ in curves.values()):
        alike = [index for index, (x, _) in curves.items() if x == points]
        for index, curve in zip(
            alike, _packed_curves(points, tuple(curves[index][1] for index in alike)), strict=True
        ):
            packed[index] = curve
    return packed


@functools.lru_cache(maxsize=256)  # a study packs the same curves for each run
def _packed_curves(x: tuple[float, ...], ys: tuple[tuple[float, ...], ...]) -> FloatArray:
    """One row for each curve: the monotone cubics (scipy's PCHIP) through the points, as `wm_drake.laws.table` takes them."""
    cubics = PchipInterpolator(x, ys, axis=1).c[::-1]  # (4, pieces, curves)
    h, (_, a, b, c) = x[-1] - x[-2], cubics[:, -1]
    end_slopes = np.maximum(
        a + h * (2.0 * b + h * 3.0 * c), 0.0
    )  # rounding can make a flat end fall by 1e-11
    packed = np.empty((len(ys), packed_table_size(len(x))))
    packed[:, 0], packed[:, -2], packed[:, -1] = len(x), x[-1], end_slopes
    pieces = packed[:, 1:-2].reshape(len(ys), -1, PIECE_SIZE)
    pieces[:, :, 0], pieces[:, :, 1:] = x[:-1], cubics.transpose(2, 1, 0)
    packed.flags.writeable = False
    return packed


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
_NonNegativeForce: TypeAlias = Annotated[u.Force, Field(ge=0.0)]
_NonNegativeTorque: TypeAlias = Annotated[u.Torque, Field(ge=0.0)]
_NonNegativeDamping: TypeAlias = Annotated[u.LinearDamping, Field(ge=0.0)]
_NonNegativeRotationalDamping: TypeAlias = Annotated[u.RotationalDamping, Field(ge=0.0)]
_PositiveVelocity: TypeAlias = Annotated[u.Velocity, Field(gt=0.0)]
_PositiveRate: TypeAlias = Annotated[u.AngularVelocity, Field(gt=0.0)]


class SpringType(Frozen):
    """A suspension spring as bought. Its preload follows from static equilibrium, so it is not written."""

    stiffness: Stiffness


class Spring(Frozen):
    """A suspension spring in its place."""

    type: str
    tub_frame: str
    housing_frame: str


class EndBushing(Frozen):
    """Bushing at each end of a damper, where it bends against tub and housing (Hooke joints of [B]). Zero is legal."""

    stiffness: Annotated[u.RotationalStiffness, Field(ge=0.0)] = 0.0
    damping: _NonNegativeRotationalDamping = 0.0
    friction_torque: _NonNegativeTorque = 0.0
    full_friction_rate: _PositiveRate = 1.0


class _DamperType(Frozen):
    end_bushing: EndBushing = EndBushing()


class CoulombDamper(_DamperType):
    """Coulomb friction [C] Eq. (4), and a dashpot in parallel."""

    law: Literal["coulomb"]
    friction_force: _NonNegativeForce
    damping: _NonNegativeDamping = 0.0


class StvDamper(_DamperType):
    """Friction with a stick transition velocity [C] Eq. (6), and a dashpot in parallel."""

    law: Literal["stv"]
    friction_force: _NonNegativeForce
    transition_velocity: _PositiveVelocity
    damping: _NonNegativeDamping = 0.0


class HavsinDamper(_DamperType):
    """Smoothed Coulomb friction [A] Eq. (2), and a dashpot in parallel."""

    law: Literal["havsin"]
    friction_force: _NonNegativeForce
    full_friction_velocity: _PositiveVelocity
    damping: _NonNegativeDamping = 0.0


class MstvDamper(_DamperType):
    """Massless sponge with MSTV friction [C] Eq. (2), (3), (7)."""

    law: Literal["mstv"]
    friction_force: _NonNegativeForce
    friction_damping: _NonNegativeDamping = 0.0
    regularisation_velocity: _PositiveVelocity = 1e-6
    sponge_stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)]
    sponge_damping: _NonNegativeDamping
    slider_damping: _NonNegativeDamping

    @model_validator(mode="after")
    def _slider_rate_is_finite(self) -> "MstvDamper":
        if self.sponge_damping + self.slider_damping + self.friction_damping <= 0.0:
            raise ValueError(
                "sponge_damping, slider_damping and friction_damping are all zero: a massless slider needs one"
            )
        return self


class StvSpongeDamper(_DamperType):
    """Massless sponge with STV friction [C] Eq. (2), (3), (6); at a transition velocity of 0 with Coulomb's Eq. (4)."""

    law: Literal["stv_sponge"]
    friction_force: _NonNegativeForce
    transition_velocity: Annotated[u.Velocity, Field(ge=0.0)] = 0.0
    sponge_stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)]
    sponge_damping: _NonNegativeDamping
    slider_damping: _NonNegativeDamping = 0.0

    @model_validator(mode="after")
    def _slider_rate_is_finite(self) -> "StvSpongeDamper":
        if self.sponge_damping + self.slider_damping <= 0.0:
            raise ValueError(
                "sponge_damping and slider_damping are both zero: a massless slider needs one"
            )
        return self


class FreeStrokeDamper(_DamperType):
    """Free-stroke damper [A] Eq. (2)-(6) with a massless sponge; the curve is zero inside the free stroke."""

    law: Literal["free_stroke"]
    friction_force: _NonNegativeForce
    friction_damping: Annotated[u.LinearDamping, Field(gt=0.0)]
    regularisation_velocity: _PositiveVelocity = 1e-6
    basic_friction_force: _NonNegativeForce
    basic_full_friction_velocity: _PositiveVelocity
    sponge: ForceTable


DamperType: TypeAlias = Annotated[
    CoulombDamper | StvDamper | HavsinDamper | MstvDamper | StvSpongeDamper | FreeStrokeDamper,
    Field(discriminator="law"),
]


class Damper(Frozen):
    """A damper in its place."""

    type: str
    tub_frame: str
    housing_frame: str


class BushingType(Frozen):
    """Six-component bushing [A] Eq. (7), (8)."""

    stiffness_x: Stiffness
    stiffness_y: Stiffness
    stiffness_z: Stiffness
    rotational_stiffness_x: RotationalStiffness
    rotational_stiffness_y: RotationalStiffness
    rotational_stiffness_z: RotationalStiffness
    damping_x: _NonNegativeDamping = 0.0
    damping_y: _NonNegativeDamping = 0.0
    damping_z: _NonNegativeDamping = 0.0
    rotational_damping_x: _NonNegativeRotationalDamping = 0.0
    rotational_damping_y: _NonNegativeRotationalDamping = 0.0
    rotational_damping_z: _NonNegativeRotationalDamping = 0.0
    friction_torque_x: _NonNegativeTorque = 0.0
    friction_torque_y: _NonNegativeTorque = 0.0
    friction_torque_z: _NonNegativeTorque = 0.0
    full_friction_rate_x: _PositiveRate = 1.0
    full_friction_rate_y: _PositiveRate = 1.0
    full_friction_rate_z: _PositiveRate = 1.0


class Bushing(BushingType):
    """A six-component bushing in its place; the gasket of [B] Fig. 4 is one. Stiffness lives in the housing-side frame."""

    tub_frame: str
    housing_frame: str


class TelescopicDamper(Frozen):
    """A damper whose tubes are bodies ([A] Fig. 20): tub - bushing - outer tube - joint - inner tube - bushing - housing.

    Attributes:
        type: Law along the joint, one of `damper_types`; its end_bushing is for dampers without tubes.
        joint: Prismatic joint of the SDF from the outer tube, which is otherwise free, to the inner one; positive when longer.
        tub_bushing, housing_bushing: Of `bushing_types`. Stiffness lives in outer_frame, and in housing_frame.
        tub_frame, outer_frame: Of the first, on tub and outer tube; at the same place when drawn.
        inner_frame, housing_frame: Of the second, on inner tube and housing.
    """

    type: str
    joint: str
    tub_bushing: str
    housing_bushing: str
    tub_frame: str
    outer_frame: str
    inner_frame: str
    housing_frame: str
