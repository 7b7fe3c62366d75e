"""Numbers of a machine file on which the packed numbers of the engine depend by straight lines.

An importer may change these between two steps: the packed numbers follow by their slopes, which
are computed once, at export. A number on which a packed number depends in another way, or together
with a second number, is left out.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.engines.compiled.packing import pack_elements
from wm_drake.errors import InputError
from wm_drake.model.machine import Machine
from wm_drake.parameters import Load, MachineParameters, with_values
from wm_drake.parameters.keys import AllowedRange, allowed_range, quantities
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit

GROUPS = (
    "gasket",
    "bushings",
    "bushing_types",
    "spring_types",
    "springs",
    "damper_types",
    "dampers",
    "telescopic_dampers",
    "elements",
)
"""Parts of a machine file whose numbers may be tuned."""
TOLERANCE = 1e-9
"""Largest relative deviation of a packed number from its straight line."""
CHANGES = (0.02, 0.05)
"""Relative changes at which the slopes are computed and checked."""
CHANGE_OF_ZERO = 1e-3
"""Change of a number that is zero, in its SI unit."""
LEAST = 1e-9
"""Distance from an end that a number must not reach, in its SI unit."""


@dataclass(frozen=True)
class Tunable:
    """A number of the machine file that may change between two steps.

    Attributes:
        value: Its value in SI units.
        minimum, maximum: Bounds; None without one.
        rows, slopes: Indices of the packed numbers (from the first element on) that depend on it,
            and how much each of them grows with it. (k,)
    """

    key: str
    value: float
    unit: Unit
    minimum: float | None
    maximum: float | None
    rows: np.ndarray
    slopes: FloatArray


def tunables(machine: Machine, gasket: bool = True) -> list[Tunable]:
    """Return the numbers of a machine that may be tuned.

    Args:
        gasket: False for a machine whose gasket is taken out.
    """
    context = machine.diagram.CreateDefaultContext()
    start = machine.parameters

    def packed(values: Mapping[str, float]) -> FloatArray:
        parameters = with_values(start, values)
        load = Load(unbalances=())
        return pack_elements(
            machine.set_up(
                load, context=context, parameters=parameters, gasket=gasket, systems=False
            )
        )[0]

    base = packed({})
    candidates = [
        tunable
        for key, value, unit in _numbers(start)
        if (tunable := _tunable(start, (key, value, unit), base, packed))
    ]
    return _independent(candidates, base, packed)


def _numbers(parameters: MachineParameters) -> Iterator[tuple[str, float, Unit]]:
    for group in GROUPS:
        for key, value, unit in quantities(getattr(parameters, group), f"{group}."):
            if isinstance(value, float):
                yield key, value, unit


def _tunable(
    start: MachineParameters, number: tuple[str, float, Unit], base: FloatArray, packed: Any
) -> Tunable | None:
    """Return a number with its slopes; None if nothing depends on it, or not by a straight line."""
    key, value, unit = number
    steps = [change * value if value else change * CHANGE_OF_ZERO for change in CHANGES]
    try:
        near, far = (packed({key: value + step}) - base for step in steps)
    except InputError:  # the number is bound to others, or to this one value
        return None
    rows = np.flatnonzero(near)
    slopes = near[rows] / steps[0]
    deviation = np.abs(far[rows] - slopes * steps[1])
    is_straight = np.all(deviation <= TOLERANCE * (np.abs(base[rows]) + np.abs(far[rows])))
    if not len(rows) or not is_straight or np.count_nonzero(far) != len(rows):
        return None
    ends = ends_of(allowed_range(start, key))
    lower, upper = (end if math.isfinite(end) else None for end in ends)
    return Tunable(key, value, unit, lower, upper, rows, far[rows] / steps[1])


def ends_of(allowed: AllowedRange) -> tuple[float, float]:
    """Return the ends of an allowed range; one that is excluded is `LEAST` inside. [SI]"""
    low = allowed.low if allowed.low_is_in else allowed.low + LEAST
    return low, allowed.high if allowed.high_is_in else allowed.high - LEAST


def _independent(candidates: list[Tunable], base: FloatArray, packed: Any) -> list[Tunable]:
    """Return the numbers whose effects add up when all change at once."""
    while candidates:
        changes = {t.key: t.value + CHANGES[1] * (t.value or CHANGE_OF_ZERO) for t in candidates}
        expected = base.copy()
        for tunable in candidates:
            expected[tunable.rows] += tunable.slopes * (changes[tunable.key] - tunable.value)
        actual = packed(changes)
        wrong = np.abs(actual - expected) > 10.0 * TOLERANCE * (np.abs(actual) + np.abs(base))
        mixed = set(np.flatnonzero(wrong).tolist())
        if not mixed:
            return candidates
        candidates = [t for t in candidates if not mixed & set(t.rows.tolist())]
    return []
