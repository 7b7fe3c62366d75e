"""Unknowns of a component: their units, and bounds from the measured loops or from the user."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import check_known, input_error
from wm_drake.parameters.damper_laws import Search
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.fitting.problem import Unknown

FORCE, TORQUE = Unit("N", "N"), Unit("N*m", "N*mm")
STIFFNESS, DAMPING, SPEED = Unit("N/m", "N/mm"), Unit("N*s/m", "N*s/mm"), Unit("m/s", "mm/s")
ROTATIONAL_STIFFNESS, ROTATIONAL_DAMPING = (
    Unit("N*m/rad", "N*mm/rad"),
    Unit("N*m*s/rad", "N*mm*s/rad"),
)
RATE = Unit("rad/s", "rad/s")
LENGTH, ANGLE = Unit("m", "mm"), Unit("rad", "deg")

ALONG = {
    "force": FORCE,
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "speed": SPEED,
    "length": LENGTH,
    "branch": STIFFNESS,
    "dashpot": DAMPING,
}
ABOUT = {
    "force": TORQUE,
    "stiffness": ROTATIONAL_STIFFNESS,
    "damping": ROTATIONAL_DAMPING,
    "speed": RATE,
    "length": ANGLE,
    "branch": ROTATIONAL_STIFFNESS,
    "dashpot": ROTATIONAL_DAMPING,
}
"""Units by kind of a number, along an axis and about one."""

DASHPOT = 1e-4
"""Lowest damping that is searched, relative to the highest: a lower one has no effect that can be
measured."""
MAGNITUDES = 30.0
"""Quotient of two bounds from which on the order of magnitude of a number counts as unknown."""


@dataclass(frozen=True)
class Scale:
    """Orders of magnitude of measured loops: largest force, steepest loop, speeds, strokes."""

    force: float
    stiffness: float
    damping: float
    fastest: float
    stroke: float

    def bounds(self, search: Search) -> tuple[float, float, bool]:
        """Return lower and upper default bound, and whether the order of magnitude is unknown.

        Args:
            search: Kind of the number, or its bounds. [SI]
        """
        if isinstance(search, tuple):
            return *search, search[0] > 0.0 and search[1] > MAGNITUDES * search[0]
        return {
            "force": (0.0, 1.5 * self.force, False),
            "stiffness": (0.1 * self.stiffness, 10.0 * self.stiffness, True),
            "damping": (DASHPOT * self.damping, self.damping, True),
            "speed": (1e-3 * self.fastest, 2.0 * self.fastest, True),
            "length": (1e-3 * self.stroke, 3.0 * self.stroke, True),
            "branch": (1e-3 * self.stiffness, 10.0 * self.stiffness, True),
            "dashpot": (1e-3 * self.damping, 30.0 * self.damping, True),
        }[search]


def scale_of(motions: Sequence[MeasuredMotion], arm: float = 0.0) -> Scale:
    """Return the scale of measured loops; with the arm of a jig [m], of angles and moments."""
    force, stiffness, damping, speeds, strokes = [], [], [], [], []
    for measured in motions:
        size = 0.5 * float(np.ptp(measured.loop.force)) * (arm or 1.0)
        stroke = float(np.arcsin(min(measured.stroke / arm, 1.0))) if arm else measured.stroke
        speed = measured.fastest * stroke / measured.stroke
        force.append(size)
        stiffness.append(size / stroke)
        damping.append(size / speed)
        speeds.append(speed)
        strokes.append(stroke)
    return Scale(max(force), max(stiffness), max(damping), max(speeds), max(strokes))


def unknowns_of(
    searches: Mapping[str, Search],
    units: Mapping[str, Unit],
    scale: Scale,
    bounds: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
) -> tuple[Unknown, ...]:
    """Return the unknowns of some fields.

    Args:
        searches: Kind or default bounds of each field.
        units: Unit of each field.
        scale: Scale of the measured loops.
        bounds: Bounds that the user gives in place of the default ones. [SI]
        fixed: Fields that are no unknowns. [SI]
    """
    unknowns = []
    for name, search in searches.items():
        if name in fixed:
            continue
        lower, upper, logarithmic = scale.bounds(bounds.get(name, search))
        unknowns.append(Unknown(name, lower, upper, units[name], logarithmic=logarithmic))
    return tuple(unknowns)


def check_names(
    known: list[str], bounds: Mapping[str, tuple[float, float]], fixed: Mapping[str, float]
) -> None:
    """Check names of fields.

    Raises:
        InputError: No field has the name, or it has bounds and is fixed.
    """
    for option, given in (("--bounds", bounds), ("--fix", fixed)):
        for name in given:
            check_known(name, known, f"unknown number '{name}'", where=option)
    for name in fixed:
        if name in bounds:
            raise input_error(f"'{name}' has bounds and is fixed", where="--fix")


class MonotoneCurve:
    """Curve of force over displacement through zero that never falls.

    The rises between its knots are the unknowns: of each side, or the same of both sides.
    """

    def __init__(
        self, name: str, scale: Scale, knots: int, *, about: bool = False, is_odd: bool = False
    ) -> None:
        """Space the knots of each side equally up to the stroke.

        Args:
            name: Field of the component.
            scale: Scale of the measured loops.
            knots: Knots of each side.
            about: Whether it is a curve of torque over angle.
            is_odd: Whether both sides have the same rises.
        """
        self.name = name
        self.position = scale.stroke * np.arange(1, knots + 1) / knots
        self._names = ("angle", "torque") if about else ("displacement", "force")
        unit = TORQUE if about else FORCE
        self.unknowns = tuple(
            Unknown(f"{name}.rise_{side}{k + 1}", 0.0, scale.force, unit)
            for side in (("",) if is_odd else ("plus_", "minus_"))
            for k in range(knots)
        )

    def curve(self, rises: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return the table of these rises, as a mapping."""
        sides = np.cumsum(np.reshape(rises, (-1, len(self.position))), axis=1)
        plus, minus = sides[0], sides[-1]
        ends = ((*(-self.position[::-1]), 0.0, *self.position), (*(-minus[::-1]), 0.0, *plus))
        return dict(zip(self._names, ends, strict=True))
