"""All numbers of a machine that a page can move: key path, unit, value, ranges, group."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from wm_drake.errors import InputError, Problem
from wm_drake.parameters import MachineParameters, quantities, source_of
from wm_drake.parameters.allowed import AllowedRange, allowed_range
from wm_drake.parameters.keys import is_index
from wm_drake.parameters.plausibility import UsualRange, usual_range
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Unit

NOT_MOVED = ("gravity",)
"""Numbers that a built machine cannot change."""

ABOUT = {"mm": 50.0, "deg": 45.0}
"""Half width of the slider of a place or an angle, by display unit."""

LAST = ("bodies.", "frames.", "cabinet.", "imperfections.", "step")
"""Numbers that are listed behind all others."""

VECTORS = ("position", "centre_of_mass", "angles")
"""Quantities whose three entries have the names x, y and z."""


@dataclass(frozen=True)
class Number:
    """One number of a machine.

    Attributes:
        key: Key path; of a vector or a table, that of one of its entries.
        value: Value in SI units.
        unit: Its unit.
        low, high: Ends of the slider, in the display unit.
        allowed, usual: Ranges; None if there is no usual one.
        source: Where the value comes from.
        is_entry: Whether it is an entry of a vector or a table.
    """

    key: str
    value: float
    unit: Unit
    low: float
    high: float
    allowed: AllowedRange
    usual: UsualRange | None
    source: str
    is_entry: bool

    @property
    def step(self) -> float:
        """One hundredth of the slider, in SI units."""
        return (self.high - self.low) / 100.0 / self.unit.from_si(1.0)

    def in_si(self, text: str) -> float:
        """Return a text with a unit as an SI value.

        Raises:
            InputError: the text is not a number with a fitting unit.
        """
        try:
            return float(TypeAdapter(Annotated[float, self.unit]).validate_python(text))
        except ValidationError as error:
            found = problems_of(error, BaseModel)
            raise InputError(Problem("", self.key, p.message) for p in found) from None

    def for_page(self) -> dict[str, Any]:
        """Return the number as the page shows it; `short` is unique enough for a narrow column."""
        *parents, name = self.key.split(".")
        if self.is_entry:
            vector = parents.pop()
            name = f"{vector} {'xyz'[int(name)] if vector in VECTORS else int(name) + 1}"
        parents = [f"no. {int(part) + 1}" if is_index(part) else part for part in parents]
        label, last = name.replace("_", " "), " ".join(parents[-1:]).replace("_", " ")
        if last.startswith("no. "):
            last = f"{parents[-2].rstrip('s')} {last.removeprefix('no. ')}"
        return {
            "key": self.key,
            "group": " · ".join(parents).replace("_", " ") or "machine",
            "label": label,
            "short": f"{last} {label}".strip(),
            "unit": _plain(self.unit),
            "value": self.unit.from_si(self.value),
            "low": self.low,
            "high": self.high,
            "allowed": self._allowed_in_words(),
            "usual": f"{self.usual.low:g} to {self.usual.high:g}" if self.usual else "",
            "source": self.source,
        }

    def _allowed_in_words(self) -> str:
        allowed, words = self.allowed, []
        if math.isfinite(allowed.low):
            end = self.unit.from_si(allowed.low)
            words.append(f"{'≥' if allowed.low_is_in else '>'} {end:g}")
        if math.isfinite(allowed.high):
            end = self.unit.from_si(allowed.high)
            words.append(f"{'≤' if allowed.high_is_in else '<'} {end:g}")
        return " and ".join(words)


def numbers_of(parameters: MachineParameters) -> dict[str, Number]:
    """Return the numbers of a machine that can be moved, by key path.

    Args:
        parameters: The machine, with the values of the SDF that are to be moved too.
    """
    found = sorted(_numbers(parameters), key=lambda number: number.key.startswith(LAST))
    return {number.key: number for number in found}


def _numbers(parameters: MachineParameters) -> Iterator[Number]:
    for key, value, unit in quantities(parameters):
        if key in NOT_MOVED:
            continue
        allowed, usual = allowed_range(parameters, key), usual_range(key)
        source, is_tuple = source_of(parameters, key), isinstance(value, tuple)
        entries = [(f"{key}.{i}", v) for i, v in enumerate(value)] if is_tuple else [(key, value)]
        for path, entry in entries:
            low, high = _slider(unit.from_si(entry), unit, allowed, usual)
            yield Number(path, entry, unit, low, high, allowed, usual, source, is_tuple)


def _slider(
    shown: float, unit: Unit, allowed: AllowedRange, usual: UsualRange | None
) -> tuple[float, float]:
    """Return the ends of a slider, in the display unit.

    They are half and twice the value, or some distance on both sides of a place or an angle. A
    number that is zero gets a tenth of its usual range.
    """
    if unit.shown in ABOUT and math.isinf(allowed.low):
        return shown - ABOUT[unit.shown], shown + ABOUT[unit.shown]
    if shown == 0.0:
        high = 0.1 * usual.high if usual is not None else 1.0
        return (0.0 if allowed.low == 0.0 else -high), high
    return min(0.5 * shown, 2.0 * shown), max(0.5 * shown, 2.0 * shown)


def _plain(unit: Unit) -> str:
    return unit.shown.replace("*", " ")
