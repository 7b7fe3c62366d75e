"""Models of components: unknown numbers, their bounds, and how parameters follow from a point.

Default bounds come from the loops: no force can exceed what was measured by much, no stiffness the
steepest loop by orders of magnitude. They are where a search begins; the user may replace them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from wm_drake.errors import check_known, input_error
from wm_drake.parameters import DAMPER_LAWS, DamperType, ForceTable, TorqueTable
from wm_drake.parameters.damper_laws import DamperLaw, DamperNumbers, Kind, Search
from wm_drake.parameters.elements import BushingType, RubberBushingType
from wm_drake.parameters.keys import unit_of
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.rubber import DAHL_FIELDS, MAXWELL_FIELDS
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.rigs import AXES, Bench, bushing_bench, damper_bench
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion
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


KNOTS = 5
"""Knots of a table on each side of zero."""

BUSHING_LAWS = {
    "voigt": (0, 1),
    "table": (1,),
    "voigt_havsin": (0, 1, 2, 3),
    "voigt_dahl": (0, 1, 4, 5),
    "voigt_maxwell": (0, 1, 6, 7),
    "rubber": (0, 1, 4, 5, 6, 7),
}
"""Laws of a bushing, and which of `_bushing_kinds` are unknown numbers: stiffness and damping;
monotone table and damping; for rotations, stiffness, damping and HAVSIN friction; stiffness and
damping with rate-independent friction, with a Maxwell branch, with both."""


@dataclass(frozen=True)
class ComponentModel:
    """A law of a component whose numbers are unknown.

    Attributes:
        unknowns: Numbers that are searched.
        fields: Function of a point (p,) that returns the component's fields, in SI; a table as a
            mapping.
        bench: Function of a point that returns the component on the bench.
        fixed: Numbers that the user gave, by name; they are no unknowns. [SI]
    """

    law: str
    unknowns: tuple[Unknown, ...]
    fields: Callable[[FloatArray], dict[str, Any]]
    bench: Callable[[FloatArray], Bench]
    fixed: Mapping[str, float] = field(default_factory=dict)

    @property
    def fixed_numbers(self) -> list[tuple[str, float, Unit]]:
        """Name, SI value and unit of each fixed number."""
        units = {name: unit_of_field(name) for name in self.fixed}
        return [(name, self.fixed[name], unit) for name, unit in units.items() if unit]


@dataclass(frozen=True)
class Given:
    """What the user gives for a law.

    Attributes:
        bounds: Bounds of unknowns, by field, in place of the default ones. [SI]
        fixed: Values that are known, by field. [SI]
        knots: Points of each curve of the law on each side of zero.
    """

    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    knots: int = KNOTS


def damper_model(
    law: str,
    motions: Sequence[MeasuredMotion],
    given: Given | None = None,
    kept: Mapping[str, float] | None = None,
    sponge_mass: float = 0.0,
) -> ComponentModel:
    """Return a damper with unknown numbers.

    Numbers of the law that are not unknown keep their default unless the user fixes them or gives
    them bounds.

    Args:
        law: As in a machine file.
        motions: Measured loops, for default bounds and for the stroke that a table must cover.
        given: What the user gives.
        kept: Numbers of the component that stay as they are, unless they are fixed. [SI]
        sponge_mass: Mass of the sponge on the bench; all motions must be sines then. [kg]

    Raises:
        InputError: There is no such law, or no such field, or the sponge cannot have a mass.
    """
    names, given = fields_of_law(law), given or Given()
    registered, scale = DAMPER_LAWS[law], scale_of(motions)
    if sponge_mass > 0.0:
        _check_sponge_mass(registered, motions)
    tables = tuple(
        MonotoneCurve(curve, scale, given.knots, is_odd=True) for curve in registered.curves
    )
    rises = [rise for table in tables for rise in table.unknowns]
    numbers_of_law = [name for name in names if name not in registered.curves]
    check_names([*numbers_of_law, *(rise.name for rise in rises)], given.bounds, given.fixed)
    bounded = {name: ends for name, ends in given.bounds.items() if name in numbers_of_law}
    searched = {**registered.unknowns, **bounded}
    known = {**(kept or {}), **given.fixed}
    numbers = unknowns_of(searched, _units(registered), scale, given.bounds, known)
    unknowns = (*numbers, *_free_rises(rises, given))
    fields = partial(_fields_at, known={"law": law, **known}, unknowns=unknowns, tables=tables)
    return ComponentModel(
        law,
        unknowns,
        fields,
        lambda point: damper_bench(_damper(fields(point)), sponge_mass),
        given.fixed,
    )


def _check_sponge_mass(law: DamperLaw, motions: Sequence[MeasuredMotion]) -> None:
    """Raise InputError if a law has no sponge that can have a mass, or a motion is no sine."""
    if law.sponge_with_mass is None:
        names = [other.name for other in DAMPER_LAWS.values() if other.sponge_with_mass]
        raise input_error(
            f"law '{law.name}' has no sponge that can have a mass; allowed are {', '.join(names)}",
            where="--sponge-mass",
        )
    for motion in motions:
        if not isinstance(motion, HarmonicMotion):
            raise input_error(
                "is not a sine; a sponge with mass is computed under sines only",
                where=motion.loop.path,
            )


def _units(law: DamperLaw) -> dict[str, Unit]:
    """Return the unit of each number of a damper law, from its class."""
    fields = law.parameters.model_fields
    units = {name: unit_of(fields[name].annotation, fields[name].metadata) for name in law.fields}
    return {name: unit for name, unit in units.items() if unit and name not in law.curves}


_DAMPERS: TypeAdapter[DamperNumbers] = TypeAdapter(DamperType)


def _damper(fields: dict[str, Any]) -> DamperNumbers:
    try:
        return _DAMPERS.validate_python(fields)
    except ValidationError as error:
        detail = error.errors()[0]
        message = str(detail.get("ctx", {}).get("error", detail["msg"]))
        raise input_error(
            message, where="--fix", key=".".join(map(str, detail["loc"][1:]))
        ) from None


@dataclass(frozen=True)
class TestedAxis:
    """Axis of a bushing on the bench.

    Attributes:
        base: The bushing whose other axes stay as they are.
        axis: One of `wm_drake.rigs.AXES`.
        arm: Radius of the jig, where displacements and forces of its end were measured. [m]
    """

    __test__ = False  # not one of pytest's

    base: BushingType
    axis: str
    arm: float = 0.0


def bushing_model(
    law: str, motions: Sequence[MeasuredMotion], tested: TestedAxis, given: Given | None = None
) -> ComponentModel:
    """Return one axis of a bushing with unknown numbers.

    Args:
        law: One of `BUSHING_LAWS`.
        motions, given: As for `damper_model`.

    Raises:
        InputError: There is no such law (or not along an axis), or no such field.
    """
    base, axis, given = tested.base, tested.axis, given or Given()
    fields_of_law(law, axis)  # checks the law
    about = axis.startswith("about")
    if law == "voigt_havsin" and not about:
        raise input_error(
            "voigt_havsin is a law about an axis; along one, take voigt or table", where="--law"
        )
    scale, kinds = scale_of(motions, tested.arm), _bushing_kinds(axis)
    stiffness = next(iter(kinds))
    tables: tuple[MonotoneCurve, ...] = ()
    if law == "table":
        tables = (MonotoneCurve(stiffness, scale, given.knots, about=about),)
    if set(BUSHING_LAWS[law]) & _OF_RUBBER and not isinstance(base, RubberBushingType):
        raise input_error(
            f"law '{law}' has branches of rubber, which a bushing of a damper's tubes cannot have; "
            "allowed are voigt, table and voigt_havsin",
            where="--law",
        )
    rises = [rise for table in tables for rise in table.unknowns]
    names = list(kinds)
    searched = {names[k]: kinds[names[k]] for k in BUSHING_LAWS[law]}
    check_names([*searched, *(rise.name for rise in rises)], given.bounds, given.fixed)
    kinds_of_units = ABOUT if about else ALONG
    units = {name: kinds_of_units[kind] for name, kind in searched.items()}
    numbers = unknowns_of(searched, units, scale, given.bounds, given.fixed)
    unknowns = (*numbers, *_free_rises(rises, given))
    known = {name: value for name, value in given.fixed.items() if name in searched}
    _check_fixed(base, {unknown.name: unknown.upper for unknown in numbers} | known)
    fields = partial(_fields_at, known=given.fixed, unknowns=unknowns, tables=tables)

    def bench(point: FloatArray) -> Bench:
        kind = TorqueTable if about else ForceTable
        values = {
            name: kind(**value) if isinstance(value, dict) else value
            for name, value in fields(point).items()
        }
        return bushing_bench(base.model_copy(update=values), axis, tested.arm)

    return ComponentModel(law, unknowns, fields, bench, given.fixed)


def _check_fixed(base: BushingType, fixed: Mapping[str, float]) -> None:
    """Check that fixed numbers are allowed for a bushing.

    Raises:
        InputError: A number is outside of its range.
    """
    try:
        type(base).model_validate({**base.model_dump(), **fixed})
    except ValidationError as error:
        problem = problems_of(error, type(base))[0]
        raise input_error(problem.message, where="--fix", key=problem.key) from None


def _bushing_kinds(axis: str) -> dict[str, Kind]:
    """Return the fields of a bushing along or about an axis with their kinds."""
    prefix, letter = ("rotational_" if axis.startswith("about") else ""), axis[-1]
    k = AXES.index(axis)
    return {
        f"{prefix}stiffness_{letter}": "stiffness",
        f"{prefix}damping_{letter}": "damping",
        f"friction_torque_{letter}": "force",
        f"full_friction_rate_{letter}": "speed",
        **dict(zip(DAHL_FIELDS[k], ("force", "length"), strict=True)),
        **dict(zip(MAXWELL_FIELDS[k], ("branch", "dashpot"), strict=True)),
    }


_OF_RUBBER = {4, 5, 6, 7}
"""Which of `_bushing_kinds` belong to branches of rubber."""


def _fields_at(
    point: FloatArray,
    known: Mapping[str, Any],
    unknowns: Sequence[Unknown],
    tables: Sequence[MonotoneCurve],
) -> dict[str, Any]:
    """Return the fields of a component at a point (p,): known numbers, unknown ones, then tables.

    Rises of the tables are known or unknown numbers.
    """
    named = {u.name: float(value) for u, value in zip(unknowns, point, strict=True)}
    fields = {**known, **named}
    curves = {
        table.name: table.curve(np.array([fields.pop(rise.name) for rise in table.unknowns]))
        for table in tables
    }
    return {**fields, **curves}


def _free_rises(rises: Sequence[Unknown], given: Given) -> tuple[Unknown, ...]:
    """Return the rises of tables that are not fixed, with the user's bounds where there are any."""
    return tuple(
        Unknown(rise.name, *given.bounds.get(rise.name, (rise.lower, rise.upper)), rise.unit)
        for rise in rises
        if rise.name not in given.fixed
    )


def fields_of_law(law: str, axis: str = "") -> tuple[str, ...]:
    """Return the fields of a law that can be unknown or fixed; a table counts with all its rises.

    Args:
        law: A damper law, or a law of a bushing.
        axis: Axis of a bushing; "" for a damper.
    """
    laws: Mapping[str, Any] = BUSHING_LAWS if axis else DAMPER_LAWS
    what = "a bushing" if axis else "a damper"
    check_known(law, laws, f"no law '{law}' of {what}", where="--law")
    if not axis:
        return DAMPER_LAWS[law].fields
    kinds = list(_bushing_kinds(axis))
    numbers = (kinds[k] for k in BUSHING_LAWS[law])
    return (*numbers, *(kinds[:1] if law == "table" else ()))


def units_of_fields() -> dict[str, Unit]:
    """Return the unit of every number of a component that can be unknown or fixed."""
    units = {name: unit for law in DAMPER_LAWS.values() for name, unit in _units(law).items()}
    for letter in "xyz":
        along, about = _bushing_kinds(letter), _bushing_kinds(f"about_{letter}")
        units |= {name: ALONG[kind] for name, kind in along.items() if "friction" not in name}
        units |= {name: ABOUT[kind] for name, kind in about.items()}
    return units


def unit_of_field(name: str) -> Unit | None:
    """Return the unit of a number of `units_of_fields` or of a rise of a table; None if unknown."""
    field, _, rise = name.partition(".")
    if rise.startswith("rise_"):
        return TORQUE if field.startswith("rotational") else FORCE
    return units_of_fields().get(name)
