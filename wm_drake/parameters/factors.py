"""Factors of a study: groups of a machine's numbers that vary together at three levels."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from pydantic import Field, ValidationError

from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.parameters.elements import ForceTable, Frozen, TorqueTable
from wm_drake.parameters.files import read_yaml
from wm_drake.parameters.keys import is_index, quantities, unit_of, with_value, with_values
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Unit

GASKET_FACTORS = Path(__file__).parents[1] / "data" / "gasket_factors.yaml"
"""File with the factors of [B] section 4."""

LINEAR_PART = 0.2
"""Part of a table, on each side of zero, whose fitted line has the nominal stiffness as its slope.

[B] section 4: "slopes of linear fit to the first 20 % of the force-displacement and torque-angle
curves".
"""

TABLES = ("linear", "scaled")
"""How a level changes a stiffness that is given as a table.

"linear": a number replaces the table, the level times the nominal stiffness, as in [B].
"scaled": the forces of the table are scaled, so that the curve keeps its shape.
"""

_PERCENT = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))\s*%\s*")

Value: TypeAlias = float | ForceTable | TorqueTable


class Factor(Frozen):
    """A factor: numbers of a machine that vary together.

    Attributes:
        keys: Key paths of the numbers.
        low, high: Levels -1 and 1, as percent of the machine's value ("50 %") or as a value
            ("2 N/mm").
        middle: Level 0; None for the mean of the two.
        about: Description of the factor.
    """

    keys: tuple[str, ...] = Field(min_length=1)
    low: str = "50 %"
    high: str = "150 %"
    middle: str | None = None
    about: str = ""


@dataclass(frozen=True)
class FactorLevels:
    """The levels of a factor for one machine.

    Attributes:
        name: Name of the factor.
        about: Description of the factor.
        settings: For each of the levels -1, 0 and 1: values by key path, in SI units.
        nominal: By key path: the machine's number, or the nominal stiffness of its table, as text
            in the display unit.
        shown: For each of the levels -1, 0 and 1: the value of the first key, as text in the
            display unit.
        numbers: By key path: the value at each of the levels -1, 0 and 1, in the display unit. Of a
            table, it is the nominal stiffness.
        units: By key path: the display unit, for reading; "" if the number has none.
    """

    name: str
    about: str
    settings: tuple[dict[str, Value], ...]
    nominal: dict[str, str]
    shown: tuple[str, ...]
    numbers: dict[str, tuple[float, ...]]
    units: dict[str, str]


def load_factors(path: Path) -> dict[str, Factor]:
    """Read a factor file with entries ``NAME: {keys: [KEY, ...], low: BOUND, high: BOUND}``.

    Raises:
        InputError: the file is missing or wrong, with one problem for each error.
    """
    factors, problems = {}, []
    for name, entry in read_yaml(path).items():
        try:
            factors[str(name)] = Factor.model_validate(entry)
        except ValidationError as error:
            problems += [replace(p, where=str(path)) for p in problems_of(error, Factor, str(name))]
    if problems:
        raise InputError(problems)
    return factors


def factor_of_text(text: str, known: Mapping[str, Factor]) -> tuple[str, Factor]:
    """Return the name and the factor that a command-line argument means.

    Args:
        text: NAME of a known factor or KEY path of a number, either one with or without =LOW..HIGH.
        known: Known factors by name.

    Raises:
        InputError: the text does not have this form.
    """
    name, equals, bounds = (part.strip() for part in text.partition("="))
    factor = known.get(name) or Factor(keys=(name,))
    if not equals:
        return name, factor
    low, dots, high = (part.strip() for part in bounds.partition(".."))
    if not (dots and low and high):
        raise input_error(
            f"'{text}' is not of the form NAME=LOW..HIGH; write for example '{name}=50 %..150 %'"
        )
    return name, factor.model_copy(update={"low": low, "high": high, "middle": None})


def levels_of(
    parameters: MachineParameters, factors: Mapping[str, Factor], tables: str = "linear"
) -> tuple[FactorLevels, ...]:
    """Return the levels of factors for a machine.

    Args:
        parameters: The machine.
        factors: Factors by name.
        tables: How a level changes a table, one of `TABLES`.

    Raises:
        InputError: the machine does not have a key, a level is not allowed for a key, or two
            factors contain the same key.
    """
    known = {key: (value, unit) for key, value, unit in quantities(parameters)}
    resolved, problems, owner = [], [], dict[str, str]()
    for name, factor in factors.items():
        try:
            for key in factor.keys:
                if owner.setdefault(key, name) != name:
                    raise input_error(
                        f"belongs to factor {owner[key]} already; a key may be in one factor only",
                        key=key,
                    )
            resolved.append(_resolved(parameters, known, name, factor, tables))
        except InputError as error:
            problems += [
                Problem(p.where or f"factor {name}", p.key, p.message) for p in error.problems
            ]
    if problems:
        raise InputError(problems)
    return tuple(resolved)


def at_levels(
    parameters: MachineParameters, factors: Sequence[FactorLevels], levels: Sequence[int]
) -> MachineParameters:
    """Return the machine with each factor set to its level.

    Args:
        parameters: The machine.
        factors: Factors with their levels for this machine.
        levels: One level (-1, 0 or 1) for each factor.
    """
    settings = [
        factor.settings[int(level) + 1] for factor, level in zip(factors, levels, strict=True)
    ]
    return with_values(
        parameters, {key: value for setting in settings for key, value in setting.items()}
    )


def at_places(
    parameters: MachineParameters, factors: Sequence[FactorLevels], places: Sequence[float]
) -> MachineParameters:
    """Return the machine with each factor at a place from -1 to 1, on or between its levels.

    Numbers are interpolated linearly between two levels. The forces of a table follow its
    stiffness.

    Args:
        parameters: The machine.
        factors: Factors with their levels for this machine.
        places: One place for each factor.
    """
    changes: dict[str, Any] = {}
    for factor, place in zip(factors, places, strict=True):
        for key, middle in factor.settings[1].items():
            if isinstance(middle, ForceTable | TorqueTable):
                numbers = factor.numbers[key]
                changes[key] = scaled_table(middle, _between(place, numbers) / numbers[1])
            else:
                changes[key] = _between(place, [float(s[key]) for s in factor.settings])  # type: ignore[arg-type]
    return with_values(parameters, changes)


def _between(place: float, values: Sequence[float]) -> float:
    return float(np.interp(place, (-1.0, 0.0, 1.0), values))


def place_of(parameters: MachineParameters, factor: FactorLevels, text: str) -> float:
    """Return the place from -1 to 1 of a value of a factor.

    Args:
        parameters: The machine whose levels the factor has.
        factor: The factor.
        text: Value of its first key with a unit, or in percent of the machine's number.

    Raises:
        InputError: the text is not a value of this key, or is outside the range of the factor.
    """
    key, numbers = next(iter(factor.numbers.items()))
    known = {k: (value, unit) for k, value, unit in quantities(parameters)}
    number, unit = nominal_at(parameters, known, key)
    value = _bound(parameters, key, text, number)
    shown = value if unit is None else unit.from_si(value)
    slack = 1e-9 * (numbers[2] - numbers[0])
    if not numbers[0] - slack <= shown <= numbers[2] + slack:
        raise input_error(
            f"'{text}' is outside the range of factor {factor.name}, "
            f"{factor.shown[0]} to {factor.shown[2]}",
            key=key,
        )
    return float(np.interp(shown, numbers, (-1.0, 0.0, 1.0)))


def nominal_stiffness(table: ForceTable | TorqueTable) -> float:
    """Return the nominal stiffness of a table. [N/m or N m/rad]

    This is the slope of the least-squares line through the curve over its first 20 % on both sides
    of zero. If the curve is flat there (a free stroke), it is the slope of the line through the
    whole curve.
    """
    x = table.curve[0]
    for part in (LINEAR_PART, 1.0):
        points = np.linspace(part * min(x[0], 0.0), part * max(x[-1], 0.0), 201)
        slope = float(np.polyfit(points, table.values(points), 1)[0])
        if slope > 0.0:
            return slope
    return 0.0


def _resolved(
    parameters: MachineParameters,
    known: Mapping[str, tuple[Any, Unit]],
    name: str,
    factor: Factor,
    tables: str,
) -> FactorLevels:
    """Return a factor's levels for a machine; `known` has value and unit of all numbers by key."""
    settings: tuple[dict[str, Value], ...] = ({}, {}, {})
    nominal: dict[str, str] = {}
    shown: tuple[str, ...] = ()
    numbers: dict[str, tuple[float, ...]] = {}
    units: dict[str, str] = {}
    for key in factor.keys:
        number, unit = nominal_at(parameters, known, key)
        low, high = (_bound(parameters, key, text, number) for text in (factor.low, factor.high))
        middle = (
            0.5 * (low + high)
            if factor.middle is None
            else _bound(parameters, key, factor.middle, number)
        )
        if not low < middle < high:
            texts = f"{factor.low}, {factor.middle or 'half way'}, {factor.high}"
            reason = " (the value is 0)" if number == 0.0 else ""
            raise input_error(
                f"levels {texts} do not rise{reason}; the low level must be below the high one",
                key=key,
            )
        original = known[key][0] if key in known else value_at(parameters, key)
        for level, value in zip(settings, (low, middle, high), strict=True):
            scaled = isinstance(original, ForceTable | TorqueTable) and (
                tables == "scaled" or not _takes_numbers(parameters, key)
            )
            if scaled and _takes_numbers(parameters, key):
                with_value(parameters, key, value)  # raises if a slope like this is not allowed
            level[key] = scaled_table(original, value / float(number or 1.0)) if scaled else value
            changed = with_value(parameters, key, level[key])  # raises if it is not allowed
            # a number that only the SDF has is a number of the machine once it is set
            unit = unit or next((u for k, _, u in quantities(changed) if k == key), None)
        nominal[key] = "" if number is None else _text(number, unit)
        levels = (low, middle, high)
        numbers[key] = levels if unit is None else tuple(map(unit.from_si, levels))
        units[key] = "" if unit is None else unit.shown.replace("*", " ")
        shown = shown or tuple(_text(value, unit) for value in levels)
    return FactorLevels(name, factor.about, settings, nominal, shown, numbers, units)


def nominal_at(
    parameters: MachineParameters, known: Mapping[str, tuple[Any, Unit]], key: str
) -> tuple[float | None, Unit | None]:
    """Return a number of the machine by key path, with its unit; None if only the SDF has it.

    Args:
        parameters: The machine.
        known: Value and unit of all its numbers, from `quantities`.
        key: Key path. That of a table means its nominal stiffness.

    Raises:
        InputError: the machine has no such key, or it is not that of a number.
    """
    if key in known:
        value, unit = known[key]
        if isinstance(value, tuple):
            raise input_error(
                f"is a list of numbers; name one of them by its index, for example {key}.0",
                key=key,
            )
        return (None if value is None else float(value)), unit
    parent, _, last = key.rpartition(".")
    if (
        parent in known
        and is_index(last)
        and isinstance(known[parent][0], tuple)
        and int(last) < len(known[parent][0])
    ):
        return float(known[parent][0][int(last)]), known[parent][1]
    value = value_at(parameters, key)
    if isinstance(value, ForceTable | TorqueTable):
        units = ("N/m", "N/mm") if isinstance(value, ForceTable) else ("N*m/rad", "N*mm/rad")
        return nominal_stiffness(value), Unit(*units)
    if value is not None:
        raise input_error("is not a number of the machine", key=key)
    return None, None


def value_at(parameters: MachineParameters, key: str) -> Any:
    """Return the value at a key path; None if only the SDF has a value."""
    node: Any = parameters
    parts = key.split(".")
    for place, part in enumerate(parts):
        if isinstance(node, Frozen) and part in type(node).model_fields:
            node = getattr(node, part)
        elif isinstance(node, dict) and part in node:
            node = node[part]
        elif isinstance(node, tuple) and is_index(part) and int(part) < len(node):
            node = node[int(part)]
        elif place == 1 and parts[0] in ("bodies", "frames"):
            return None
        else:
            names = (
                list(node)
                if isinstance(node, dict)
                else list(type(node).model_fields)
                if isinstance(node, Frozen)
                else []
            )
            raise input_error(f"unknown key '{part}'{nearest_names(part, names)}", key=key)
        if node is None:
            if parts[0] in ("bodies", "frames"):
                return None
            raise input_error(f"the machine has no {'.'.join(parts[: place + 1])}", key=key)
    return node


def _bound(parameters: MachineParameters, key: str, text: str, nominal: float | None) -> float:
    percent = _PERCENT.fullmatch(text)
    if percent and nominal is None:
        raise input_error(
            f"is in the SDF but not in the machine file, so '{text}' is unknown; write a value "
            "with a unit",
            key=key,
        )
    if percent:
        return 0.01 * float(percent[1]) * float(nominal or 0.0)
    if is_index(key.rpartition(".")[2]):
        raise input_error(
            f"'{text}' is not in percent; the bounds of one number of a list must be", key=key
        )
    value = value_at(with_value(parameters, key, text), key)
    if not isinstance(value, float):
        raise input_error(f"'{text}' is not a number for this key", key=key)
    return value


def _takes_numbers(parameters: MachineParameters, key: str) -> bool:
    """Return whether the field of a table accepts a number instead of a table."""
    parent, _, name = key.rpartition(".")
    field = type(value_at(parameters, parent)).model_fields[name]
    return unit_of(field.annotation, field.metadata) is not None


def scaled_table(table: ForceTable | TorqueTable, factor: float) -> ForceTable | TorqueTable:
    """Return a table with its forces or torques times a factor."""
    ordinate = "force" if isinstance(table, ForceTable) else "torque"
    return table.model_copy(
        update={ordinate: tuple(factor * number for number in getattr(table, ordinate))}
    )


def _text(value: float, unit: Unit | None) -> str:
    """Return a value as text in the display unit."""
    return (
        f"{value:.6g}"
        if unit is None
        else f"{unit.from_si(value):.6g} {unit.shown.replace('*', ' ')}"
    )
