"""What is clamped into the bench: a component, one axis of it, and the harmonic motion it is given."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from wm_drake.elements.bushing import packed_bushing_law
from wm_drake.elements.friction_damper import has_sponge, packed_damper_law
from wm_drake.errors import input_error
from wm_drake.laws.damper import MSTV
from wm_drake.parameters import DamperType
from wm_drake.parameters.elements import BushingType
from wm_drake.parameters.types import FloatArray

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
        """Refuses what is no motion."""
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
        packed: Law number and parameters, as `packed_damper_law` gives them.
        sponge_mass: Mass of the sponge, for the law MSTV only; 0 as in the machine. [kg]
    """

    packed: FloatArray
    sponge_mass: float = 0.0

    def __post_init__(self) -> None:
        """Refuses a mass where the law has no sponge to carry it."""
        if self.sponge_mass < 0.0:
            raise input_error(f"is {self.sponge_mass:g} kg; allowed is >= 0", key="sponge_mass")
        if self.sponge_mass > 0.0 and int(self.packed[0]) != MSTV:
            raise input_error(
                "only the law mstv has a sponge that can have a mass on the bench",
                key="sponge_mass",
            )

    @property
    def rotates(self) -> bool:
        """Whether it is turned, not pushed."""
        return False

    @property
    def state_size(self) -> int:
        """Number of states: none, deformation of the sponge, or position and velocity of a sponge with mass."""
        return 2 if self.sponge_mass > 0.0 else int(has_sponge(self.packed))


@dataclass(frozen=True, eq=False)
class BushingBench:
    """One axis of a six-component bushing, the others held.

    Attributes:
        packed: Parameters, as `packed_bushing_law` gives them.
        axis: One of `AXES`.
        arm: Radius of the jig through which a rotation is driven; 0 turns it directly. [m]
    """

    packed: FloatArray
    axis: str
    arm: float = 0.0

    def __post_init__(self) -> None:
        """Refuses axes that there are not, and arms that turn nothing."""
        if self.axis not in AXES:
            raise input_error(f"no axis '{self.axis}'; allowed are {', '.join(AXES)}", key="axis")
        if self.arm < 0.0 or (self.arm > 0.0 and not self.axis.startswith("about")):
            raise input_error("an arm drives a rotation, with a radius > 0", key="arm")

    @property
    def rotates(self) -> bool:
        """Whether its motion is an angle and its force a moment; with an arm they are displacement and force of the arm."""
        return self.axis.startswith("about") and self.arm == 0.0

    @property
    def state_size(self) -> int:
        """Number of states: none."""
        return 0


Bench: TypeAlias = DamperBench | BushingBench


def damper_bench(damper: DamperType, sponge_mass: float = 0.0) -> DamperBench:
    """A damper of a machine file on the bench; its end bushings do not matter along its line."""
    return DamperBench(packed_damper_law(damper), sponge_mass)


def bushing_bench(bushing: BushingType, axis: str, arm: float = 0.0) -> BushingBench:
    """A bushing or gasket of a machine file on the bench."""
    return BushingBench(packed_bushing_law(bushing), axis, arm)
