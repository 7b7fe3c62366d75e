"""What of a component is unknown, between which bounds, and how its parameters follow from a point.

A model knows the fields of one law. Default bounds come from the loops themselves: no force can exceed what was measured by
much, no stiffness the steepest loop by orders of magnitude. They are starts of a search, and the user's to replace.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters import DamperType, ForceTable, TorqueTable
from wm_drake.parameters.elements import BushingType, FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.rigs import Bench, bushing_bench, damper_bench
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.identification import Unknown

FORCE, TORQUE = Unit("N", "N"), Unit("N*m", "N*mm")
STIFFNESS, DAMPING, SPEED = Unit("N/m", "N/mm"), Unit("N*s/m", "N*s/mm"), Unit("m/s", "mm/s")
ROTATIONAL_STIFFNESS, ROTATIONAL_DAMPING = Unit("N*m/rad", "N*mm/rad"), Unit("N*m*s/rad", "N*mm*s/rad")
RATE = Unit("rad/s", "rad/s")

KNOTS = 5
"""Of a table on each side of zero."""

DAMPER_LAWS: dict[str, dict[str, str]] = {
    "coulomb": {"friction_force": "force", "damping": "damping"},
    "stv": {"friction_force": "force", "transition_velocity": "speed", "damping": "damping"},
    "havsin": {"friction_force": "force", "full_friction_velocity": "speed", "damping": "damping"},
    "mstv": {
        "friction_force": "force",
        "sponge_stiffness": "stiffness",
        "sponge_damping": "damping",
        "slider_damping": "damping",
    },
    "stv_sponge": {
        "friction_force": "force",
        "transition_velocity": "speed",
        "sponge_stiffness": "stiffness",
        "sponge_damping": "damping",
        "slider_damping": "damping",
    },
    "free_stroke": {
        "friction_force": "force",
        "friction_damping": "damping",
        "basic_friction_force": "force",
        "basic_full_friction_velocity": "speed",
    },
}
"""What is unknown of each damper law, and of what kind; of free_stroke the curve of the sponge too. What is not listed keeps
its value (of MSTV the growth of friction and the regularisation), unless the user gives it bounds."""

OPTIONAL = {"mstv": {"friction_damping": "damping"}}
"""What may be unknown if the user asks."""

BUSHING_LAWS = ("voigt", "table", "voigt_havsin")
"""Stiffness and damping; monotone table and damping; for rotations, stiffness, damping and HAVSIN friction."""

DASHPOT = 1e-4
"""Lowest damping that is searched, in the highest: from there on it does nothing that can be measured."""


@dataclass(frozen=True)
class ComponentModel:
    """A law of a component whose numbers are unknown.

    Attributes:
        law: Its name.
        unknowns: What is searched.
        fields: The component's fields that a point (p,) determines, in SI; a table among them as a mapping.
        bench: The component on the bench at a point.
    """

    law: str
    unknowns: tuple[Unknown, ...]
    fields: Callable[[FloatArray], dict[str, Any]]
    bench: Callable[[FloatArray], Bench]


@dataclass(frozen=True)
class _Scale:
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


def damper_model(
    law: str,
    motions: Sequence[MeasuredMotion],
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    knots: int = KNOTS,
) -> ComponentModel:
    """A damper with unknown numbers.

    Args:
        law: As in a machine file.
        motions: What was measured, for default bounds and for the stroke that a table must cover.
        bounds: Of unknowns, by field, in place of the default ones. [SI]
        fixed: Values that are known, by field. [SI]
        knots: Points of the sponge's curve beyond zero, for the law free_stroke.

    Raises:
        InputError: no such law, or no such field.
    """
    if law not in DAMPER_LAWS:
        raise input_error(f"no law '{law}' of a damper{nearest_names(law, DAMPER_LAWS)}", where="--law")
    kinds, scale = DAMPER_LAWS[law] | OPTIONAL.get(law, {}), _scale(motions)
    kept = ["regularisation_velocity"] if law in ("mstv", "free_stroke") else []
    units = {"force": FORCE, "stiffness": STIFFNESS, "damping": DAMPING, "speed": SPEED}
    searched = [name for name in kinds if name in DAMPER_LAWS[law] or name in (bounds or {})]
    unknowns = _unknowns({name: kinds[name] for name in searched}, units, scale, bounds, fixed)
    constants = dict(fixed or {})
    table = _OddTable("sponge", scale, knots) if law == "free_stroke" else None
    steps = _bounded(table.unknowns, bounds) if table else ()
    _check_names([*kinds, *kept, *(u.name for u in steps)], bounds, fixed)

    def fields(point: FloatArray) -> dict[str, Any]:
        named = {u.name: float(value) for u, value in zip(unknowns, point, strict=False)}
        curve = {"sponge": table.curve(point[len(unknowns) :])} if table else {}
        return {"law": law, **constants, **named, **curve}

    return ComponentModel(law, (*unknowns, *steps), fields, lambda point: damper_bench(_damper(fields(point))))


def _damper(fields: dict[str, Any]) -> DamperType:
    try:
        return TypeAdapter(DamperType).validate_python(fields)
    except ValidationError as error:
        detail = error.errors()[0]
        message = str(detail.get("ctx", {}).get("error", detail["msg"]))
        raise input_error(message, where="--fix", key=".".join(map(str, detail["loc"][1:]))) from None


def bushing_model(
    law: str,
    motions: Sequence[MeasuredMotion],
    base: BushingType,
    axis: str,
    *,
    arm: float = 0.0,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    knots: int = KNOTS,
) -> ComponentModel:
    """One axis of a bushing with unknown numbers.

    Args:
        law: One of `BUSHING_LAWS`.
        motions, bounds, fixed, knots: As for `damper_model`.
        base: The bushing whose other axes stay as they are.
        axis: One of `wm_drake.rigs.AXES`.
        arm: Of the jig, where displacements and forces of its end were measured. [m]

    Raises:
        InputError: no such law (or not along an axis), or no such field.
    """
    if law not in BUSHING_LAWS:
        raise input_error(f"no law '{law}' of a bushing{nearest_names(law, BUSHING_LAWS)}", where="--law")
    about = axis.startswith("about")
    if law == "voigt_havsin" and not about:
        raise input_error("voigt_havsin is a law about an axis; along one, take voigt or table", where="--law")
    prefix, letter = ("rotational_" if about else ""), axis[-1]
    scale = _scale(motions, arm)
    stiffness, damping = f"{prefix}stiffness_{letter}", f"{prefix}damping_{letter}"
    kinds = {} if law == "table" else {stiffness: "stiffness"}
    kinds[damping] = "damping"
    if law == "voigt_havsin":
        kinds |= {f"friction_torque_{letter}": "force", f"full_friction_rate_{letter}": "speed"}
    units = {
        "force": TORQUE if about else FORCE,
        "stiffness": ROTATIONAL_STIFFNESS if about else STIFFNESS,
        "damping": ROTATIONAL_DAMPING if about else DAMPING,
        "speed": RATE if about else SPEED,
    }
    unknowns = _unknowns(kinds, units, scale, bounds, fixed)
    table = _TwoSidedTable(stiffness, scale, knots, about) if law == "table" else None
    steps = _bounded(table.unknowns, bounds) if table else ()
    _check_names([*kinds, *(u.name for u in steps)], bounds, fixed)
    constants = dict(fixed or {})

    def fields(point: FloatArray) -> dict[str, Any]:
        named = {u.name: float(value) for u, value in zip(unknowns, point, strict=False)}
        curve = {stiffness: table.curve(point[len(unknowns) :])} if table else {}
        return {**constants, **named, **curve}

    def bench(point: FloatArray) -> Bench:
        found = fields(point)
        kind = TorqueTable if about else ForceTable
        values = {name: kind(**value) if isinstance(value, dict) else value for name, value in found.items()}
        return bushing_bench(base.model_copy(update=values), axis, arm)

    return ComponentModel(law, (*unknowns, *steps), fields, bench)


class _OddTable:
    """A curve through zero, the same to either side: its rises from knot to knot are the unknowns, so it never falls."""

    def __init__(self, name: str, scale: _Scale, knots: int) -> None:
        self.displacement = scale.stroke * np.arange(1, knots + 1) / knots
        self.unknowns = tuple(Unknown(f"{name}.rise_{k + 1}", 0.0, scale.force, FORCE) for k in range(knots))

    def curve(self, rises: FloatArray) -> dict[str, tuple[float, ...]]:
        force = np.cumsum(rises)
        return {
            "displacement": (*(-self.displacement[::-1]), 0.0, *self.displacement),
            "force": (*(-force[::-1]), 0.0, *force),
        }


class _TwoSidedTable:
    """A curve through zero with its own rises on each side."""

    def __init__(self, name: str, scale: _Scale, knots: int, about: bool) -> None:
        self.position = scale.stroke * np.arange(1, knots + 1) / knots
        self._names = ("angle", "torque") if about else ("displacement", "force")
        unit = TORQUE if about else FORCE
        self.unknowns = tuple(
            Unknown(f"{name}.rise_{side}{k + 1}", 0.0, scale.force, unit) for side in ("plus_", "minus_") for k in range(knots)
        )

    def curve(self, rises: FloatArray) -> dict[str, tuple[float, ...]]:
        plus, minus = (np.cumsum(part) for part in np.split(rises, 2))
        ends = ((*(-self.position[::-1]), 0.0, *self.position), (*(-minus[::-1]), 0.0, *plus))
        return dict(zip(self._names, ends, strict=True))


def _scale(motions: Sequence[MeasuredMotion], arm: float = 0.0) -> _Scale:
    force, stiffness, damping, speeds, strokes = [], [], [], [], []
    for measured in motions:
        size = 0.5 * float(np.ptp(measured.loop.force)) * (arm or 1.0)
        stroke = float(np.arcsin(measured.motion.amplitude / arm)) if arm else measured.motion.amplitude
        speed = stroke * measured.motion.angular_frequency
        force.append(size)
        stiffness.append(size / stroke)
        damping.append(size / speed)
        speeds.append(speed)
        strokes.append(stroke)
    return _Scale(max(force), max(stiffness), max(damping), min(speeds), max(speeds), max(strokes))


def _unknowns(
    kinds: Mapping[str, str],
    units: Mapping[str, Unit],
    scale: _Scale,
    bounds: Mapping[str, tuple[float, float]] | None,
    fixed: Mapping[str, float] | None,
) -> tuple[Unknown, ...]:
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


def _bounded(unknowns: tuple[Unknown, ...], bounds: Mapping[str, tuple[float, float]] | None) -> tuple[Unknown, ...]:
    given = bounds or {}
    return tuple(Unknown(u.name, *given.get(u.name, (u.lower, u.upper)), u.unit) for u in unknowns)


def _check_names(known: list[str], bounds: Mapping[str, tuple[float, float]] | None, fixed: Mapping[str, float] | None) -> None:
    for option, given in (("--bounds", bounds), ("--fix", fixed)):
        for name in given or {}:
            if name not in known:
                raise input_error(f"unknown number '{name}'{nearest_names(name, known)}", where=option)
    for name in fixed or {}:
        if name in (bounds or {}):
            raise input_error(f"'{name}' has bounds and is fixed", where="--fix")


def units_of_fields() -> dict[str, Unit]:
    """Unit of every number of a component that can be unknown or fixed."""
    kinds = {"force": FORCE, "stiffness": STIFFNESS, "damping": DAMPING, "speed": SPEED}
    found = {name: kinds[kind] for law in (*DAMPER_LAWS.values(), *OPTIONAL.values()) for name, kind in law.items()}
    found["regularisation_velocity"] = SPEED
    for letter in "xyz":
        found |= {f"stiffness_{letter}": STIFFNESS, f"damping_{letter}": DAMPING}
        found |= {f"rotational_stiffness_{letter}": ROTATIONAL_STIFFNESS, f"rotational_damping_{letter}": ROTATIONAL_DAMPING}
        found |= {f"friction_torque_{letter}": TORQUE, f"full_friction_rate_{letter}": RATE}
    return found


def unit_of_field(name: str) -> Unit | None:
    """Unit of such a number, or of a rise of a table; None if there is no such."""
    field, _, rise = name.partition(".")
    if rise.startswith("rise_"):
        return TORQUE if field.startswith("rotational") else FORCE
    return units_of_fields().get(name)
