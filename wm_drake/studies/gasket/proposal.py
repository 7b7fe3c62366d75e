"""Settings of the factors that may be proposed: the best ones on the fitted models.

The rule is that of `wm_drake.studies.proposal`. The candidates are the best level combinations,
moved while that helps, and each of them with one factor after the other back at level 0. The models
only choose. What is said about the setting is what its runs gave, with all loads of the machine.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.variation import number_at
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.parameters.varying import Varied
from wm_drake.report.formatting import significant
from wm_drake.report.quantity import SHARE
from wm_drake.simulation.measures.kind import Better
from wm_drake.studies.gasket.surface import Setting, model_rows
from wm_drake.studies.proposal import AFTER, BEFORE, Aim, worst_of

MOST_GRID = 20_000
"""Largest number of level combinations that are tried; of more, a random part is."""

CLIMBERS = 4
"""Number of the best level combinations from which single factors are moved."""


def goals_of(screening: xr.Dataset) -> dict[str, Better]:
    """Return which change of each response is an improvement, of those that have a goal."""
    goals = zip(screening.response.values.tolist(), screening.better.values.tolist(), strict=True)
    return {name: better for name, better in goals if better}


class Candidates:
    """Settings on the fitted models of a screening, as places from -1 to 1 of the factors."""

    def __init__(self, screening: xr.Dataset, models: xr.Dataset) -> None:
        """Compute the responses of level 0, and the ranges of the responses.

        Args:
            screening: As of `screening.run_screening`.
            models: As of `surface.models_of`.
        """
        goals, self._models = goals_of(screening), models
        self._count = len(models.factors)
        coefficients = models.coefficient.sel(response=list(goals))
        self._shape = (-1, *coefficients.shape[:2])
        self._coefficients = coefficients.values.reshape(-1, models.sizes["column"]).T
        self._goals = goals
        runs = screening.value.sel(response=list(goals)).values.reshape(-1, len(goals))
        self.aim = Aim(goals, runs, self._worst(np.zeros((1, self._count)))[0])

    def best(self) -> tuple[float, ...] | None:
        """Return the proposed setting; None if none is clearly better than level 0."""
        if not self.aim.can_choose:
            return None
        grid = _grid(self._count)
        ranked = grid[np.argsort(-self._value(grid), kind="stable")[:CLIMBERS]]
        climbed = np.array([self._climbed(places) for places in ranked])
        first = climbed[int(np.argmax(self._value(climbed)))]
        places = np.array(self._simpler(first))
        number = self.aim.proposed(self._worst(places), np.count_nonzero(places, axis=1).tolist())
        return None if number is None else tuple(float(round(x, 3)) for x in places[number])

    def _worst(self, places: FloatArray) -> FloatArray:
        """Return the responses of the worst load at settings (n, factors). (n, responses)"""
        rows = model_rows(places, interactions=self._models.interactions)
        return worst_of((rows @ self._coefficients).reshape(self._shape), self._goals)

    def _value(self, places: FloatArray) -> FloatArray:
        return self.aim.value(self._worst(places))

    def _climbed(self, places: FloatArray) -> FloatArray:
        """Return a setting after moves of one or two factors, as long as they help."""
        axes = np.eye(len(places))
        pairs = (axes[:, None] + axes, axes[:, None] - axes)
        moves = np.vstack([axes, -axes, *(p.reshape(-1, len(places)) for p in (*pairs, -pairs[0]))])
        for step in (0.5, 0.25, 0.125, 0.05):
            for _ in range(20):
                tried = np.clip(places + step * moves, -1.0, 1.0)
                values = self._value(tried)
                if values.max() <= float(self._value(places[None])[0]) + 1e-9:
                    break
                places = tried[int(np.argmax(values))]
        return places

    def _simpler(self, places: FloatArray) -> list[FloatArray]:
        """Return a setting, and the same with one factor after the other back at level 0.

        Each time it is the factor that costs least.
        """
        settings = [places]
        for _ in range(np.count_nonzero(places) - 1):
            at = np.flatnonzero(settings[-1])
            tried = np.array([np.where(np.arange(len(places)) == i, 0.0, settings[-1]) for i in at])
            settings.append(tried[int(np.argmax(self._value(tried)))])
        return settings


def _grid(count: int) -> FloatArray:
    """Return level combinations of factors; the first one is level 0."""
    if 3**count <= MOST_GRID:
        levels = np.indices((3,) * count).reshape(count, -1).T - 1.0
    else:
        levels = np.random.default_rng(0).integers(-1, 2, (MOST_GRID, count)).astype(float)
    return np.vstack([np.zeros(count), levels])


def text_at(machine: MachineParameters, factor: Varied, place: float) -> tuple[str, float]:
    """Return the value of a factor at a place, rounded to what a person would write, and its place.

    The text is what `--set` and `--check` take, in the unit of machine files, whatever the units of
    the reader. It has three digits, or more where three would be beyond an end of the range.

    Args:
        place: Place from -1 to 1.
    """
    value = factor.at_level(place)
    if factor.numbers:
        value = factor.numbers[0].si(factor.change, value)
        number = number_at(machine, factor.numbers[0].key)
        if number.is_table:
            assert number.nominal
            text = SHARE.text(value / number.nominal)
            return text, factor.level_of(text)
    unit, (low, _, high) = factor.first_unit, factor.first_levels
    shown = (significant(unit.from_si(value), digits) for digits in range(3, 17))
    texts = [f"{number} {unit.shown}".replace("−", "-") for number in shown]
    text = next((text for text in texts if low <= unit.number(text) <= high), texts[-1])
    return text, factor.level_of(text)


def sets_of(factor: Varied, text: str) -> dict[str, str]:
    """Return the values for `--set`, by symbol or key; empty if only a machine file can say it."""
    known, keys = gasket_entries().get(factor.name), factor.keys
    if known and set(known.keys) == set(keys):
        return {factor.name: text}
    if any(number.is_table for number in factor.numbers) or len(keys) > 1 or factor.entry.sets:
        return {}
    return dict.fromkeys(keys, text)


def settings_of(changes: Mapping[str, float], factors: Sequence[Varied]) -> list[Setting]:
    """Return level 0, and the setting of the changes if there are any.

    Args:
        changes: Place of each changed factor, by its name.
        factors: All factors.
    """
    zero = Setting(BEFORE, (0.0,) * len(factors))
    if not changes:
        return [zero]
    places = (changes.get(factor.name, 0.0) for factor in factors)
    return [zero, Setting(AFTER, tuple(places))]


def is_level_zero(machine: MachineParameters, factors: Sequence[Varied]) -> bool:
    """Return whether a machine is level 0 of its factors, but for rounding."""
    for factor in factors:
        for number in factor.numbers:
            original = number_at(machine, number.key)
            middle = factor.levels_of(number)[1]
            if original.is_table != number.is_table:
                return False
            if not np.isclose(middle, original.nominal or 0.0, rtol=1e-6):
                return False
    return True
