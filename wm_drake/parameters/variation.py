"""Numbers of a machine that change: how a text changes one, and what it is then."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, TypeAlias

from pydantic import BaseModel

from wm_drake.errors import input_error
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.keys import field_at, unit_of
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.units import Fraction, Share, Unit

Value: TypeAlias = float | CurveTable

_NOMINAL = re.compile(r"nominal\s*(?:([+-])\s*(.+))?")
_RANGE = re.compile(r"\(([^(),]+),([^(),]+)\)(.*)")


class Change(StrEnum):
    """How a value changes a number of the machine."""

    VALUE = "value"
    """The value takes the place of the number; of a table, it is the nominal stiffness. [SI]"""
    PERCENT = "percent"
    """The value is a factor of the number; of a table, a factor of its forces. [1]"""
    DISTANCE = "distance"
    """The value is added to the number. [SI]"""


@dataclass(frozen=True)
class Number:
    """A number of a machine, or a table of a stiffness.

    Attributes:
        key: Key path.
        original: Value of the machine, SI; None if only the SDF has it. The column of a table is a
            tuple of numbers.
        unit: Unit; that of a table is the unit of its stiffness.
        takes_numbers: Whether the machine accepts a number here; some tables cannot be one.
    """

    key: str
    original: float | tuple[float, ...] | CurveTable | None
    unit: Unit
    takes_numbers: bool = True

    @cached_property
    def nominal(self) -> float | None:
        """Value of the machine, or nominal stiffness of its table; None if only the SDF has it."""
        if isinstance(self.original, CurveTable):
            return self.original.nominal_stiffness
        assert not isinstance(self.original, tuple)
        return self.original

    @property
    def is_table(self) -> bool:
        """Whether the machine has a table here."""
        return isinstance(self.original, CurveTable)

    def changed(self, change: Change, value: float) -> Any:
        """Return what `value` makes of this number: a number, a table, or the column of one."""
        original = self.original
        if change is Change.VALUE:
            return self.at(value)
        if isinstance(original, CurveTable):
            return original.scaled(value)
        if isinstance(original, tuple):
            return tuple(value * number for number in original)
        assert original is not None
        return original * value if change is Change.PERCENT else original + value

    def at(self, value: float) -> float | CurveTable:
        """Return the value in SI, or of a curve the one with this nominal stiffness."""
        if isinstance(self.original, CurveTable) and self.nominal:
            return self.original.scaled(value / self.nominal)
        return value

    def si(self, change: Change, value: float) -> float:
        """Return the number that `value` makes of this one, in SI; of a table, its stiffness."""
        if change is Change.VALUE:
            return value
        assert self.nominal is not None  # `common_form` has checked it
        return value * self.nominal if change is Change.PERCENT else self.nominal + value

    def resolved(self, text: str) -> float:
        """Return the value that a text means here, in SI; of a table it is a stiffness."""
        change, value = change_of(text, self.unit, self.key)
        if change is not Change.VALUE and self.nominal is None:
            raise input_error(
                f"is in the SDF but not in the machine file, so '{text}' is unknown; write a value "
                "with a unit",
                key=self.key,
            )
        return self.si(change, value)


def common_form(
    numbers: Sequence[Number], texts: Mapping[str, str]
) -> tuple[Change, dict[str, float]]:
    """Return the form of texts, which is the same for all numbers, and their values by name.

    Args:
        texts: Values such as low and high: "95 %", "9 N/mm", or "nominal + 2 mm".

    Raises:
        InputError: a text is not a value of a number, or the texts have different forms.
    """
    change, values = Change.VALUE, dict[str, float]()
    for number in numbers:
        change, values = changes_of(texts, number.unit, number.key)
        if change is not Change.VALUE and number.nominal is None:
            message = "has no number of a machine; write values with a unit"
            raise input_error(message, key=number.key)
        if change is Change.PERCENT and number.nominal == 0.0:
            message = "is 0, so percents of it are 0; write values with a unit"
            raise input_error(message, key=number.key)
        if change is Change.DISTANCE and number.is_table:
            raise input_error("is a table; write percents or a stiffness", key=number.key)
    return change, values


def changes_of(texts: Mapping[str, str], unit: Unit, key: str) -> tuple[Change, dict[str, float]]:
    """Return the common form of several texts, and their values by name.

    Raises:
        InputError: a text is not a value, or the texts have different forms.
    """
    read = {name: change_of(text, unit, f"{key}.{name}") for name, text in texts.items()}
    if len({change for change, _ in read.values()}) > 1:
        raise input_error(
            f"{' and '.join(read)} have different forms; write all in percent, all as values or "
            "all as nominal + distance",
            key=key,
        )
    return next(change for change, _ in read.values()), {n: value for n, (_, value) in read.items()}


def change_of(text: str, unit: Unit, key: str) -> tuple[Change, float]:
    """Return form and value of a text such as "95 %", "9 N/mm", "nominal" or "nominal + 2 mm".

    Args:
        unit: Unit of the number. Of a share, a percent is a value.
        key: Key path for the message.

    Raises:
        InputError: the text has none of these forms, or its unit does not fit.
    """
    text = text.strip()
    try:
        relative = _NOMINAL.fullmatch(text)
        if relative:
            distance = unit.number(relative[2]) if relative[2] else 0.0
            return Change.DISTANCE, -distance if relative[1] == "-" else distance
        if text.endswith("%") and not isinstance(unit, Fraction):
            return Change.PERCENT, Share().number(text)
        return Change.VALUE, unit.number(text)
    except ValueError as error:
        raise input_error(str(error), key=key) from None


def range_of(text: str) -> tuple[str, str] | None:
    """Return the ends of a range ``LOW..HIGH`` or ``(LOW, HIGH) UNIT`` as texts; None if neither.

    Example:
        >>> range_of("2 N/mm..4000 N/m"), range_of("(1, 2) mm"), range_of("3 mm")
        (('2 N/mm', '4000 N/m'), ('1 mm', '2 mm'), None)
    """
    bracket = _RANGE.fullmatch(text.strip())
    if bracket:
        return f"{bracket[1].strip()}{bracket[3]}", f"{bracket[2].strip()}{bracket[3]}"
    low, dots, high = (part.strip() for part in text.partition(".."))
    return (low, high) if dots and low and high else None


def number_at(parameters: MachineParameters, key: str) -> Number:
    """Return a number of a machine by key path; a table is a number, its nominal stiffness."""
    value, field = field_at(parameters, key)
    unit = None if field is None else unit_of(field.annotation, field.metadata)
    if isinstance(value, CurveTable):
        return Number(key, value, value.stiffness_unit, takes_numbers=unit is not None)
    if isinstance(value, tuple) and unit is not None:
        message = f"is a list of numbers; name one of them by its index, for example {key}.0"
        raise input_error(message, key=key)
    if unit is None or isinstance(value, BaseModel):
        raise input_error("is not a number of the machine", key=key)
    return Number(key, value, unit)


def value_at(parameters: MachineParameters, key: str) -> Any:
    """Return the value at a key path; None if only the SDF has a value."""
    return field_at(parameters, key)[0]
