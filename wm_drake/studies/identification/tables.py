"""Curves of force over displacement that never fall: the rises between knots are the unknowns."""

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting import Unknown
from wm_drake.studies.identification.scales import FORCE, TORQUE, Scale


class OddTable:
    """Curve through zero with the same rises to either side."""

    def __init__(self, name: str, scale: Scale, knots: int) -> None:
        """Space the knots of each side equally up to the stroke."""
        self.name = name
        self.displacement = scale.stroke * np.arange(1, knots + 1) / knots
        self.unknowns = tuple(
            Unknown(f"{name}.rise_{k + 1}", 0.0, scale.force, FORCE) for k in range(knots)
        )

    def curve(self, rises: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return the table of these rises, as a mapping."""
        force = np.cumsum(rises)
        return {
            "displacement": (*(-self.displacement[::-1]), 0.0, *self.displacement),
            "force": (*(-force[::-1]), 0.0, *force),
        }


class TwoSidedTable:
    """Curve through zero with its own rises on each side."""

    def __init__(self, name: str, scale: Scale, knots: int, about: bool) -> None:
        """Space the knots of each side equally up to the stroke.

        Args:
            name: Field of the component.
            scale: Scale of the measured loops.
            knots: Knots of each side.
            about: Whether it is a curve of torque over angle.
        """
        self.name = name
        self.position = scale.stroke * np.arange(1, knots + 1) / knots
        self._names = ("angle", "torque") if about else ("displacement", "force")
        unit = TORQUE if about else FORCE
        self.unknowns = tuple(
            Unknown(f"{name}.rise_{side}{k + 1}", 0.0, scale.force, unit)
            for side in ("plus_", "minus_")
            for k in range(knots)
        )

    def curve(self, rises: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return the table of these rises, as a mapping."""
        plus, minus = (np.cumsum(part) for part in np.split(rises, 2))
        ends = ((*(-self.position[::-1]), 0.0, *self.position), (*(-minus[::-1]), 0.0, *plus))
        return dict(zip(self._names, ends, strict=True))
