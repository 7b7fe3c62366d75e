"""The design study: search, chosen designs, check of robust designs, envelopes of the front."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from scipy import stats

from wm_drake.parameters.tolerances import fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import TIME, Quantity
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.records import Record, sample_period
from wm_drake.studies.design.problem import DesignGoal, MachineDesigns
from wm_drake.studies.design.search import DesignProblem, SearchSettings, search_front
from wm_drake.studies.design.surrogate import search_with_surfaces
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.shares import CONFIDENCE, Percentile, percentile_of

SEARCHES = {"genetic": search_front, "surfaces": search_with_surfaces}
"""Searches by name."""

COMPROMISE = "compromise"
"""Name of the chosen design that is nearest to the best of all objectives."""


EVALUATIONS = Quantity("evaluated designs", decimals=0)
HYPERVOLUME = Quantity("hypervolume")
ENVELOPE = Quantity("largest envelope", Unit("m", "mm"))


def run_designs(
    designs: MachineDesigns,
    experiment: Experiment,
    settings: SearchSettings,
    search: str = "genetic",
) -> xr.Dataset:
    """Search the Pareto front of the designs of a machine.

    Args:
        search: Name in `SEARCHES`.

    Returns:
        Over `design`, numbers from 1: objectives and constraints by the names of the goals, the
        variables, and the `place` of the design in the unit cube, over `dimension` too. Over
        `generation`: `evaluations` and `hypervolume`. Over no dimension: the objectives of the
        machine itself, moved into the bounds, as `nominal_Dx`. Attribute `chosen`: numbers of
        chosen designs by name: best Dx, ..., compromise.
    """
    problem = DesignProblem(
        lambda x: designs.costs(x, experiment),
        designs.nominal(),
        len(designs.objectives),
        len(designs.constraints),
    )
    result = SEARCHES[search](problem, settings)
    nominal, _ = designs.evaluate(designs.nominal()[None], experiment)
    costs = [*result.objectives.T, *result.constraints.T]
    evaluations, volumes = zip(*result.history, strict=True)
    places = zip(designs.dimensions, result.designs.T, strict=True)
    return xr.Dataset(
        {
            **{
                goal.name: goal.quantity.variable("design", _values(goal, cost))
                for goal, cost in zip(designs.goals, costs, strict=True)
            },
            **{dimension.name: dimension.variable(place) for dimension, place in places},
            "place": (("design", "dimension"), result.designs),
            "evaluations": EVALUATIONS.variable("generation", evaluations),
            "hypervolume": HYPERVOLUME.variable("generation", volumes),
            **{
                f"nominal_{goal.name}": goal.quantity.variable((), goal.quantity.to_si(value))
                for goal, value in zip(designs.objectives, nominal[0], strict=True)
            },
        },
        {"design": np.arange(len(result.designs)) + 1},
        {"chosen": chosen_designs(designs.objectives, result.objectives)},
    )


def chosen_designs(goals: tuple[DesignGoal, ...], costs: FloatArray) -> dict[str, int]:
    """Return the number of the best design of each objective, and of a compromise, by name.

    The compromise has the smallest distance to the best of all objectives, which are scaled to the
    range of the front.
    """
    if not len(costs):
        return {}
    chosen = {
        f"best {g.given.quantity}": 1 + int(np.argmin(c))
        for g, c in zip(goals, costs.T, strict=True)
    }
    if len(goals) > 1:
        low, high = costs.min(axis=0), costs.max(axis=0)
        scaled = (costs - low) / np.where(high > low, high - low, 1.0)
        chosen[COMPROMISE] = 1 + int(np.argmin(np.linalg.norm(scaled, axis=1)))
    return chosen


def _values(goal: DesignGoal, cost: FloatArray) -> FloatArray:
    """Return SI values of a goal from what the search made small."""
    signed = cost if goal.is_small_better else -cost
    return goal.quantity.to_si(signed if np.isnan(goal.limit) else signed + goal.limit)


FRESH = 4
"""Fresh samples for each sample of the search."""

OTHER_SEED = 1_000_003
"""Added to the seed of the search for the fresh samples."""


def promises(
    designs: MachineDesigns, front: xr.Dataset, experiment: Experiment, seed: int
) -> xr.Dataset:
    """Return what the chosen designs of a robust front promise, and keep on fresh samples.

    Returns:
        Over `chosen`, names of designs, and `samples`, `promised` or `fresh`: each goal by its
        name, and the ends of its 95 % interval, as `Dx_lower` and `Dx_upper`. Over `chosen`:
        whether the promise is kept, `Dx_kept`, "yes", "no", or "" for the worst of the samples,
        which grows with their number and has no interval; and whether it `Dx_is_broken`. Empty for
        a nominal front.
    """
    scores, chosen = designs.scores, front.attrs["chosen"]
    if scores is None or not chosen:
        return xr.Dataset()
    numbers = sorted(set(chosen.values()))
    points = front.place.sel(design=numbers).values
    count, size = scores.shape
    fresh, _ = base_samples(size, FRESH * count, seed + OTHER_SEED)
    before = designs.scenario_values(points, experiment)
    after = replace(designs, scores=fresh).scenario_values(points, experiment)
    rows = [numbers.index(number) for number in chosen.values()]
    data = xr.Dataset(coords={"chosen": list(chosen), "samples": ["promised", "fresh"]})
    for goal, old, new in zip(designs.goals, before, after, strict=True):
        if goal.response is not None:
            pairs = [(summary_of(goal, old[row]), summary_of(goal, new[row])) for row in rows]
            data = data.assign(_promise(goal, pairs))
    return data


def _promise(goal: DesignGoal, pairs: Sequence[tuple[Percentile, Percentile]]) -> dict[str, Any]:
    """Return the variables of a goal in the dataset of promises.

    Args:
        pairs: Promised and fresh value of each chosen design. [unit for reading]
    """
    quantity, words = goal.quantity, goal.quantity.words
    ends = {
        goal.name: ("value", words),
        f"{goal.name}_lower": ("lower", f"{words}, 95 % from"),
        f"{goal.name}_upper": ("upper", f"{words}, 95 % to"),
    }
    kept = [_is_kept(goal, *pair) for pair in pairs]
    texts = {None: "", True: "yes", False: "no"}
    return {
        **{
            name: quantity.named(shown).variable(
                ("chosen", "samples"),
                quantity.to_si([[getattr(one, field) for one in pair] for pair in pairs]),
            )
            for name, (field, shown) in ends.items()
        },
        f"{goal.name}_kept": ("chosen", [texts[one] for one in kept]),
        f"{goal.name}_is_broken": ("chosen", [one is False for one in kept]),
    }


def _is_kept(goal: DesignGoal, promised: Percentile, fresh: Percentile) -> bool | None:
    """Return whether a fresh value is not worse than the worse end of the promised interval.

    It is None for the worst of the samples.
    """
    if goal.given.over == "worst":
        return None
    if goal.is_small_better:
        return bool(fresh.value <= promised.upper)
    return bool(fresh.value >= promised.lower)


def summary_of(goal: DesignGoal, values: FloatArray) -> Percentile:
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


def front_envelopes(designs: MachineDesigns, front: xr.Dataset, histories: Histories) -> xr.Dataset:
    """Return the envelopes of the filtered displacements, the largest over the loads of a design.

    Returns:
        Over `sensor` and `time`, the middle of each interval [s]: `envelope` over `design` too, and
        `nominal`, that of the machine itself [m]. NaN behind the end of a run that failed.
    """
    points = [*front.place.values, designs.nominal()]
    runs = [designs.shown_runs(designs.machine_at(p), f"{i}") for i, p in enumerate(points, 1)]
    owners = [number for number, cases in enumerate(runs) for _ in cases]
    sensors = list(designs.parameters.sensors)
    largest = np.full((len(points), len(sensors), INTERVALS), np.nan)
    duration = max(case.profile.duration for cases in runs for case in cases)

    def add(number: int, record: Record) -> None:
        owner = owners[number]
        largest[owner] = np.fmax(largest[owner], envelope_of(record, duration))

    histories([case for cases in runs for case in cases], add)
    time = (np.arange(INTERVALS) + 0.5) * duration / INTERVALS
    return xr.Dataset(
        {
            "envelope": ENVELOPE.variable(("design", "sensor", "time"), largest[:-1]),
            "nominal": ENVELOPE.variable(("sensor", "time"), largest[-1]),
        },
        {
            "design": front["design"].values,
            "sensor": sensors,
            "time": TIME.variable("time", time),
        },
    )


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
