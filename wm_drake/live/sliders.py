"""Numbers of a machine with the range in which a page moves each."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from wm_drake.live.parts import part_and_group
from wm_drake.parameters import MachineParameters, quantities, source_of
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.keys import AllowedRange, allowed_range, is_index
from wm_drake.parameters.plausibility import UsualRange, usual_range
from wm_drake.parameters.units import Unit
from wm_drake.parameters.variation import Number, number_at, value_at

NOT_MOVED = ("gravity",)
"""Numbers that a built machine cannot change."""

ABOUT = {"mm": 50.0, "deg": 45.0}
"""Half width of the slider of a place or an angle, by display unit."""

LAST = ("bodies.", "frames.", "cabinet.", "imperfections.", "step")
"""Numbers that are listed behind all others."""

VECTORS = ("position", "centre_of_mass", "angles")
"""Quantities whose three entries have the names x, y and z."""


@dataclass(frozen=True)
class Slider:
    """A number of a machine with a range, in which a page moves it.

    Attributes:
        number: The number; of a vector, one of its entries; of a curve, its nominal stiffness.
        low, high: Ends of the slider, in the display unit.
        allowed, usual: Ranges; None if there is no usual one.
        source: Where the value comes from.
        is_entry: Whether it is an entry of a vector.
        needs: Why the machine allows no other value while all others stay, "" if it does.
    """

    number: Number
    low: float
    high: float
    allowed: AllowedRange
    usual: UsualRange | None
    source: str
    is_entry: bool
    needs: str = ""

    @property
    def key(self) -> str:
        """Return the key path of the number."""
        return self.number.key

    @property
    def unit(self) -> Unit:
        """Return the unit of the number."""
        return self.number.unit

    @property
    def step(self) -> float:
        """Return one hundredth of the slider, in SI units."""
        return (self.high - self.low) / 100.0 / self.unit.from_si(1.0)

    def for_page(self, places: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
        """Return the number as the page shows it.

        `short` is unique enough for a narrow column, `factor` the SI value of its unit.
        """
        part, group = part_and_group(self.key, places)
        *parents, name = self.key.split(".")
        if self.is_entry:
            vector = parents.pop()
            name = f"{vector} {'xyz'[int(name)] if vector in VECTORS else int(name) + 1}"
        parents = [f"no. {int(part) + 1}" if is_index(part) else part for part in parents]
        label, last = name.replace("_", " "), " ".join(parents[-1:]).replace("_", " ")
        if last.startswith("no. "):
            last = f"{parents[-2].rstrip('s')} {last.removeprefix('no. ')}"
        if parents and parents[0].endswith("_types"):  # the name of a type does not say its kind
            last = f"{parents[0].removesuffix('_types').replace('_', ' ')} {last}"
        if self.needs:
            group = f"{group}, without slider"
        if parents[:1] == ["frames"]:  # a name of a frame is no word
            last, label = f"{group}:", label.removeprefix("position ")
        return {
            "key": self.key,
            "part": part,
            "group": group,
            "label": label,
            "short": f"{last} {label}".strip(),
            "unit": self.unit.label,
            "factor": 1.0 / self.unit.from_si(1.0),
            "value": self.unit.from_si(float(self.number.nominal or 0.0)),
            "low": self.low,
            "high": self.high,
            "allowed": self._allowed_in_words(),
            "usual": f"{self.usual.low:g} to {self.usual.high:g}" if self.usual else "",
            "source": self.source,
            "needs": self.needs,
        }

    def _allowed_in_words(self) -> str:
        limits = self.allowed.limits()
        signs = {">=": "≥", "<=": "≤"}
        ends = (f"{signs.get(sign, sign)} {self.unit.from_si(end):g}" for sign, end in limits)
        return " and ".join(ends)


def sliders_of(parameters: MachineParameters) -> dict[str, Slider]:
    """Return a slider for each number of a machine that can be moved, by key path.

    Args:
        parameters: The machine, with the values of the SDF that are to be moved too.
    """
    listed = sorted(_sliders(parameters), key=lambda slider: slider.key.startswith(LAST))
    return {slider.key: slider for slider in listed}


def _sliders(parameters: MachineParameters) -> Iterator[Slider]:
    for key, value, unit in with_curves(parameters):
        if key in NOT_MOVED:
            continue
        allowed, usual = allowed_range(parameters, key), usual_range(key)
        source, is_tuple = source_of(parameters, key), isinstance(value, tuple)
        entries = [(f"{key}.{i}", v) for i, v in enumerate(value)] if is_tuple else [(key, value)]
        for path, entry in entries:
            low, high = _ends(unit.from_si(entry), unit, allowed, usual)
            number = number_at(parameters, path) if not is_tuple else Number(path, entry, unit)
            yield Slider(number, low, high, allowed, usual, source, is_tuple)


def with_curves(parameters: MachineParameters) -> Iterator[tuple[str, Any, Unit]]:
    """Yield key path, value [SI] and unit of each number; a curve is its nominal stiffness.

    That is the slope of its first 20 %. A curve that is flat everywhere is left out.
    """
    curves = set()
    for key, value, unit in quantities(parameters):
        curve = key.rpartition(".")[0]
        if not isinstance(value, tuple) or not isinstance(value_at(parameters, curve), CurveTable):
            yield key, value, unit
        elif curve not in curves:
            curves.add(curve)
            number = number_at(parameters, curve)
            if number.nominal:
                yield curve, number.nominal, number.unit


def _ends(
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
