"""Names and units of a loop for reading: displacement and force, or angle and moment."""

import math
from dataclasses import dataclass

from wm_drake.report.formatting import MM_PER_M

DEG_PER_RAD = 180.0 / math.pi


@dataclass(frozen=True)
class LoopUnits:
    """Names and units of a loop.

    Attributes:
        motion, unit, factor: Name of the motion, its unit, and the factor from SI to it.
        rate: Name of its rate.
        force, force_unit: Name and unit of the force.
    """

    motion: str
    unit: str
    factor: float
    rate: str
    force: str
    force_unit: str

    @property
    def force_label(self) -> str:
        """Label of the axis of the force."""
        return f"{self.force}, {self.force_unit}"

    @property
    def in_heads(self) -> str:
        """Unit of the force in the names of columns of files."""
        return self.force_unit.replace(" ", "")

    def label(self, over: str) -> str:
        """Return the label of an abscissa: displacement or velocity, also of a rotation."""
        is_motion = over == "displacement"
        return f"{self.motion}, {self.unit}" if is_motion else f"{self.rate}, {self.unit}/s"

    def text(self, motion: float) -> str:
        """Return a motion in SI with its unit."""
        return f"{self.factor * motion:.3g} {self.unit}"


LINEAR = LoopUnits("displacement", "mm", MM_PER_M, "velocity", "force", "N")
ANGULAR = LoopUnits("angle", "deg", DEG_PER_RAD, "rate", "moment", "N m")


def units_of(rotates: bool) -> LoopUnits:
    """Return the units of a loop; `rotates`: whether its motion is an angle."""
    return ANGULAR if rotates else LINEAR
