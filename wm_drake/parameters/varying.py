"""Numbers that vary, for one machine: their values, and the machine at their values."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.keys import with_values
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.sums import Sum, Summand, measured, sums_of
from wm_drake.parameters.units import Share, Unit, dimension, with_base
from wm_drake.parameters.variation import Change, Number, change_of, common_form, number_at
from wm_drake.parameters.vary import LAUNDRY, NEEDED, Entry
from wm_drake.parameters.vary_file import Known

Given = TypeVar("Given")
Result = TypeVar("Result")

LEVELS = ("low", "middle", "high")
"""Values at the levels -1, 0 and 1."""

TABLES = ("linear", "scaled")
"""What a value does to a stiffness that is given as a table.

"linear": a number takes the place of the table, the nominal stiffness for 100 %, as in [B].
"scaled": the forces of the table are scaled, so that the curve keeps its shape.
"""

OF_CORNERS = {"uniform": 3.0**-0.5, "triangular": 0.5}
"""Deviation of a distribution over that of the values that it needs, all alike likely."""

ROUNDING = 1e-9
"""Part of a range by which a value may be beyond an end, since its unit was converted."""


@dataclass(frozen=True)
class Varied:
    """A number that varies, for one machine.

    Attributes:
        name: Name of the entry.
        entry: What the user wrote.
        numbers: Numbers of the machine that follow the value; none for the laundry, and for a
            number that enters sums.
        change: How the value changes them.
        unit: Unit of the value for reading.
        at: Values by the names of `vary.PLACES`, and `deviation`. [1 for percent, else SI]
    """

    name: str
    entry: Entry
    numbers: tuple[Number, ...]
    change: Change
    unit: Unit
    at: Mapping[str, float]

    @property
    def keys(self) -> tuple[str, ...]:
        """Key paths of what it changes."""
        return tuple(number.key for number in self.numbers) or tuple(self.entry.sets)

    @property
    def is_laundry(self) -> bool:
        """Whether it is a number of the laundry."""
        return self.name in LAUNDRY

    @property
    def is_of_load(self) -> bool:
        """Whether it is the laundry or a number of a load, which no tolerance of a part limits."""
        return self.is_laundry or all(key.startswith("loads.") for key in self.keys)

    @property
    def nominal(self) -> float:
        """Value at which the machine is as it was; that of the first number if they differ."""
        if self.change is Change.VALUE:
            first = self.numbers[0].nominal if self.numbers else self.at.get("start")
            return float(first or 0.0)
        return 1.0 if self.change is Change.PERCENT else 0.0

    def needed(self, *names: str, study: str) -> list[float]:
        """Return values that a study needs.

        Args:
            names: Names of `at`.
            study: What needs them, for the message.

        Raises:
            InputError: the entry lacks one; the message has the line to add.
        """
        missing = [name for name in names if name not in self.at]
        if missing:
            lines = " and ".join(f"'{name}: {self._example(name)}'" for name in missing)
            message = f"{study} needs {' and '.join(missing)}; add {lines}"
            raise input_error(message, key=self.name)
        return [self.at[name] for name in names]

    def prior(self, *, study: str) -> tuple[float, float]:
        """Return mean and standard deviation of its distribution; `study` as for `needed`.

        Raises:
            InputError: it has none.
        """
        if self.entry.kind not in OF_CORNERS:
            mean, deviation = self.needed("mean", "deviation", study=study)
            return mean, deviation
        corners = [self.at[name] for name in NEEDED[self.entry.kind]]
        return float(np.mean(corners)), float(np.std(corners)) * OF_CORNERS[self.entry.kind]

    def at_level(self, level: float) -> float:
        """Return the value at a level, between two levels, or beyond -1 and 1 along their line."""
        low, middle, high = (self.at[name] for name in LEVELS)
        if level < -1.0:
            return low + (level + 1.0) * (middle - low)
        if level > 1.0:
            return high + (level - 1.0) * (high - middle)
        return float(np.interp(level, (-1.0, 0.0, 1.0), (low, middle, high)))

    def level_of(self, text: str, *, beyond: bool = False) -> float:
        """Return the place of a value, from -1 to 1.

        Args:
            text: Value with a unit, or in percent or as distance of the machine's number.
            beyond: Whether it may be outside the range of the levels.

        Raises:
            InputError: the text is not a value, or is outside the range.
        """
        number = self.numbers[0] if self.numbers else Number(self.name, None, self.unit)
        value, levels = number.resolved(text), self.first_levels
        low, middle, high = levels
        if beyond and not low <= value <= high:
            end, side = (low, -1.0) if value < low else (high, 1.0)
            return float(side + (value - end) / (side * (end - middle)))
        slack = ROUNDING * (high - low)
        if not low - slack <= value <= high + slack:
            ends = f"{number.unit.reading(low)} to {number.unit.reading(high)}"
            message = f"'{text}' is outside the range of factor {self.name}, {ends}"
            raise input_error(message, key=number.key)
        return float(np.interp(value, levels, (-1.0, 0.0, 1.0)))

    def at_place(self, place: Any) -> Any:
        """Return the value at a place from 0 to 1 between the ends."""
        return self.at["low"] + place * (self.at["high"] - self.at["low"])

    @property
    def first_unit(self) -> Unit:
        """Unit of its first number, or of its value if no number follows it."""
        return self.numbers[0].unit if self.numbers else self.unit

    @property
    def first_levels(self) -> tuple[float, ...]:
        """Its first number at the levels -1, 0 and 1, or its value if no number follows it. [SI]"""
        if self.numbers:
            return self.levels_of(self.numbers[0])
        return tuple(self.at[name] for name in LEVELS)

    def levels_of(self, number: Number) -> tuple[float, ...]:
        """Return a number at the levels -1, 0 and 1, in SI; of a table, its stiffness."""
        return tuple(number.si(self.change, self.at[name]) for name in LEVELS)

    def changes(self, value: float) -> dict[str, Any]:
        """Return new values of the machine by key path; those of sums are not among them."""
        return {number.key: number.changed(self.change, value) for number in self.numbers}

    def reading(self, name: str) -> str:
        """Return a value by its name in `at`, as text for reading."""
        value = self.at[name]
        if self.change is not Change.DISTANCE or name == "deviation":
            return self.unit.reading(value)
        sign = "-" if value < 0.0 else "+"
        return f"nominal {sign} {self.unit.reading(abs(value))}" if value else "nominal"

    def _example(self, name: str) -> str:
        shares = {"low": 0.5, "high": 1.5, "deviation": 0.1}
        if self.change is Change.DISTANCE:
            some = self.unit.reading(self.unit.to_si(1.0))
            signs = {"low": f"nominal - {some}", "high": f"nominal + {some}", "deviation": some}
            return signs.get(name, "nominal")
        if self.change is Change.PERCENT:
            return f"{100.0 * shares.get(name, 1.0):g} %"
        middle = self.at.get("mean", self.at.get("middle", self.nominal or 1.0))
        return self.unit.reading(shares.get(name, 1.0) * abs(middle))


@dataclass(frozen=True)
class Varying:
    """The numbers of a machine that vary, and the machine at their values.

    Attributes:
        machine: The machine. It contains all numbers that change.
        every: The numbers that vary; those of the laundry are the last ones.
        sums: Numbers of the machine that are sums.
    """

    machine: MachineParameters
    every: tuple[Varied, ...]
    sums: tuple[Sum, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers that vary."""
        return tuple(varied.name for varied in self.every)

    @property
    def by_name(self) -> dict[str, Varied]:
        """Return the numbers that vary, by name."""
        return {varied.name: varied for varied in self.every}

    def machine_at(self, values: Iterable[float]) -> MachineParameters:
        """Return the machine with a value of each number that varies.

        Raises:
            InputError: a value is not allowed.
        """
        return with_values(self.machine, self.changes(values))

    def changes(self, values: Iterable[float]) -> dict[str, Any]:
        """Return new values of the machine by key path, at a value of each number that varies."""
        given, changes = [float(value) for value in values], dict[str, Any]()
        for varied, value in zip(self.every, given, strict=True):
            changes |= varied.changes(value)
        for total in self.sums:
            changes |= total.changes(np.array(given))
        return changes

    def at_levels(self, levels: Iterable[float]) -> MachineParameters:
        """Return the machine at levels, or at places between them, from -1 to 1."""
        pairs = zip(self.every, levels, strict=True)
        return self.machine_at(varied.at_level(level) for varied, level in pairs)

    def origins(self) -> Iterator[tuple[str, list[int], tuple[str, ...]]]:
        """Yield the key path of what changes, the numbers that enter, and texts of known ones."""
        for index, varied in enumerate(self.every):
            yield from ((number.key, [index], ()) for number in varied.numbers)
        for total in self.sums:
            yield total.key, np.flatnonzero(total.factors.any(axis=1)).tolist(), total.reasons

    def with_levels(self, study: str) -> "Varying":
        """Return the numbers, after checking that the machine can have each level of each.

        Args:
            study: What needs levels, for messages.

        Raises:
            InputError: an entry has no low or high, or the machine does not allow a level.
        """

        def check(varied: Varied) -> None:
            for value in varied.needed("low", "high", study=study):
                slopes = [n for n in varied.numbers if n.is_table and n.takes_numbers]
                with_values(self.machine, {n.key: n.si(varied.change, value) for n in slopes})
                with_values(self.machine, varied.changes(value))

        each(check, self.by_name)
        return self


def varying(
    machine: MachineParameters,
    entries: Mapping[str, Entry],
    known: Mapping[str, Known] | None = None,
    tables: str = "scaled",
) -> Varying:
    """Return the numbers of a machine that entries declare.

    Args:
        machine: The machine, with the numbers of the SDF that the entries name.
        entries: Entries by name, with keys or sets.
        known: Numbers that are known and enter sums, by name.
        tables: What a value does to a table, one of `TABLES`.

    Raises:
        InputError: with one problem for each entry that is wrong; its key is the name of the entry.
    """
    read = {name: partial(_varied, machine, name, entry, tables) for name, entry in entries.items()}
    every = each(lambda varied: varied(), read, _owned_twice(entries))
    every.sort(key=lambda varied: varied.is_laundry)
    parts = {varied.name: Summand(varied.entry.sets, varied.unit.shown) for varied in every}
    return Varying(machine, tuple(every), sums_of(machine, parts, known or {}))


def each(
    function: Callable[[Given], Result], parts: Mapping[str, Given], others: Iterable[Problem] = ()
) -> list[Result]:
    """Return what a function gives for each part.

    Args:
        function: Function of a part.
        parts: Parts by name, such as numbers that vary by the names of their entries.
        others: Problems that were found before.

    Raises:
        InputError: with the problems of all parts. Their keys are the names; the key of a number is
            in the message.
    """
    results, problems = list[Result](), [*others]
    for name, part in parts.items():
        try:
            results.append(function(part))
        except InputError as error:
            for p in error.problems:
                message = p.message if p.key in ("", name) else f"{p.key}: {p.message}"
                problems.append(Problem("", name, message))
    if problems:
        raise InputError(problems)
    return results


def _owned_twice(entries: Mapping[str, Entry]) -> list[Problem]:
    """Return a problem for each key that two entries change, if not by sums alone."""
    problems, owner = [], dict[str, str]()
    sums = {key for entry in entries.values() for key in entry.sets}
    for name, entry in entries.items():
        for key in entry.keys:
            if owner.setdefault(key, name) != name or key in sums:
                other = owner[key] if owner[key] != name else "an entry with sets"
                message = f"{key}: belongs to {other} already; a key may be in one entry only"
                problems.append(Problem("", name, message))
    return problems


def _varied(machine: MachineParameters, name: str, entry: Entry, tables: str) -> Varied:
    """Return an entry for a machine.

    Raises:
        InputError: the machine does not have a number, or a value is wrong.
    """
    numbers = tuple(
        number_at(machine, key) for key in entry.keys if key not in LAUNDRY or name != key
    )
    if tables == "linear":
        numbers = tuple(
            replace(n, original=n.nominal) if n.is_table and n.takes_numbers else n for n in numbers
        )
    if entry.sets:
        change, (unit, at) = Change.VALUE, _sizes(entry)
    elif name in LAUNDRY:
        laundry = (Number(name, None, LAUNDRY[name]),)
        (change, at), unit = common_form(laundry, entry.texts), LAUNDRY[name]
    else:
        change, at = common_form(numbers, entry.texts)
        unit = Share() if change is Change.PERCENT else numbers[0].unit
    if entry.deviation is not None:
        at = at | {"deviation": _deviation(entry, numbers, change, unit)}
    return Varied(name, entry, numbers, change, unit, _in_order(at))


def _deviation(entry: Entry, numbers: tuple[Number, ...], change: Change, unit: Unit) -> float:
    """Return the standard deviation, in percent if the mean is, else a value with a unit."""
    form = Change.PERCENT if change is Change.PERCENT else Change.VALUE
    of_value = numbers[0].unit if numbers else unit
    text = entry.deviation or ""
    given, deviation = change_of(text, of_value, "deviation")
    if given is not form or deviation <= 0.0:
        what = "in percent" if form is Change.PERCENT else "a value with a unit"
        raise input_error(f"'{text}' is not {what} above 0", key="deviation")
    return deviation


def _sizes(entry: Entry) -> tuple[Unit, dict[str, float]]:
    """Return the unit of an entry that enters sums, and its values by name. [SI]"""
    try:
        sizes = {name: measured(text) for name, text in entry.texts.items()}
    except ValueError as error:
        raise input_error(str(error)) from None
    if not sizes:
        raise input_error("has no values; add low and high, or bounds")
    written = sizes.get("low", next(iter(sizes.values())))[1]
    for name, (_, unit) in sizes.items():
        if dimension(unit) != dimension(written):
            message = (
                f"{name} is in {unit or 'pure numbers'}, others in {written or 'pure numbers'}"
            )
            raise input_error(f"{message}; all need one dimension")
    return with_base(written), {name: value for name, (value, _) in sizes.items()}


def _in_order(at: dict[str, float]) -> dict[str, float]:
    """Return values with the middle, after checking that they rise."""
    if "low" in at and "high" in at:
        at = {"middle": 0.5 * (at["low"] + at["high"])} | at
    strict = [at[name] for name in LEVELS if name in at]
    order = [at[name] for name in ("low", "mode", "high") if name in at]
    if not (
        all(a < b for a, b in itertools.pairwise(strict))
        and all(a <= b for a, b in itertools.pairwise(order))
    ):
        raise input_error("does not rise; low must be below high, with middle and mode between")
    if "start" in at and not at.get("low", -np.inf) <= at["start"] <= at.get("high", np.inf):
        raise input_error("the start is outside the bounds")
    return at
