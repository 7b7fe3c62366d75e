"""The design study: search, chosen designs, check of robust designs, envelopes of the front."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy import stats

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.tolerances import fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.records import Record, sample_period
from wm_drake.studies.design.problem import Goal, MachineDesigns, Run
from wm_drake.studies.design.search import Problem, SearchResult, SearchSettings, search_front
from wm_drake.studies.design.surrogate import search_with_surfaces
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.shares import CONFIDENCE, Percentile, percentile_of

SEARCHES = {"genetic": search_front, "surfaces": search_with_surfaces}
"""Searches by name."""

COMPROMISE = "compromise"
"""Name of the chosen design that is nearest to the best of all objectives."""


@dataclass(frozen=True)
class ParetoFront:
    """Result of a design study.

    Attributes:
        objectives, constraints: Values of the front, in units for reading. (n, m) and (n, k)
        nominal_objectives: Those of the machine itself, moved into the bounds. (m,)
        chosen: Numbers of chosen designs, from 0, by name: best Dx, ..., compromise.
    """

    designs: MachineDesigns
    search: SearchResult
    objectives: FloatArray
    constraints: FloatArray
    nominal_objectives: FloatArray
    chosen: dict[str, int]

    def machine(self, number: int) -> MachineParameters:
        """Return the machine of a design of the front."""
        return self.designs.machine_at(self.search.designs[number])

    def goals(self, number: int) -> tuple[list[tuple[Goal, float]], list[tuple[Goal, float]]]:
        """Return objectives and constraints of a design with their values, in units for reading."""
        objectives = zip(self.designs.objectives, self.objectives[number].tolist(), strict=True)
        constraints = zip(self.designs.constraints, self.constraints[number].tolist(), strict=True)
        return list(objectives), list(constraints)

    def variables(self, number: int) -> list[tuple[str, float | str, str]]:
        """Return name, value and unit for reading of each variable of a design."""
        places = zip(self.designs.dimensions, self.search.designs[number].tolist(), strict=True)
        return [(dimension.name, *dimension.shown(place)) for dimension, place in places]


def run_designs(
    designs: MachineDesigns, run: Run, settings: SearchSettings, search: str = "genetic"
) -> ParetoFront:
    """Search the Pareto front of the designs of a machine.

    Args:
        search: Name in `SEARCHES`.
    """
    problem = Problem(
        lambda x: designs.costs(x, run),
        designs.nominal(),
        len(designs.objectives),
        len(designs.constraints),
    )
    result = SEARCHES[search](problem, settings)
    nominal, _ = designs.evaluate(designs.nominal()[None], run)
    return ParetoFront(
        designs,
        result,
        _values(designs.objectives, result.objectives),
        _values(designs.constraints, result.constraints),
        nominal[0],
        chosen_designs(designs.objectives, result.objectives),
    )


def chosen_designs(goals: tuple[Goal, ...], costs: FloatArray) -> dict[str, int]:
    """Return the best design of each objective, and a compromise, by name.

    The compromise has the smallest distance to the best of all objectives, which are scaled to the
    range of the front.
    """
    if not len(costs):
        return {}
    chosen = {
        f"best {g.given.quantity}": int(np.argmin(c)) for g, c in zip(goals, costs.T, strict=True)
    }
    if len(goals) > 1:
        low, high = costs.min(axis=0), costs.max(axis=0)
        scaled = (costs - low) / np.where(high > low, high - low, 1.0)
        chosen[COMPROMISE] = int(np.argmin(np.linalg.norm(scaled, axis=1)))
    return chosen


def _values(goals: tuple[Goal, ...], costs: FloatArray) -> FloatArray:
    """Return values in units for reading from what the search made small."""
    columns = []
    for goal, column in zip(goals, costs.T, strict=True):
        signed = column if goal.is_small_better else -column
        columns.append(signed if np.isnan(goal.limit) else signed + goal.limit)
    return np.column_stack(columns) if columns else np.empty((len(costs), 0))


FRESH = 4
"""Fresh samples for each sample of the search."""

OTHER_SEED = 1_000_003
"""Added to the seed of the search for the fresh samples."""


@dataclass(frozen=True)
class Promise:
    """One goal of a chosen design, as the search saw it and on fresh samples.

    Attributes:
        promised: Its value over the samples of the search, with the 95 % interval. [unit for
            reading]
        fresh: The same over fresh samples.
        is_kept: Whether the fresh value is not worse than the worse end of the promised interval;
            None for the worst of the samples, which grows with their number and has no interval.
    """

    design: str
    goal: Goal
    promised: Percentile
    fresh: Percentile
    is_kept: bool | None


def promises(front: ParetoFront, run: Run, seed: int) -> list[Promise]:
    """Return the promises of the chosen designs of a robust front; none of a nominal one."""
    designs, scores = front.designs, front.designs.scores
    if scores is None or not front.chosen:
        return []
    numbers = sorted(set(front.chosen.values()))
    points = front.search.designs[numbers]
    count, size = scores.shape
    fresh, _ = base_samples(size, FRESH * count, seed + OTHER_SEED)
    before = designs.scenario_values(points, run)
    after = replace(designs, scores=fresh).scenario_values(points, run)
    promises = []
    for name, number in front.chosen.items():
        row = numbers.index(number)
        for goal, old, new in zip(designs.goals, before, after, strict=True):
            if goal.response is not None:
                promised, kept = summary_of(goal, old[row]), summary_of(goal, new[row])
                promises.append(Promise(name, goal, promised, kept, _is_kept(goal, promised, kept)))
    return promises


def _is_kept(goal: Goal, promised: Percentile, fresh: Percentile) -> bool | None:
    if goal.given.over == "worst":
        return None
    if goal.is_small_better:
        return bool(fresh.value <= promised.upper)
    return bool(fresh.value >= promised.lower)


def summary_of(goal: Goal, values: FloatArray) -> Percentile:
    """Return the value of a goal over samples of one design, with its 95 % interval.

    A run that failed has NaN, and so has then the value.

    Args:
        values: By sample. (n,) [unit for reading]
    """
    how = goal.given.over
    value = float(goal.over(values[None])[0])
    if not np.isfinite(values).all() or how == "worst":
        return Percentile(value, np.nan, np.nan)
    if how == "mean":
        quantile = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, len(values) - 1))
        width = quantile * float(np.std(values, ddof=1)) / np.sqrt(len(values))
        return Percentile(value, value - width, value + width)
    share = fraction(how, "over")
    estimate = percentile_of(values, 100.0 * (share if goal.is_small_better else 1.0 - share))
    return Percentile(value, estimate.lower, estimate.upper)


Histories: TypeAlias = Callable[[Sequence[Case], Callable[[int, Record], None]], None]
"""Function that runs cases and calls its second argument with number and record of each."""

INTERVALS = 120
"""Number of intervals of time, each with the largest value of an envelope in it."""


@dataclass(frozen=True)
class Envelopes:
    """Envelopes of the filtered displacements, the largest over the loads of each design.

    Attributes:
        time: Middle of each interval. (n,) [s]
        designs: (designs, sensors, n) [m] NaN behind the end of a run that failed.
        nominal: Those of the machine itself. (sensors, n) [m]
        of: What was run for each design, in words.
    """

    time: FloatArray
    sensors: tuple[str, ...]
    designs: FloatArray
    nominal: FloatArray
    of: str


def front_envelopes(front: ParetoFront, histories: Histories) -> Envelopes:
    """Return the envelopes of all designs of a front and of the machine itself."""
    designs = front.designs
    points = [*front.search.designs, designs.nominal()]
    runs = [designs.shown_runs(designs.machine_at(p), f"{i}") for i, p in enumerate(points, 1)]
    owners = [number for number, cases in enumerate(runs) for _ in cases]
    sensors = tuple(designs.parameters.sensors)
    largest = np.full((len(points), len(sensors), INTERVALS), np.nan)
    duration = max(case.profile.duration for cases in runs for case in cases)

    def add(number: int, record: Record) -> None:
        owner = owners[number]
        largest[owner] = np.fmax(largest[owner], envelope_of(record, duration))

    histories([case for cases in runs for case in cases], add)
    time = (np.arange(INTERVALS) + 0.5) * duration / INTERVALS
    return Envelopes(time, sensors, largest[:-1], largest[-1], designs.shown)


def envelope_of(record: Record, duration: float) -> FloatArray:
    """Return the largest value of the envelopes in each interval of time. (sensors, n) [m]

    Args:
        duration: Duration that is divided into `INTERVALS`. [s]
    """
    sensors = envelopes(record)
    size = np.maximum(np.abs(sensors.upper.values), np.abs(sensors.lower.values))
    answer = np.full((size.shape[1], INTERVALS), np.nan)
    per_interval = duration / sample_period(record) / INTERVALS
    ends = np.round(np.arange(INTERVALS + 1) * per_interval).astype(int)
    for index, (begin, end) in enumerate(itertools.pairwise(ends)):
        part = size[begin : max(end, begin + 1)]
        if len(part):
            answer[:, index] = part.max(axis=0)
    return answer
