"""Unknown numbers of a machine: keys of its file with bounds, and the machine with values found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error, problems_at
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.keys import allowed_range
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.variation import Change, number_at
from wm_drake.parameters.vary import Entry, entries_of_texts
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.parameters.varying import Varied, Varying
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.problem import Unknown

SPAN = 1.5
"""Default bounds of an unknown: the number of the machine divided and multiplied by this."""


@dataclass(frozen=True)
class FreeNumbers:
    """Numbers of a machine as the unknowns of a fit.

    Attributes:
        varying: The machine, with explicit values for all that may change, and the numbers.
        unknowns: The numbers, each with the unit in which it is written, bounds, and what is known
            of it: where searches start, or a prior.
        ending: Last word of the name of the machine with the values found.
    """

    varying: Varying
    unknowns: tuple[Unknown, ...]
    ending: str = "calibrated"

    @property
    def base(self) -> MachineParameters:
        """Return the machine."""
        return self.varying.machine

    @property
    def names(self) -> list[str]:
        """Names of the numbers."""
        return list(self.varying.names)

    @property
    def lower(self) -> FloatArray:
        """Lower bounds. [SI]"""
        return np.array([unknown.lower for unknown in self.unknowns])

    @property
    def upper(self) -> FloatArray:
        """Upper bounds. [SI]"""
        return np.array([unknown.upper for unknown in self.unknowns])

    @property
    def guesses(self) -> FloatArray:
        """Starts of the search; without one, the geometric mean of the bounds. [SI]"""
        return np.array([u.start or np.sqrt(u.lower * u.upper) for u in self.unknowns])

    def parameters_at(self, point: FloatArray) -> MachineParameters:
        """Return the machine at a point. [SI]

        Raises:
            InputError: a value of the machine is not allowed.
        """
        return self.varying.machine_at(point)

    def known(self, points: FloatArray) -> FloatArray:
        """Return the residuals (k, m) of what else is known at points (k, p): here nothing."""
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
        for one, estimate in zip(self.varying.every, fit.estimates, strict=False):
            if not estimate.determined:
                continue
            text = source
            if estimate.at_bound:
                text += f"; at the {estimate.at_bound} bound of the search"
            elif np.isfinite(estimate.lower):
                unit = one.unit
                lower, upper = (unit.from_si(value) for value in (estimate.lower, estimate.upper))
                text += f"; 95 % interval {lower:.4g} to {upper:.4g} {unit.shown}"
            values |= dict.fromkeys(one.keys, estimate.value)
            sources |= dict.fromkeys(one.keys, text)
        changed = with_values(self.base, values)
        name, sources = f"{self.base.name}_{self.ending}", {**changed.sources, **sources}
        return changed.model_copy(update={"name": name, "sources": sources})


def free_number(parameters: MachineParameters, name: str, entry: Entry) -> tuple[Varied, Unknown]:
    """Return a number that varies, and it as an unknown.

    The search uses its logarithm if the bounds are positive.

    Args:
        parameters: The machine; its number is the start value.
        name: Name of the unknown.
        entry: Keys of numbers that are equal, and their bounds. Without bounds, they are the
            machine's number divided and multiplied by `SPAN`. With a mean and a deviation, the
            unknown has a prior, and is not searched by its logarithm.

    Raises:
        InputError: a key is unknown or not a number, the numbers have different units, or bounds
            are wrong, or are needed because the number is not positive.
    """
    numbers = tuple(number_at(parameters, key) for key in entry.keys)
    if not numbers:
        raise input_error("sets sums; allowed in a file of --vary", key=name)
    for number in numbers:
        if number.is_table:
            raise input_error("is a table; an unknown is a number", key=number.key)
    first = numbers[0]
    if any(number.unit != first.unit for number in numbers):
        raise input_error(
            f"{', '.join(entry.keys)} have different units; equal numbers need the same unit",
            key=first.key,
        )
    at = {place: first.resolved(text) for place, text in entry.texts.items()}
    value = at.get("mean", first.nominal)
    if "low" not in at or "high" not in at:
        if value is None or value <= 0.0:
            why = "is in the SDF only" if value is None else "is not positive"
            example = f"{first.key}=(1, 4) {first.unit.shown}".rstrip()
            message = f"{why}, so its range must be given; write for example '{example}'"
            raise input_error(message, key=first.key)
        at = {"low": value / SPAN, "high": value * SPAN} | at
    for number in numbers:  # the search may go to either end
        allowed = allowed_range(parameters, number.key)
        if not (allowed.holds(at["low"]) and allowed.holds(at["high"])):
            limits = " and ".join(f"{sign} {end:g}" for sign, end in allowed.limits())
            ends = f"{first.unit.reading(at['low'])} to {first.unit.reading(at['high'])}"
            raise input_error(f"{ends} is out of range; allowed is {limits}", key=number.key)
    varied = Varied(name, entry, numbers, Change.VALUE, first.unit, at)
    start = at.get("start", value)
    start = start if start is not None and at["low"] <= start <= at["high"] else None
    prior = None
    if entry.deviation is not None:
        size = first.resolved(entry.deviation)  # percents are those of the machine's number
        prior = (at["mean"], size)
    is_log = prior is None and at["low"] > 0.0
    unknown = Unknown(name, at["low"], at["high"], first.unit, start, is_log, prior)
    return varied, unknown


def free_numbers(
    parameters: MachineParameters, entries: Mapping[str, Entry], ending: str
) -> FreeNumbers:
    """Return the unknowns of entries by name, as of `free_number`."""
    pairs = [free_number(parameters, name, entry) for name, entry in entries.items()]
    every, unknowns = zip(*pairs, strict=True) if pairs else ((), ())
    return FreeNumbers(Varying(parameters, every), unknowns, ending)


def free_numbers_of_texts(
    parameters: MachineParameters, texts: Sequence[str], ending: str
) -> FreeNumbers:
    """Return the unknowns of NAME[=VALUES] texts of `--unknown`.

    Raises:
        InputError: a key or a range is wrong.
    """
    entries = entries_of_texts(texts, gasket_entries(), "--unknown")
    with problems_at("--unknown"):
        return free_numbers(parameters, entries, ending)
