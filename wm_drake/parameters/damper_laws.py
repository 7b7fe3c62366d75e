"""Damper laws: their numbers in a machine file, and the registry of all that depends on a law.

A law is registered once. The file types, the compiled engine, the systems, the rigs, the
identification and the command line read the registry. To add a law, write a law function in
`wm_drake.laws`, a class here whose fields carry the names of the function's arguments, and an entry
of the registry.
"""

import functools
import inspect
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_args

from pydantic import Field, model_validator

from wm_drake.laws import damper, friction
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import (
    EndBushing,
    ForceTable,
    Frozen,
    NonNegativeDamping,
    NonNegativeForce,
    PositiveVelocity,
)

NumberKind: TypeAlias = Literal[
    "force", "stiffness", "damping", "speed", "length", "branch", "dashpot"
]
SearchRange: TypeAlias = NumberKind | tuple[float, float]
"""Where the identification searches a number: in the range of its kind, which follows from the
measured loops, or between two bounds in SI."""


class DamperNumbers(Frozen):
    """Numbers of a damper of any law.

    Attributes:
        end_bushing: Bushing at each end.
        law: Name of the law.
    """

    end_bushing: EndBushing = EndBushing()
    law: str


class CoulombDamper(DamperNumbers):
    """Coulomb friction [C] Eq. (4), and a dashpot in parallel.

    Attributes:
        friction_force: Friction while sliding [f_max].
        damping: Dashpot in parallel [c].
    """

    law: Literal["coulomb"]
    friction_force: NonNegativeForce
    damping: NonNegativeDamping = 0.0


class StvDamper(DamperNumbers):
    """Friction with a stick transition velocity [C] Eq. (6), and a dashpot in parallel.

    Attributes:
        friction_force: Friction while sliding [f_max].
        transition_velocity: Velocity from which on the friction is complete.
        damping: Dashpot in parallel [c].
    """

    law: Literal["stv"]
    friction_force: NonNegativeForce
    transition_velocity: PositiveVelocity
    damping: NonNegativeDamping = 0.0


class HavsinDamper(DamperNumbers):
    """Smoothed Coulomb friction [A] Eq. (2), and a dashpot in parallel.

    Attributes:
        friction_force: Friction while sliding [f_max].
        full_friction_velocity: Velocity from which on the friction is complete.
        damping: Dashpot in parallel [c].
    """

    law: Literal["havsin"]
    friction_force: NonNegativeForce
    full_friction_velocity: PositiveVelocity
    damping: NonNegativeDamping = 0.0


class MstvDamper(DamperNumbers):
    """Massless sponge with MSTV friction [C] Eq. (2), (3), (7).

    Attributes:
        friction_force: Friction while sliding [f_max].
        friction_damping: Growth of the friction with the velocity of the slider [c_m].
        regularisation_velocity: Small velocity that keeps the law finite at rest [epsilon].
        sponge_stiffness: Stiffness of the sponge [k1].
        sponge_damping: Damping of the sponge [c1].
        slider_damping: Air resistance of the slider [c2].
    """

    law: Literal["mstv"]
    friction_force: NonNegativeForce
    friction_damping: NonNegativeDamping = 0.0
    regularisation_velocity: PositiveVelocity = 1e-6
    sponge_stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)]
    sponge_damping: NonNegativeDamping
    slider_damping: NonNegativeDamping

    @model_validator(mode="after")
    def _slider_rate_is_finite(self) -> "MstvDamper":
        if self.sponge_damping + self.slider_damping + self.friction_damping <= 0.0:
            raise ValueError(
                "sponge_damping, slider_damping and friction_damping are all zero: a massless "
                "slider needs one"
            )
        return self


class StvSpongeDamper(DamperNumbers):
    """Massless sponge with STV friction [C] Eq. (2), (3), (6); Coulomb's (4) at velocity 0.

    Attributes:
        friction_force: Friction while sliding [f_max].
        transition_velocity: Velocity from which on the friction is complete.
        sponge_stiffness: Stiffness of the sponge [k1].
        sponge_damping: Damping of the sponge [c1].
        slider_damping: Air resistance of the slider [c2].
    """

    law: Literal["stv_sponge"]
    friction_force: NonNegativeForce
    transition_velocity: Annotated[u.Velocity, Field(ge=0.0)] = 0.0
    sponge_stiffness: Annotated[u.LinearStiffness, Field(ge=0.0)]
    sponge_damping: NonNegativeDamping
    slider_damping: NonNegativeDamping = 0.0

    @model_validator(mode="after")
    def _slider_rate_is_finite(self) -> "StvSpongeDamper":
        if self.sponge_damping + self.slider_damping <= 0.0:
            raise ValueError(
                "sponge_damping and slider_damping are both zero: a massless slider needs one"
            )
        return self


class FreeStrokeDamper(DamperNumbers):
    """Free-stroke damper [A] Eq. (2)-(6), massless sponge; its curve is zero in the free stroke.

    Attributes:
        friction_force: Friction while sliding [f_max].
        friction_damping: Growth of the friction with the velocity of the slider [c_m].
        regularisation_velocity: Small velocity that keeps the law finite at rest [epsilon].
        basic_friction_force: Friction of the tubes on each other, also in the free stroke.
        basic_full_friction_velocity: Velocity from which on it is complete.
        sponge: Force of the sponge over its deformation; zero in the free stroke.
    """

    law: Literal["free_stroke"]
    friction_force: NonNegativeForce
    friction_damping: Annotated[u.LinearDamping, Field(gt=0.0)]
    regularisation_velocity: PositiveVelocity = 1e-6
    basic_friction_force: NonNegativeForce
    basic_full_friction_velocity: PositiveVelocity
    sponge: ForceTable


@dataclass(frozen=True)
class DamperLaw:
    """A damper law and all that depends on it.

    Attributes:
        number: Number in packed arrays.
        parameters: Numbers of the law in a machine file; the order of its fields is the packed
            order.
        response: Law (rate, fields) that returns the tension, or (rate, deformation, fields) that
            returns tension and deformation rate of a sponge. [m/s, m -> N, m/s]
        equations: Where the papers have it.
        unknowns: Numbers that an identification searches, and where. It also searches each curve of
            the law; another number keeps its value unless the user gives it bounds.
        sponge_with_mass: Law (deformation, rate, slider_velocity, step, mass, fields) that takes a
            time step of a sponge with mass on the bench and returns tension and velocity of the
            slider at its end; None if the sponge is always massless.
        slider_friction: Law (slider_rate, deformation_rate, some fields) that returns the friction
            on the slider, for a figure; None for no figure.
    """

    number: int
    parameters: type[DamperNumbers]
    response: Any
    equations: str
    unknowns: Mapping[str, SearchRange]
    sponge_with_mass: Any = None
    slider_friction: Any = None

    def __post_init__(self) -> None:
        """Check that law functions and fields agree by name.

        Raises:
            ValueError: An argument is no field, or a field is no argument.
        """
        arguments = set(self.arguments(self.response)) - {"rate", "deformation"}
        odd = arguments ^ set(self.fields)
        odd |= set(self.unknowns) - set(self.fields)
        if odd:
            raise ValueError(
                f"damper law {self.name}: not in class and law: {', '.join(sorted(odd))}"
            )

    @staticmethod
    def arguments(function: Any) -> tuple[str, ...]:
        """Return the names of the arguments of a law function."""
        return tuple(inspect.signature(function.py_func).parameters)

    @property
    def name(self) -> str:
        """Name in files and on the command line."""
        return str(get_args(self.parameters.model_fields["law"].annotation)[0])

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the numbers and curves of the law, without those that all dampers have."""
        return tuple(
            name for name in self.parameters.model_fields if name not in DamperNumbers.model_fields
        )

    @property
    def curves(self) -> tuple[str, ...]:
        """Names of the fields that are curves."""
        fields = self.parameters.model_fields
        return tuple(name for name in self.fields if fields[name].annotation is not float)

    @property
    def has_sponge(self) -> bool:
        """Whether the law has a state, the deformation of its sponge."""
        return "deformation" in self.arguments(self.response)


def _registry(*laws: DamperLaw) -> dict[str, DamperLaw]:
    """Return the laws by name.

    Raises:
        ValueError: Two laws have the same name or number.
    """
    by_name = {law.name: law for law in laws}
    if len(by_name) < len(laws) or len({law.number for law in laws}) < len(laws):
        raise ValueError("two damper laws have the same name or number")
    return by_name


DAMPER_LAWS = _registry(
    DamperLaw(
        number=0,
        parameters=CoulombDamper,
        response=damper.coulomb_damper,
        equations="[C] (4)",
        unknowns={"friction_force": "force", "damping": "damping"},
    ),
    DamperLaw(
        number=1,
        parameters=StvDamper,
        response=damper.stv_damper,
        equations="[C] (6)",
        unknowns={"friction_force": "force", "transition_velocity": "speed", "damping": "damping"},
    ),
    DamperLaw(
        number=2,
        parameters=HavsinDamper,
        response=damper.havsin_damper,
        equations="[A] (2), (3)",
        unknowns={
            "friction_force": "force",
            "full_friction_velocity": "speed",
            "damping": "damping",
        },
    ),
    DamperLaw(
        number=3,
        parameters=MstvDamper,
        response=damper.mstv_damper,
        equations="[C] (2), (3), (7)",
        unknowns={
            "friction_force": "force",
            "sponge_stiffness": "stiffness",
            "sponge_damping": "damping",
            "slider_damping": "damping",
        },
        sponge_with_mass=damper.mstv_sponge_with_mass,
        slider_friction=friction.mstv_friction,
    ),
    DamperLaw(
        number=5,
        parameters=StvSpongeDamper,
        response=damper.stv_sponge_damper,
        equations="[C] (2), (3), (4), (6)",
        unknowns={
            "friction_force": "force",
            "transition_velocity": "speed",
            "sponge_stiffness": "stiffness",
            "sponge_damping": "damping",
            "slider_damping": "damping",
        },
    ),
    DamperLaw(
        number=4,
        parameters=FreeStrokeDamper,
        response=damper.free_stroke_damper,
        equations="[A] (2)-(6)",
        unknowns={
            "friction_force": "force",
            "friction_damping": "damping",
            "basic_friction_force": "force",
            "basic_full_friction_velocity": "speed",
        },
        sponge_with_mass=damper.free_stroke_sponge_with_mass,
    ),
)
"""All damper laws by name."""

if TYPE_CHECKING:
    DamperType: TypeAlias = DamperNumbers
else:
    DamperType = Annotated[
        functools.reduce(operator.or_, (law.parameters for law in DAMPER_LAWS.values())),
        Field(discriminator="law"),
    ]
"""Numbers of a damper in a file: the class of its law."""
