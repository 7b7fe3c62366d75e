"""Numbers of a machine that are sums of factors times numbers that vary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wm_drake.errors import InputError, Problem, nearest_names
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, dimension, from_base, split, to_base
from wm_drake.parameters.vary_file import Known

COMPONENTS = {"x": 0, "y": 1, "z": 2}


class Summand(NamedTuple):
    """What a number that varies adds to sums.

    Attributes:
        sets: Factors by key path; none if no sum has it.
        unit: Unit of its value, as written.
    """

    sets: Mapping[str, str]
    unit: str


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


def sums_of(
    machine: MachineParameters, parts: Mapping[str, Summand], known: Mapping[str, Known]
) -> tuple[Sum, ...]:
    """Return the numbers of a machine that entries and known numbers set as sums.

    Args:
        machine: The machine, with the numbers of the SDF that the entries name.
        parts: Each number that varies, by name.
        known: Numbers that are known, by name.

    Raises:
        InputError: the machine does not have a number, or a factor does not fit it.
    """
    owners = {name: part.sets for name, part in parts.items()}
    owners |= {name: fixed.sets for name, fixed in known.items()}
    if not any(owners.values()):
        return ()
    sizes = {key: (value, unit) for key, value, unit in quantities(machine)}
    problems, sums = list[Problem](), list[Sum]()
    for key in dict.fromkeys(key for sets in owners.values() for key in sets):
        first = next(name for name, sets in owners.items() if key in sets)
        try:
            sums.append(_sum(key, sizes, tuple(parts.values()), known))
        except ValueError as error:
            problems.append(Problem("", first, f"'{key}' {error}"))
    if problems:
        raise InputError(problems)
    return tuple(sums)


def _sum(
    key: str,
    sizes: Mapping[str, tuple[Any, Unit]],
    parts: Sequence[Summand],
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
    factors = np.zeros((len(parts), size))
    for index, part in enumerate(parts):
        if key in part.sets:
            factors[index] = _factor(part.sets[key], part.unit, unit, size, is_list)
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


def measured(text: str) -> tuple[float, str]:
    """Return one number in SI, and the unit in which it is written.

    Raises:
        ValueError: the text is not one number with a unit.
    """
    magnitudes, unit, is_list = split(text)
    if is_list:
        raise ValueError(f"'{text}' is a list; it must be one number with a unit")
    return to_base(magnitudes[0], unit), unit
