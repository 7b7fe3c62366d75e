"""Numbers that vary, for one machine: their values, and the machine at their values."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.parameters.keys import quantities, with_values
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import (
    Share,
    Unit,
    dimension,
    from_base,
    split,
    to_base,
    with_base,
)
from wm_drake.parameters.variation import Change, Number, change_of, common_form, number_at
from wm_drake.parameters.vary import LAUNDRY, Entry
from wm_drake.parameters.vary_file import Known

LEVELS = ("low", "middle", "high")
"""Values at the levels -1, 0 and 1."""

TABLES = ("linear", "scaled")
"""What a value does to a stiffness that is given as a table.

"linear": a number takes the place of the table, the nominal stiffness for 100 %, as in [B].
"scaled": the forces of the table are scaled, so that the curve keeps its shape.
"""

COMPONENTS = {"x": 0, "y": 1, "z": 2}


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

    def at_level(self, level: float) -> float:
        """Return the value at a level, or at a place between two levels, from -1 to 1."""
        return float(np.interp(level, (-1.0, 0.0, 1.0), [self.at[name] for name in LEVELS]))

    def level_of(self, text: str) -> float:
        """Return the place from -1 to 1 of a value.

        Args:
            text: Value with a unit, or in percent or as distance of the machine's number.

        Raises:
            InputError: the text is not a value, or is outside the range of the levels.
        """
        number = self.numbers[0] if self.numbers else Number(self.name, None, self.unit)
        value, levels = number.resolved(text), self.first_levels
        low, _, high = levels
        slack = 1e-9 * (high - low)
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
class Sum:
    """A number or column of the machine that is a sum of factors times values.

    Attributes:
        key: Key path of the value; of the whole vector if it is one component of it.
        component: Index of the component of a vector; None for the whole value.
        factors: (numbers that vary, 1 or points) factors of each of them: one for a number, several
            for the column of a table.
        constant: (1 or points) what the known numbers add.
        reasons: Texts of the known numbers that enter.
        is_list: Whether the value is the column of a table.
    """

    key: str
    component: int | None
    factors: FloatArray
    constant: FloatArray
    reasons: tuple[str, ...]
    is_list: bool

    def changes(self, values: FloatArray) -> dict[str, Any]:
        """Return the sum at values of all numbers that vary, by key path. [SI]"""
        sums = self.constant + values @ self.factors
        if np.count_nonzero(self.factors) > sums.size:
            # 15 digits, so that the sum is short in a file
            sums = np.array([float(f"{number:.15g}") for number in sums])
        key = self.key if self.component is None else f"{self.key}.{self.component}"
        return {key: tuple(map(float, sums)) if self.is_list else float(sums[0])}


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
    def keys(self) -> list[str]:
        """Key paths of all numbers that change."""
        return list(dict.fromkeys(key for varied in self.every for key in varied.keys))

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
        problems = list[Problem]()
        for varied in self.every:
            try:
                for value in varied.needed("low", "high", study=study):
                    slopes = [n for n in varied.numbers if n.is_table and n.takes_numbers]
                    with_values(self.machine, {n.key: n.si(varied.change, value) for n in slopes})
                    with_values(self.machine, varied.changes(value))
            except InputError as error:
                problems += _of_entry(varied.name, error)
        if problems:
            raise InputError(problems)
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
    every, problems = list[Varied](), _owned_twice(entries)
    for name, entry in entries.items():
        try:
            every.append(_varied(machine, name, entry, tables))
        except InputError as error:
            problems += _of_entry(name, error)
    if problems:
        raise InputError(problems)
    every.sort(key=lambda varied: varied.is_laundry)
    return Varying(machine, tuple(every), _sums(machine, every, known or {}))


def _of_entry(name: str, error: InputError) -> list[Problem]:
    """Return problems of an entry, with the key of a number in the message."""
    return [
        Problem("", name, p.message if p.key in ("", name) else f"{p.key}: {p.message}")
        for p in error.problems
    ]


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


def measured(text: str) -> tuple[float, str]:
    """Return one number in SI, and the unit in which it is written.

    Raises:
        ValueError: the text is not one number with a unit.
    """
    magnitudes, unit, is_list = split(text)
    if is_list:
        raise ValueError(f"'{text}' is a list; it must be one number with a unit")
    return to_base(magnitudes[0], unit), unit


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


def _sums(
    machine: MachineParameters, every: Sequence[Varied], known: Mapping[str, Known]
) -> tuple[Sum, ...]:
    """Return the numbers of a machine that entries and known numbers set as sums.

    Raises:
        InputError: the machine does not have a number, or a factor does not fit it.
    """
    owners = {varied.name: varied.entry.sets for varied in every}
    owners |= {name: fixed.sets for name, fixed in known.items()}
    if not any(owners.values()):
        return ()
    sizes = {key: (value, unit) for key, value, unit in quantities(machine)}
    problems, sums = list[Problem](), list[Sum]()
    for key in dict.fromkeys(key for sets in owners.values() for key in sets):
        first = next(name for name, sets in owners.items() if key in sets)
        try:
            sums.append(_sum(key, sizes, every, known))
        except ValueError as error:
            problems.append(Problem("", first, f"'{key}' {error}"))
    if problems:
        raise InputError(problems)
    return tuple(sums)


def _sum(
    key: str,
    sizes: Mapping[str, tuple[Any, Unit]],
    every: Sequence[Varied],
    known: Mapping[str, Known],
) -> Sum:
    name, _, last = key.rpartition(".")
    component = None
    if key not in sizes and last in COMPONENTS and name in sizes:
        component = COMPONENTS[last]
    elif key in sizes:
        name = key
    else:
        raise ValueError(f"is not a number of the machine{nearest_names(key, sizes)}")
    value, unit = sizes[name]
    is_list = isinstance(value, tuple) and component is None
    size = len(value) if is_list else 1
    factors = np.zeros((len(every), size))
    for index, varied in enumerate(every):
        if key in varied.entry.sets:
            factors[index] = _factor(varied.entry.sets[key], varied.unit.shown, unit, size, is_list)
    constant, reasons = np.zeros(size), []
    for fixed_name, fixed in known.items():
        if key in fixed.sets:
            amount, written = measured(fixed.value)
            constant = constant + amount * _factor(fixed.sets[key], written, unit, size, is_list)
            shown = f"{from_base(amount, written):.10g} {written}".rstrip()
            reasons.append(f"{fixed_name} {shown} ({fixed.source})")
    return Sum(name, component, factors, constant, tuple(reasons), is_list)


def _factor(text: str, of_value: str, unit: Unit, size: int, is_list: bool) -> FloatArray:
    """Return the factors of a value in a number of the machine, one for each point of a table.

    Args:
        of_value: Unit of the value.
        unit: Unit of the number.
    """
    magnitudes, written, has_several = split(text)
    if has_several != is_list or len(magnitudes) != size:
        needed = f"a list of {size} factors" if is_list else "one factor"
        raise ValueError(f"needs {needed}, not {len(magnitudes)}")
    if dimension(of_value) * dimension(written) != dimension(unit.si):
        given = " times ".join(filter(None, [of_value, written])) or "a pure number"
        raise ValueError(f"needs a unit such as {unit.shown}, but {given} is not of this kind")
    return np.array([to_base(number, written) for number in magnitudes])
