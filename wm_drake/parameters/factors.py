"""Factors of a study: names for numbers of a machine that move together, at three levels; from a file, or named by key path."""

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
from wm_drake.parameters.keys import quantities, unit_of, with_value, with_values
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Unit

GASKET_FACTORS = Path(__file__).parents[1] / "data" / "gasket_factors.yaml"
"""The factors of [B] section 4."""

LINEAR_PART = 0.2
"""The nominal stiffness of a table is the slope of a line fitted to this part of it, about zero ([B] section 4: "slopes of
linear fit to the first 20 % of the force-displacement and torque-angle curves")."""

TABLES = ("linear", "scaled")
"""What becomes of a stiffness given as a table: a number, level times nominal stiffness, as in [B]; or the table with its
forces scaled, which keeps its shape."""

_PERCENT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*%\s*")

Value: TypeAlias = float | ForceTable | TorqueTable


class Factor(Frozen):
    """Numbers of a machine that move together.

    Attributes:
        keys: Their key paths.
        low, high: Levels -1 and 1: percent of the machine's value ("50 %"), or a value ("2 N/mm").
        middle: Level 0; half way between by default.
        about: What it is, in words.
    """

    keys: tuple[str, ...] = Field(min_length=1)
    low: str = "50 %"
    high: str = "150 %"
    middle: str | None = None
    about: str = ""


@dataclass(frozen=True)
class FactorLevels:
    """A factor of one machine.

    Attributes:
        name: Of the factor.
        about: What it is, in words.
        settings: For the levels -1, 0 and 1: value by key path, SI.
        nominal: By key path, the machine's number, or the nominal stiffness of its table, in the unit people read.
        shown: For the levels -1, 0 and 1: what the first key is set to, in the unit people read.
    """

    name: str
    about: str
    settings: tuple[dict[str, Value], ...]
    nominal: dict[str, str]
    shown: tuple[str, ...]


def load_factors(path: Path) -> dict[str, Factor]:
    """Reads a factor file: ``NAME: {keys: [KEY, ...], low: BOUND, high: BOUND}``.

    Raises:
        InputError: with one problem per fault.
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
    """A factor as written on a command line: NAME of a known one, KEY, or either with =LOW..HIGH.

    Raises:
        InputError: not of this form.
    """
    name, equals, bounds = (part.strip() for part in text.partition("="))
    factor = known.get(name) or Factor(keys=(name,))
    if not equals:
        return name, factor
    low, dots, high = (part.strip() for part in bounds.partition(".."))
    if not (dots and low and high):
        raise input_error(f"'{text}' is not NAME=LOW..HIGH; write for example '{name}=50 %..150 %'")
    return name, factor.model_copy(update={"low": low, "high": high, "middle": None})


def levels_of(
    parameters: MachineParameters, factors: Mapping[str, Factor], tables: str = "linear"
) -> tuple[FactorLevels, ...]:
    """What the levels of factors are for a machine.

    Args:
        parameters: The machine.
        factors: By name.
        tables: One of `TABLES`.

    Raises:
        InputError: a key that the machine does not have, bounds that are no value of it, or that two factors share.
    """
    known = {key: (value, unit) for key, value, unit in quantities(parameters)}
    resolved, problems, owner = [], [], dict[str, str]()
    for name, factor in factors.items():
        try:
            for key in factor.keys:
                if owner.setdefault(key, name) != name:
                    raise input_error(f"moves with factor {owner[key]} already", key=key)
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
    """The machine with each factor at a level, -1, 0 or 1."""
    settings = [
        factor.settings[int(level) + 1] for factor, level in zip(factors, levels, strict=True)
    ]
    return with_values(
        parameters, {key: value for setting in settings for key, value in setting.items()}
    )


def nominal_stiffness(table: ForceTable | TorqueTable) -> float:
    """Slope of the least-squares line through the curve of a table over its first fifth on both sides. [N/m or N m/rad]

    Of a curve that is flat there (a free stroke), the slope of the line through all of it.
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
    settings: tuple[dict[str, Value], ...] = ({}, {}, {})
    nominal: dict[str, str] = {}
    shown: tuple[str, ...] = ()
    for key in factor.keys:
        number, unit = _nominal(parameters, known, key)
        low, high = (_bound(parameters, key, text, number) for text in (factor.low, factor.high))
        middle = (
            0.5 * (low + high)
            if factor.middle is None
            else _bound(parameters, key, factor.middle, number)
        )
        if not low < middle < high:
            texts = f"{factor.low}, {factor.middle or 'half way'}, {factor.high}"
            raise input_error(
                f"levels {texts} do not rise{' (the value is 0)' if number == 0.0 else ''}", key=key
            )
        original = known[key][0] if key in known else _value_at(parameters, key)
        for level, value in zip(settings, (low, middle, high), strict=True):
            scaled = isinstance(original, ForceTable | TorqueTable) and (
                tables == "scaled" or not _takes_numbers(parameters, key)
            )
            level[key] = _scaled(original, value / float(number or 1.0)) if scaled else value
            with_value(
                parameters, key, level[key]
            )  # the machine has the last word on what it can be
        nominal[key] = "" if number is None else _text(number, unit)
        if not shown:
            shown = tuple(_text(value, unit) for value in (low, middle, high))
    return FactorLevels(name, factor.about, settings, nominal, shown)


def _nominal(
    parameters: MachineParameters, known: Mapping[str, tuple[Any, Unit]], key: str
) -> tuple[float | None, Unit | None]:
    """The machine's number and its unit; None for a number that only the SDF has."""
    if key in known:
        value, unit = known[key]
        if isinstance(value, tuple):
            raise input_error(
                "is a list of numbers; name one of them by its place, from 0: " + f"{key}.0",
                key=key,
            )
        return (None if value is None else float(value)), unit
    parent, _, last = key.rpartition(".")
    if (
        parent in known
        and last.isdigit()
        and isinstance(known[parent][0], tuple)
        and int(last) < len(known[parent][0])
    ):
        return float(known[parent][0][int(last)]), known[parent][1]
    value = _value_at(parameters, key)
    if isinstance(value, ForceTable | TorqueTable):
        units = ("N/m", "N/mm") if isinstance(value, ForceTable) else ("N*m/rad", "N*mm/rad")
        return nominal_stiffness(value), Unit(*units)
    if value is not None:
        raise input_error("is not a number of the machine", key=key)
    return None, None


def _value_at(parameters: MachineParameters, key: str) -> Any:
    """What stands at a key path; None where only the SDF has a value."""
    node: Any = parameters
    parts = key.split(".")
    for place, part in enumerate(parts):
        if isinstance(node, Frozen) and part in type(node).model_fields:
            node = getattr(node, part)
        elif isinstance(node, dict) and part in node:
            node = node[part]
        elif isinstance(node, tuple) and part.isdigit() and int(part) < len(node):
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
            f"is in the SDF, not in the machine file, so '{text}' of it is not known; give a value",
            key=key,
        )
    if percent:
        return 0.01 * float(percent[1]) * float(nominal or 0.0)
    if key.rpartition(".")[2].isdigit():
        raise input_error(f"'{text}': one number of a list takes bounds in percent", key=key)
    value = _value_at(with_value(parameters, key, text), key)
    if not isinstance(value, float):
        raise input_error(f"'{text}' is not a number for this key", key=key)
    return value


def _takes_numbers(parameters: MachineParameters, key: str) -> bool:
    """Whether the field of a table may hold a number in its place."""
    parent, _, name = key.rpartition(".")
    field = type(_value_at(parameters, parent)).model_fields[name]
    return unit_of(field.annotation, field.metadata) is not None


def _scaled(table: ForceTable | TorqueTable, factor: float) -> ForceTable | TorqueTable:
    ordinate = "force" if isinstance(table, ForceTable) else "torque"
    return table.model_copy(
        update={ordinate: tuple(factor * number for number in getattr(table, ordinate))}
    )


def _text(value: float, unit: Unit | None) -> str:
    """A value for the eye."""
    return (
        f"{value:.6g}"
        if unit is None
        else f"{unit.from_si(value):.6g} {unit.shown.replace('*', ' ')}"
    )
