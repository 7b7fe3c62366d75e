"""Component on the bench, the axis that is driven, and its harmonic motion."""

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from wm_drake.elements.bushing import packed_bushing_law
from wm_drake.elements.damper_law import law_of, packed_damper_law
from wm_drake.errors import input_error
from wm_drake.parameters.damper_laws import DAMPER_LAWS, DamperNumbers
from wm_drake.parameters.elements import BushingType
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.rubber import axis_branches

AXES = ("x", "y", "z", "about_x", "about_y", "about_z")
"""Axes of a bushing, in the order of its law: along, then about."""


@dataclass(frozen=True)
class Harmonic:
    """Motion of the bench, d(t) = A sin(2 pi f t); [A] section 2.1, [C] Eq. (1).

    Attributes:
        frequency: f, > 0. [Hz]
        amplitude: A, > 0: a displacement, also of a jig arm, or an angle. [m or rad]
    """

    frequency: float
    amplitude: float

    def __post_init__(self) -> None:
        """Check that it is a motion.

        Raises:
            InputError: Frequency or amplitude is not > 0.
        """
        for name in ("frequency", "amplitude"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise input_error(f"is {value:g}; allowed is > 0", key=name)

    @property
    def angular_frequency(self) -> float:
        """2 pi f. [rad/s]"""
        return 2.0 * np.pi * self.frequency


@dataclass(frozen=True, eq=False)
class DamperBench:
    """A friction damper along its line: one end held, the other driven.

    Attributes:
        packed: Law number and parameters, from `packed_damper_law`.
        sponge_mass: Mass of the sponge, for a law that has one on the bench; 0 as in the machine.
            [kg]
        driven_mass: Mass that moves with the driven end: the jig M of [C] Eq. (2) and the outer
            tube m_o of [A] Eq. (6). Its inertia is part of the force. [kg]
    """

    packed: FloatArray
    sponge_mass: float = 0.0
    driven_mass: float = 0.0

    def __post_init__(self) -> None:
        """Check the mass.

        Raises:
            InputError: It is < 0, or the law has no sponge that can have a mass.
        """
        for name in ("sponge_mass", "driven_mass"):
            if not 0.0 <= (value := getattr(self, name)) < np.inf:
                raise input_error(f"is {value:g} kg; allowed is >= 0", key=name)
        if self.sponge_mass > 0.0 and law_of(self.packed).sponge_with_mass is None:
            names = [law.name for law in DAMPER_LAWS.values() if law.sponge_with_mass is not None]
            raise input_error(
                f"only the law {' or '.join(names)} has a sponge that can have a mass on the bench",
                key="sponge_mass",
            )

    @property
    def rotates(self) -> bool:
        """Whether its motion is an angle and its force a moment."""
        return False

    @property
    def state_size(self) -> int:
        """Number of states: 0, 1 (deformation of the sponge) or 2 (sponge with mass)."""
        return 2 if self.sponge_mass > 0.0 else int(law_of(self.packed).has_sponge)


@dataclass(frozen=True, eq=False)
class BushingBench:
    """One axis of a six-component bushing, the others held.

    Attributes:
        packed: Parameters, from `packed_bushing_law`.
        axis: One of `AXES`.
        arm: Radius of the jig through which a rotation is driven; 0 turns it directly. [m]
        branches: Numbers of the branches of rubber of the axis (`axis_branches`); None without.
    """

    packed: FloatArray
    axis: str
    arm: float = 0.0
    branches: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check axis and arm.

        Raises:
            InputError: There is no such axis, or the arm turns nothing.
        """
        if self.axis not in AXES:
            raise input_error(f"no axis '{self.axis}'; allowed are {', '.join(AXES)}", key="axis")
        if self.arm < 0.0 or (self.arm > 0.0 and not self.axis.startswith("about")):
            raise input_error("an arm drives a rotation, with a radius > 0", key="arm")

    @property
    def rotates(self) -> bool:
        """Whether motion and force are angle and moment; through an arm they are not."""
        return self.axis.startswith("about") and self.arm == 0.0

    @property
    def state_size(self) -> int:
        """Number of states: none, or the stretches of friction and Maxwell element."""
        return 0 if self.branches is None else 2


Bench: TypeAlias = DamperBench | BushingBench


def damper_bench(
    damper: DamperNumbers, sponge_mass: float = 0.0, driven_mass: float = 0.0
) -> DamperBench:
    """Return the bench of a damper of a machine file; its end bushings have no effect there."""
    return DamperBench(packed_damper_law(damper), sponge_mass, driven_mass)


def bushing_bench(bushing: BushingType, axis: str, arm: float = 0.0) -> BushingBench:
    """Return the bench of a bushing or gasket of a machine file."""
    bench = BushingBench(packed_bushing_law(bushing), axis, arm)  # checks the axis
    return replace(bench, branches=axis_branches(bushing, axis))
