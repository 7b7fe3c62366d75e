"""Propose one setting of the factors: found on the fitted models, then run beside the machine.

The setting has the largest predicted smallest gap of all loads, among those whose other responses
exceed those of level 0 by at most `MOST_LOSS`; of each response the worst load counts. Without a
gap among the responses it is the setting with the largest desirability: the geometric mean over the
responses of a number from 0 at the worst to 1 at the best value that any run had, as on the page.
Factors that hardly matter then go back to level 0, so that few parts change.

The models only choose. What is said about the setting is what its runs gave, with all loads of the
machine. `Compared` is all that a page shows next to a screening.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import GASKET_FACTORS, FactorLevels, MachineParameters, load_factors
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.variation import number_at
from wm_drake.report.formatting import significant
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.gasket.screening import NOT_PUBLISHED, Published, Screening
from wm_drake.studies.gasket.study import LevelZero
from wm_drake.studies.gasket.surface import Check, Setting, Surfaces, model_rows

MOST_LOSS = 0.1
"""Largest rise of a response above that of level 0, as a share of it. Choice of the project."""

SMALL_SHARE = 0.1
"""Share of the gain that a factor must have to be changed. Choice of the project."""

LEAST_GAIN = 0.02
"""Gain of the aim, as a share of its range over the runs, from which a setting is proposed."""

MOST_GRID = 20_000
"""Largest number of level combinations that are tried; of more, a random part is."""

CLIMBERS = 4
"""Number of the best level combinations from which single factors are moved."""


@dataclass(frozen=True)
class Aim:
    """What a proposed setting shall reach."""

    screening: Screening
    surfaces: Surfaces

    @cached_property
    def names(self) -> list[str]:
        """Names of the responses that have a goal and vary."""
        return list(self.ends)

    @cached_property
    def ends(self) -> dict[str, FloatArray]:
        """Best and worst value of any run, of the responses that have a goal and vary.

        Values are signed so that less is better. (2,)
        """
        ends = {}
        for name in filter(self._goal, self.screening.names):
            frames = self.screening.responses.values.values()
            values = np.concatenate([frame[name].to_numpy() for frame in frames])
            signed = self._goal(name) * values
            best, worst = np.nanmin(signed), np.nanmax(signed)
            if worst > best:
                ends[name] = np.array([best, worst])
        return ends

    def _goal(self, name: str) -> float:
        """Return 1 if less of a response is better, -1 if more is, 0 if neither."""
        meaning = self.screening.responses.meanings.get(name)
        return {"smaller": 1.0, "larger": -1.0, "": 0.0}[meaning.goal if meaning else ""]

    def worst(self, places: FloatArray) -> FloatArray:
        """Return the responses of the worst load, signed so that less is better. (n, responses)

        Args:
            places: Settings. (n, factors)
        """
        rows = model_rows(places, interactions=self.surfaces.interactions)
        columns = []
        for name in self.names:
            of_loads = [rows @ self.surfaces.coefficients[x, name] for x in self.screening.loads]
            columns.append(np.max(self._goal(name) * np.array(of_loads), axis=0))
        return np.stack(columns, axis=-1)

    def value(self, places: FloatArray) -> FloatArray:
        """Return how good settings are: 0 to about 1, below 0 with a loss elsewhere. (n,)"""
        worst, zero = self.worst(places), self.worst(np.zeros((1, places.shape[1])))
        excess = np.max((worst - zero) / np.maximum(np.abs(zero), 1e-12), axis=1) - MOST_LOSS
        ends = np.array(list(self.ends.values()))
        parts = (ends[:, 1] - worst) / (ends[:, 1] - ends[:, 0])
        if GAP in self.names:
            aim = parts[:, self.names.index(GAP)]
        else:
            aim = np.exp(np.mean(np.log(np.clip(parts, 1e-6, 1.0)), axis=1))
        return np.where(excess > 1e-9, -1.0 - excess, aim)


def best_places(aim: Aim) -> tuple[float, ...] | None:
    """Return the best setting, factors that hardly matter at level 0; None if none is better."""
    count = len(aim.surfaces.factors)
    if not aim.names:
        return None
    grid = _grid(count)
    ranked = grid[np.argsort(-aim.value(grid), kind="stable")[:CLIMBERS]]
    climbed = [_climbed(aim, places) for places in ranked]
    best = max(climbed, key=lambda places: float(aim.value(places[None])[0]))
    gain = _gain(aim, best)
    if gain < LEAST_GAIN:
        return None
    return tuple(float(round(x, 3)) for x in _with_few_changes(aim, best, (1 - SMALL_SHARE) * gain))


def _gain(aim: Aim, places: FloatArray) -> float:
    return float(aim.value(places[None])[0] - aim.value(np.zeros((1, len(places))))[0])


def _grid(count: int) -> FloatArray:
    """Return level combinations of factors; the first one is level 0."""
    if 3**count <= MOST_GRID:
        levels = np.indices((3,) * count).reshape(count, -1).T - 1.0
    else:
        levels = np.random.default_rng(0).integers(-1, 2, (MOST_GRID, count)).astype(float)
    return np.vstack([np.zeros(count), levels])


def _climbed(aim: Aim, places: FloatArray) -> FloatArray:
    """Return a setting after moves of one or two factors, as long as they help."""
    axes = np.eye(len(places))
    pairs = (axes[:, None] + axes, axes[:, None] - axes)
    moves = np.vstack([axes, -axes, *(p.reshape(-1, len(places)) for p in (*pairs, -pairs[0]))])
    for step in (0.5, 0.25, 0.125, 0.05):
        for _ in range(20):
            tried = np.clip(places + step * moves, -1.0, 1.0)
            values = aim.value(tried)
            if values.max() <= float(aim.value(places[None])[0]) + 1e-9:
                break
            places = tried[int(np.argmax(values))]
    return places


def _with_few_changes(aim: Aim, places: FloatArray, least_gain: float) -> FloatArray:
    """Return a setting with as many factors at level 0 as `least_gain` allows."""
    while True:
        at = [i for i, place in enumerate(places) if place != 0.0]
        tried = np.array([np.where(np.arange(len(places)) == i, 0.0, places) for i in at])
        gains = [_gain(aim, row) for row in tried]
        if len(at) < 2 or max(gains) < least_gain:
            return places
        places = tried[int(np.argmax(gains))]


@dataclass(frozen=True)
class ProposedChange:
    """Change of one factor.

    Attributes:
        text: Its new value, as `--set` and `--check` take it.
        place: The same as a place from -1 to 1.
    """

    factor: FactorLevels
    text: str
    place: float

    @property
    def sets(self) -> dict[str, str]:
        """Values for `--set`, by symbol or key; empty if only a machine file can say it."""
        known, keys = load_factors(GASKET_FACTORS).get(self.factor.name), self.factor.settings[1]
        if known and set(known.keys) == set(keys):
            return {self.factor.name: self.text}
        if any(isinstance(value, CurveTable) for value in keys.values()) or len(keys) > 1:
            return {}
        return dict.fromkeys(keys, self.text)


def change_of(machine: MachineParameters, factor: FactorLevels, place: float) -> ProposedChange:
    """Return the change of a factor to a place, rounded to what a person would write.

    Args:
        place: Place from -1 to 1.
    """
    key, numbers = next(iter(factor.numbers.items()))
    number, value = number_at(machine, key), float(np.interp(place, (-1.0, 0.0, 1.0), numbers))
    if isinstance(number.original, CurveTable):
        assert number.nominal
        percent = round(100.0 * value / number.unit.from_si(number.nominal))
        value = 0.01 * percent * number.unit.from_si(number.nominal)
        text = f"{percent} %"
    else:
        text = f"{significant(value, 3)} {number.unit.shown}".replace("−", "-")
        value = float(f"{value:.3g}")
    return ProposedChange(factor, text, float(np.interp(value, numbers, (-1.0, 0.0, 1.0))))


@dataclass(frozen=True)
class Proposal:
    """A setting that is proposed, with its runs.

    Attributes:
        changes: Changes of factors; none if no setting is better.
        check: Level 0, and the setting if there is one, predicted and run with all loads.
        studied: Names of the loads of the study; the other ones are in the runs only.
        is_machine: Whether level 0 is the machine.
        command: Command that runs the setting; "" if there is none.
    """

    changes: tuple[ProposedChange, ...]
    check: Check
    studied: tuple[str, ...]
    is_machine: bool
    command: str

    @property
    def loads(self) -> list[str]:
        """Names of the loads of the runs."""
        return list(self.check.responses.values)

    @property
    def left_out(self) -> list[str]:
        """Names of the loads of the machine that the study leaves out."""
        return [load for load in self.loads if load not in self.studied]

    def frame(self) -> pd.DataFrame:
        """Return one row per load and response: before, predicted, and after by runs."""
        table = self.check.frame()
        columns = ["load", "response", "unit"]
        zero = table[table["setting"] == ZERO].rename(columns={"run": "before"})
        shown = zero[[*columns, "before"]].reset_index(drop=True)
        if not self.changes:
            return shown
        new = table[table["setting"] != ZERO].reset_index(drop=True)
        shown = shown.join(new[["predicted", "half_width", "run"]])
        return shown.rename(columns={"run": "after"})

    def gaps(self, column: str) -> Mapping[str, float]:
        """Return the smallest gap by load, of a column of `frame`. [mm] Empty without a gap."""
        frame = self.frame()
        rows = frame[frame["response"] == GAP]
        return dict(zip(map(str, rows["load"]), map(float, rows[column]), strict=True))

    def as_json(self) -> dict[str, Any]:
        """Return the proposal for JSON: values by symbol or key, command, runs."""
        return {
            "set": {change.factor.name: change.text for change in self.changes},
            "line_to_copy": self.command,
            "loads_left_out": self.left_out,
            "runs": self.frame().to_dict("records"),
        }

    def worst(self, screening: Screening) -> pd.DataFrame:
        """Return one row per response that has a goal: the loads of its worst values, and these."""
        rows, frame = [], self.frame()
        for name in screening.names:
            of = frame[frame["response"] == name].set_index("load")
            meaning = screening.responses.meanings.get(name)
            if meaning is None or not meaning.goal:
                continue
            pick = "idxmax" if meaning.goal == "smaller" else "idxmin"
            row: dict[str, object] = {"response": name, "unit": of["unit"].iloc[0]}
            for column in [c for c in ("before", "after") if c in of and of[c].notna().any()]:
                load = getattr(of[column], pick)()
                row |= {column: of[column][load], f"load_{column}": load}
                if column == "after":
                    row |= {c: of[c][load] for c in ("predicted", "half_width")}
            rows.append(row)
        return pd.DataFrame(rows)


ZERO = "level 0"
"""Name of the setting without any change."""


def settings_of(
    changes: tuple[ProposedChange, ...], factors: tuple[FactorLevels, ...]
) -> list[Setting]:
    """Return level 0 and the setting of the changes, if there are any."""
    zero = Setting(ZERO, (0.0,) * len(factors))
    if not changes:
        return [zero]
    places = {change.factor.name: change.place for change in changes}
    text = ", ".join(f"{change.factor.name}={change.text}" for change in changes)
    return [zero, Setting(text, tuple(places.get(factor.name, 0.0) for factor in factors))]


def is_level_zero(machine: MachineParameters, factors: tuple[FactorLevels, ...]) -> bool:
    """Return whether a machine is level 0 of its factors, but for rounding."""
    for factor in factors:
        for key, value in factor.settings[1].items():
            original = number_at(machine, key).original
            if isinstance(original, CurveTable) != isinstance(value, CurveTable):
                return False
            middle = value.nominal_stiffness if isinstance(value, CurveTable) else value
            if not np.isclose(middle, number_at(machine, key).nominal or 0.0, rtol=1e-6):
                return False
    return True


@dataclass(frozen=True)
class Compared:
    """Results that are shown next to those of a screening.

    Attributes:
        published: Published results; empty if nothing is compared.
        level_zero: Responses of the machine and of level 0 with each treatment of tables; None if
            no factor has a table.
        check: Runs of chosen settings next to the fitted model; None if there are none.
        proposal: Setting that is proposed, with its runs; None if none was sought.
    """

    published: Published = NOT_PUBLISHED
    level_zero: LevelZero | None = None
    check: Check | None = None
    proposal: Proposal | None = None


NOT_COMPARED = Compared()
"""A screening that is compared with nothing."""
