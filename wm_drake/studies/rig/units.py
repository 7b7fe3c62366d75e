"""Quantities of a loop: displacement and force, or angle and moment."""

from dataclasses import dataclass

from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity


@dataclass(frozen=True)
class LoopUnits:
    """Quantities of a loop along a line or about it, with their names and units for reading.

    Attributes:
        displacement, velocity: Motion and its rate.
        load: Force or moment.
        damping, stiffness: Derived from the loop.
    """

    displacement: Quantity
    velocity: Quantity
    load: Quantity
    damping: Quantity
    stiffness: Quantity

    @property
    def unit(self) -> str:
        """Return the unit of the motion."""
        return self.displacement.unit.label

    @property
    def factor(self) -> float:
        """Factor from SI to the unit of the motion."""
        return self.displacement.unit.from_si(1.0)

    @property
    def force(self) -> str:
        """Return the name of the force."""
        return self.load.words

    @property
    def force_unit(self) -> str:
        """Return the unit of the force."""
        return self.load.unit.label

    @property
    def force_label(self) -> str:
        """Label of the axis of the force."""
        return self.load.label

    @property
    def in_heads(self) -> str:
        """Return the unit of the force in the names of columns of files."""
        return self.load.suffix.removeprefix("_")

    def over(self, abscissa: str) -> Quantity:
        """Return displacement or velocity, by this name also of a rotation."""
        return self.displacement if abscissa == "displacement" else self.velocity

    def label(self, abscissa: str) -> str:
        """Return the label of an abscissa: displacement or velocity, also of a rotation."""
        return self.over(abscissa).label

    def text(self, motion: float) -> str:
        """Return a motion in SI with its unit."""
        return self.displacement.text(motion)


LINEAR = LoopUnits(
    Quantity("displacement", Unit("m", "mm"), form="{:.3g}".format),
    Quantity("velocity", Unit("m/s", "mm/s"), form="{:.3g}".format),
    Quantity("force", Unit("N", "N"), 2),
    Quantity("equivalent damping", Unit("N*s/m", "N*s/mm"), 3),
    Quantity("dynamic stiffness", Unit("N/m", "N/mm"), 2),
)
ANGULAR = LoopUnits(
    Quantity("angle", Unit("rad", "deg"), form="{:.3g}".format),
    Quantity("rate", Unit("rad/s", "deg/s"), form="{:.3g}".format),
    Quantity("moment", Unit("N*m", "N*m"), 2),
    Quantity("equivalent damping", Unit("N*m*s/rad", "N*m*s/rad"), 3),
    Quantity("dynamic stiffness", Unit("N*m/rad", "N*m/rad"), 2),
)


def units_of(rotates: bool) -> LoopUnits:
    """Return the quantities of a loop; `rotates`: whether its motion is an angle."""
    return ANGULAR if rotates else LINEAR
