"""What of a component is unknown, between which bounds, and how its parameters follow from a point.

A model knows the fields of one law. Default bounds come from the loops themselves: no force can exceed what was measured by
much, no stiffness the steepest loop by orders of magnitude. They are starts of a search, and the user's to replace.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters import DamperType, ForceTable, TorqueTable
from wm_drake.parameters.elements import BushingType
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.rigs import Bench, bushing_bench, damper_bench
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.fitting import Unknown
from wm_drake.studies.identification.scales import (
    ABOUT,
    ALONG,
    FORCE,
    SPEED,
    TORQUE,
    check_names,
    scale_of,
    unknowns_of,
    with_bounds,
)
from wm_drake.studies.identification.tables import OddTable, TwoSidedTable

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

BUSHING_LAWS = {"voigt": slice(0, 2), "table": slice(1, 2), "voigt_havsin": slice(0, 4)}
"""Stiffness and damping; monotone table and damping; for rotations, stiffness, damping and HAVSIN friction. Which of
`_bushing_kinds` are numbers to be found."""


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
        raise input_error(
            f"no law '{law}' of a damper{nearest_names(law, DAMPER_LAWS)}", where="--law"
        )
    kinds, scale = DAMPER_LAWS[law] | OPTIONAL.get(law, {}), scale_of(motions)
    kept = ["regularisation_velocity"] if law in ("mstv", "free_stroke") else []
    table = OddTable("sponge", scale, knots) if law == "free_stroke" else None
    check_names([*kinds, *kept, *_rises(table)], bounds, fixed)
    searched = {
        name: kind
        for name, kind in kinds.items()
        if name in DAMPER_LAWS[law] or name in (bounds or {})
    }
    numbers = unknowns_of(searched, ALONG, scale, bounds, fixed)
    fields = _Fields({"law": law, **(fixed or {})}, numbers, table)
    unknowns = (*numbers, *with_bounds(table.unknowns if table else (), bounds))
    return ComponentModel(law, unknowns, fields, lambda point: damper_bench(_damper(fields(point))))


def _damper(fields: dict[str, Any]) -> DamperType:
    try:
        return TypeAdapter(DamperType).validate_python(fields)
    except ValidationError as error:
        detail = error.errors()[0]
        message = str(detail.get("ctx", {}).get("error", detail["msg"]))
        raise input_error(
            message, where="--fix", key=".".join(map(str, detail["loc"][1:]))
        ) from None


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
        raise input_error(
            f"no law '{law}' of a bushing{nearest_names(law, BUSHING_LAWS)}", where="--law"
        )
    about = axis.startswith("about")
    if law == "voigt_havsin" and not about:
        raise input_error(
            "voigt_havsin is a law about an axis; along one, take voigt or table", where="--law"
        )
    scale, kinds = scale_of(motions, arm), _bushing_kinds(axis)
    stiffness = next(iter(kinds))
    table = TwoSidedTable(stiffness, scale, knots, about) if law == "table" else None
    searched = {name: kinds[name] for name in list(kinds)[BUSHING_LAWS[law]]}
    check_names([*searched, *_rises(table)], bounds, fixed)
    numbers = unknowns_of(searched, ABOUT if about else ALONG, scale, bounds, fixed)
    fields = _Fields(fixed or {}, numbers, table)

    def bench(point: FloatArray) -> Bench:
        kind = TorqueTable if about else ForceTable
        values = {
            name: kind(**value) if isinstance(value, dict) else value
            for name, value in fields(point).items()
        }
        return bushing_bench(base.model_copy(update=values), axis, arm)

    return ComponentModel(
        law, (*numbers, *with_bounds(table.unknowns if table else (), bounds)), fields, bench
    )


def _bushing_kinds(axis: str) -> dict[str, str]:
    """Fields of a bushing along or about an axis, and of what kind: stiffness, damping, and those of its friction."""
    prefix, letter = ("rotational_" if axis.startswith("about") else ""), axis[-1]
    return {
        f"{prefix}stiffness_{letter}": "stiffness",
        f"{prefix}damping_{letter}": "damping",
        f"friction_torque_{letter}": "force",
        f"full_friction_rate_{letter}": "speed",
    }


@dataclass(frozen=True)
class _Fields:
    """Fields of a component at a point (p,): those that are known, its unknown numbers, then the rises of its table."""

    known: Mapping[str, Any]
    numbers: tuple[Unknown, ...]
    table: OddTable | TwoSidedTable | None

    def __call__(self, point: FloatArray) -> dict[str, Any]:
        named = {u.name: float(value) for u, value in zip(self.numbers, point, strict=False)}
        curve = (
            {self.table.name: self.table.curve(point[len(self.numbers) :])} if self.table else {}
        )
        return {**self.known, **named, **curve}


def _rises(table: OddTable | TwoSidedTable | None) -> list[str]:
    return [unknown.name for unknown in table.unknowns] if table else []


def units_of_fields() -> dict[str, Unit]:
    """Unit of every number of a component that can be unknown or fixed."""
    found = {
        name: ALONG[kind]
        for law in (*DAMPER_LAWS.values(), *OPTIONAL.values())
        for name, kind in law.items()
    }
    found["regularisation_velocity"] = SPEED
    for letter in "xyz":
        along, about = _bushing_kinds(letter), _bushing_kinds(f"about_{letter}")
        found |= {name: ALONG[kind] for name, kind in list(along.items())[:2]}
        found |= {name: ABOUT[kind] for name, kind in about.items()}
    return found


def unit_of_field(name: str) -> Unit | None:
    """Unit of such a number, or of a rise of a table; None if there is no such."""
    field, _, rise = name.partition(".")
    if rise.startswith("rise_"):
        return TORQUE if field.startswith("rotational") else FORCE
    return units_of_fields().get(name)
