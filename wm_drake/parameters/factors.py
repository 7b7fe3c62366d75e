"""Factors of a study: groups of a machine's numbers that vary together at three levels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import Field, ValidationError

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.elements import CurveTable, Frozen
from wm_drake.parameters.files import read_yaml
from wm_drake.parameters.keys import with_value, with_values
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Unit
from wm_drake.parameters.variation import Number, Value, number_at, owned_twice, range_of

GASKET_FACTORS = Path(__file__).parents[1] / "data" / "gasket_factors.yaml"
"""File with the factors of [B] section 4."""

TABLES = ("linear", "scaled")
"""How a level changes a stiffness that is given as a table.

"linear": a number replaces the table, the level times the nominal stiffness, as in [B].
"scaled": the forces of the table are scaled, so that the curve keeps its shape.
"""


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
        settings: For each of the levels -1, 0 and 1: values by key path, in SI units.
        nominal: By key path: the machine's number, or the nominal stiffness of its table, as text
            for reading.
        shown: For each of the levels -1, 0 and 1: the value of the first key, as text for reading.
        numbers: By key path: the value at each of the levels -1, 0 and 1. [SI] Of a table, it is
            the nominal stiffness.
        units: By key path: the unit.
    """

    name: str
    about: str
    settings: tuple[dict[str, Value], ...]
    nominal: dict[str, str]
    shown: tuple[str, ...]
    numbers: Mapping[str, tuple[float, ...]]
    units: dict[str, Unit]


def load_factors(path: Path) -> dict[str, Factor]:
    """Read a factor file with entries ``NAME: {keys: [KEY, ...], low: BOUND, high: BOUND}``."""
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
    """
    name, equals, bounds = (part.strip() for part in text.partition("="))
    factor = known.get(name) or Factor(keys=(name,))
    if not equals:
        return name, factor
    ends = range_of(bounds)
    if ends is None:
        raise input_error(
            f"'{text}' is not of the form NAME=LOW..HIGH; write for example '{name}=50 %..150 %'"
        )
    low, high = ends
    return name, factor.model_copy(update={"low": low, "high": high, "middle": None})


def levels_of(
    parameters: MachineParameters, factors: Mapping[str, Factor], tables: str = "linear"
) -> tuple[FactorLevels, ...]:
    """Return the levels of factors for a machine.

    Args:
        tables: How a level changes a table, one of `TABLES`.

    Raises:
        InputError: the machine does not have a key, a level is not allowed for a key, or two
            factors contain the same key.
    """
    resolved = []
    problems = owned_twice({name: factor.keys for name, factor in factors.items()}, "factor")
    for name, factor in factors.items():
        try:
            resolved.append(_resolved(parameters, name, factor, tables))
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
        levels: One level (-1, 0 or 1) for each factor.
    """
    changes: dict[str, Value] = {}
    for factor, level in zip(factors, levels, strict=True):
        changes |= factor.settings[int(level) + 1]
    return with_values(parameters, changes)


def at_places(
    parameters: MachineParameters, factors: Sequence[FactorLevels], places: Sequence[float]
) -> MachineParameters:
    """Return the machine with each factor at a place from -1 to 1, on or between its levels.

    Numbers are interpolated linearly between two levels. The forces of a table follow its
    stiffness.
    """
    changes: dict[str, Value] = {}
    for factor, place in zip(factors, places, strict=True):
        for key, middle in factor.settings[1].items():
            if isinstance(middle, CurveTable):
                numbers = factor.numbers[key]
                changes[key] = middle.scaled(_between(place, numbers) / numbers[1])
            else:
                changes[key] = _between(place, [float(s[key]) for s in factor.settings])  # type: ignore[arg-type]
    return with_values(parameters, changes)


def _between(place: float, values: Sequence[float]) -> float:
    return float(np.interp(place, (-1.0, 0.0, 1.0), values))


def place_of(parameters: MachineParameters, factor: FactorLevels, text: str) -> float:
    """Return the place from -1 to 1 of a value of a factor.

    Args:
        parameters: The machine whose levels the factor has.
        text: Value of its first key with a unit, or in percent of the machine's number.

    Raises:
        InputError: the text is not a value of this key, or is outside the range of the factor.
    """
    key, levels = next(iter(factor.numbers.items()))
    number = number_at(parameters, key)
    value = number.resolved(text)
    slack = 1e-9 * (levels[2] - levels[0])
    if not levels[0] - slack <= value <= levels[2] + slack:
        raise input_error(
            f"'{text}' is outside the range of factor {factor.name}, "
            f"{factor.shown[0]} to {factor.shown[2]}",
            key=key,
        )
    return float(np.interp(value, levels, (-1.0, 0.0, 1.0)))


def _resolved(
    parameters: MachineParameters, name: str, factor: Factor, tables: str
) -> FactorLevels:
    """Return a factor's levels for a machine."""
    numbers = [number_at(parameters, key) for key in factor.keys]
    levels = {number.key: _levels(number, factor) for number in numbers}
    settings: tuple[dict[str, Value], ...] = ({}, {}, {})
    for number in numbers:
        for setting, level in zip(settings, levels[number.key], strict=True):
            setting[number.key] = _setting(parameters, number, level, tables)
    return FactorLevels(
        name,
        factor.about,
        settings,
        {n.key: "" if n.nominal is None else n.unit.reading(n.nominal) for n in numbers},
        tuple(map(numbers[0].unit.reading, levels[numbers[0].key])),
        levels,
        {number.key: number.unit for number in numbers},
    )


def _levels(number: Number, factor: Factor) -> tuple[float, float, float]:
    """Return the low, middle and high level of a number, in SI units."""
    low, high = number.resolved(factor.low), number.resolved(factor.high)
    middle = 0.5 * (low + high) if factor.middle is None else number.resolved(factor.middle)
    if not low < middle < high:
        texts = f"{factor.low}, {factor.middle or 'half way'}, {factor.high}"
        reason = " (the value is 0)" if number.nominal == 0.0 else ""
        raise input_error(
            f"levels {texts} do not rise{reason}; the low level must be below the high one",
            key=number.key,
        )
    return low, middle, high


def _setting(parameters: MachineParameters, number: Number, level: float, tables: str) -> Value:
    """Return the number or table of a level, after checking that the machine allows it."""
    setting: Value = level
    if isinstance(number.original, CurveTable):
        if number.takes_numbers:
            with_value(parameters, number.key, level)  # a slope like this is allowed
        if tables == "scaled" or not number.takes_numbers:
            setting = number.original.scaled(level / (number.nominal or 1.0))
    with_value(parameters, number.key, setting)
    return setting
