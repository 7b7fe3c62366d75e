"""Unknowns of a component: their units, bounds from what was measured, and the user's in place of those."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters.units import Unit
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.fitting import Unknown

FORCE, TORQUE = Unit("N", "N"), Unit("N*m", "N*mm")
STIFFNESS, DAMPING, SPEED = Unit("N/m", "N/mm"), Unit("N*s/m", "N*s/mm"), Unit("m/s", "mm/s")
ROTATIONAL_STIFFNESS, ROTATIONAL_DAMPING = (
    Unit("N*m/rad", "N*mm/rad"),
    Unit("N*m*s/rad", "N*mm*s/rad"),
)
RATE = Unit("rad/s", "rad/s")

ALONG = {"force": FORCE, "stiffness": STIFFNESS, "damping": DAMPING, "speed": SPEED}
ABOUT = {
    "force": TORQUE,
    "stiffness": ROTATIONAL_STIFFNESS,
    "damping": ROTATIONAL_DAMPING,
    "speed": RATE,
}
"""Units of the kinds of numbers of what moves along an axis, and of what turns about one."""

DASHPOT = 1e-4
"""Lowest damping that is searched, in the highest: from there on it does nothing that can be measured."""


@dataclass(frozen=True)
class Scale:
    """Orders of magnitude of measured loops: largest force, steepest loop, speeds, strokes."""

    force: float
    stiffness: float
    damping: float
    slowest: float
    fastest: float
    stroke: float

    def bounds(self, kind: str) -> tuple[float, float, bool]:
        """Lower and upper default bound of a kind of number, and whether its order of magnitude is unknown."""
        return {
            "force": (0.0, 1.5 * self.force, False),
            "stiffness": (0.1 * self.stiffness, 10.0 * self.stiffness, True),
            "damping": (DASHPOT * self.damping, self.damping, True),
            "speed": (1e-3 * self.fastest, 2.0 * self.fastest, True),
        }[kind]


def scale_of(motions: Sequence[MeasuredMotion], arm: float = 0.0) -> Scale:
    """Scale of measured loops; with the arm of a jig, of the angles and moments at its axis. [m]"""
    force, stiffness, damping, speeds, strokes = [], [], [], [], []
    for measured in motions:
        size = 0.5 * float(np.ptp(measured.loop.force)) * (arm or 1.0)
        stroke = (
            float(np.arcsin(measured.motion.amplitude / arm)) if arm else measured.motion.amplitude
        )
        speed = stroke * measured.motion.angular_frequency
        force.append(size)
        stiffness.append(size / stroke)
        damping.append(size / speed)
        speeds.append(speed)
        strokes.append(stroke)
    return Scale(max(force), max(stiffness), max(damping), min(speeds), max(speeds), max(strokes))


def unknowns_of(
    kinds: Mapping[str, str],
    units: Mapping[str, Unit],
    scale: Scale,
    bounds: Mapping[str, tuple[float, float]] | None,
    fixed: Mapping[str, float] | None,
) -> tuple[Unknown, ...]:
    """Unknowns of fields of some kind, less those that are fixed."""
    found = []
    for name, kind in kinds.items():
        if name in (fixed or {}):
            continue
        lower, upper, logarithmic = scale.bounds(kind)
        if name in (bounds or {}):
            lower, upper = (bounds or {})[name]
            logarithmic = lower > 0.0 and upper > 30.0 * lower
        found.append(Unknown(name, lower, upper, units[kind], logarithmic=logarithmic))
    return tuple(found)


def with_bounds(
    unknowns: tuple[Unknown, ...], bounds: Mapping[str, tuple[float, float]] | None
) -> tuple[Unknown, ...]:
    """The same unknowns between the user's bounds where there are some."""
    given = bounds or {}
    return tuple(Unknown(u.name, *given.get(u.name, (u.lower, u.upper)), u.unit) for u in unknowns)


def check_names(
    known: list[str],
    bounds: Mapping[str, tuple[float, float]] | None,
    fixed: Mapping[str, float] | None,
) -> None:
    """Refuses names that no field has, and what is both bounded and fixed."""
    for option, given in (("--bounds", bounds), ("--fix", fixed)):
        for name in given or {}:
            if name not in known:
                raise input_error(
                    f"unknown number '{name}'{nearest_names(name, known)}", where=option
                )
    for name in fixed or {}:
        if name in (bounds or {}):
            raise input_error(f"'{name}' has bounds and is fixed", where="--fix")
