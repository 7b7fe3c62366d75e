"""Unknown numbers of a machine: keys of its file with bounds, and the machine with values found."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error, problems_at
from wm_drake.parameters import Change, MachineParameters, Variation, apply, with_values
from wm_drake.parameters.keys import allowed_range
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.variation import number_at, range_of
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.problem import Unknown

SPAN = 1.5
"""Default bounds of an unknown: the number of the machine divided and multiplied by this."""

JOIN = "+"
"""Separator between keys whose numbers are equal and form one unknown."""


@dataclass(frozen=True)
class Sought:
    """An unknown: a variation with bounds.

    Attributes:
        variation: Numbers of the machine that are equal to the unknown.
    """

    variation: Variation
    unknown: Unknown

    @property
    def keys(self) -> tuple[str, ...]:
        """Key paths of the numbers."""
        return self.variation.keys

    @property
    def guess(self) -> float:
        """Start of the search; without one, the geometric mean of the bounds. [SI]"""
        return float(self.unknown.start or np.sqrt(self.unknown.lower * self.unknown.upper))


def sought_of(parameters: MachineParameters, keys: Sequence[str], bounds: str = "") -> Sought:
    """Return an unknown of a machine; the search uses its logarithm if the bounds are positive.

    Args:
        parameters: The machine; its number is the start value.
        keys: Key paths of numbers that are equal.
        bounds: Bounds of the search, ``LOW..HIGH`` or ``(LOW, HIGH) UNIT``. If empty, they are the
            machine's number divided and multiplied by `SPAN`.

    Raises:
        InputError: a key is unknown or not a number, the numbers have different units, or bounds
            are wrong, or are needed because the number is not positive.
    """
    numbers = tuple(number_at(parameters, key) for key in keys)
    for number in numbers:
        if number.is_table:
            raise input_error("is a table; an unknown is a number", key=number.key)
    first = numbers[0]
    if any(number.unit != first.unit for number in numbers):
        raise input_error(
            f"{', '.join(keys)} have different units; equal numbers need the same unit",
            key=first.key,
        )
    value = first.nominal
    if bounds:
        ends = range_of(bounds)
        if ends is None:
            example = f"(1, 2) {first.unit.shown}"
            message = f"'{bounds}' is not a range; write for example '{example}'"
            raise input_error(message, key=first.key)
        lower, upper = map(first.resolved, ends)
    elif value is None or value <= 0.0:
        message = "is not positive, so its range must be given; write KEY=LOW..HIGH"
        raise input_error(message, key=first.key)
    else:
        lower, upper = value / SPAN, value * SPAN
    for number in numbers:  # the search may go to either end
        allowed = allowed_range(parameters, number.key)
        if not (allowed.holds(lower) and allowed.holds(upper)):
            limits = " and ".join(f"{sign} {end:g}" for sign, end in allowed.limits())
            raise input_error(f"'{bounds}' is out of range; allowed is {limits}", key=number.key)
    start = value if value is not None and lower <= value <= upper else None
    name = JOIN.join(keys)
    return Sought(
        Variation(name, numbers, Change.VALUE, first.unit),
        Unknown(name, lower, upper, first.unit, start, logarithmic=lower > 0.0),
    )


def at_point(
    parameters: MachineParameters, sought: Sequence[Sought], values: FloatArray
) -> MachineParameters:
    """Return the machine with values of the unknowns, in SI units."""
    return apply(parameters, [s.variation for s in sought], map(float, values))


@dataclass(frozen=True)
class SoughtNumbers:
    """Numbers of a machine as the unknowns of a fit.

    Attributes:
        base: The machine.
        ending: Last word of the name of the machine with the values found.
    """

    base: MachineParameters
    sought: tuple[Sought, ...]
    ending: str

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Return the unknowns."""
        return tuple(one.unknown for one in self.sought)

    def parameters_at(self, point: FloatArray) -> MachineParameters:
        """Return the machine at a point. [SI]"""
        return at_point(self.base, self.sought, point)

    def known(self, points: FloatArray) -> FloatArray:
        """Return that nothing else is known of the numbers: no columns (k, 0)."""
        return np.empty((len(points), 0))

    def solved(self, fit: Fit, source: str) -> MachineParameters:
        """Return the machine with the values found and the source of each.

        A number that the data do not determine stays as it is.

        Args:
            fit: Fit whose first unknowns are these.
            source: Where the values come from.
        """
        values: dict[str, float] = {}
        sources: dict[str, str] = {}
        for one, estimate in zip(self.sought, fit.estimates, strict=False):
            if not estimate.determined:
                continue
            text = source
            if estimate.at_bound:
                text += f"; at the {estimate.at_bound} bound of the search"
            elif np.isfinite(estimate.lower):
                unit = one.unknown.unit
                lower, upper = (unit.from_si(value) for value in (estimate.lower, estimate.upper))
                text += f"; 95 % interval {lower:.4g} to {upper:.4g} {unit.shown}"
            values |= dict.fromkeys(one.keys, estimate.value)
            sources |= dict.fromkeys(one.keys, text)
        changed = with_values(self.base, values)
        name, sources = f"{self.base.name}_{self.ending}", {**changed.sources, **sources}
        return changed.model_copy(update={"name": name, "sources": sources})


def sought_in(parameters: MachineParameters, texts: Sequence[str]) -> tuple[Sought, ...]:
    """Return the unknowns of KEYS[=RANGE] texts of `--unknown`.

    Raises:
        InputError: a key or a range is wrong.
    """
    unknowns = []
    for text in texts:
        names, _, bounds = (part.strip() for part in text.partition("="))
        keys = [key.strip() for key in names.split(JOIN)]
        with problems_at("--unknown"):
            unknowns.append(sought_of(parameters, keys, bounds))
    return tuple(unknowns)
