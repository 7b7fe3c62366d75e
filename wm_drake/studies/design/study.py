"""The design study: search, chosen designs, check of robust designs, envelopes of the front."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

from wm_drake.parameters.limits import fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import TIME, Quantity
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.measures.kind import Better
from wm_drake.simulation.records import Record, sample_period
from wm_drake.studies.design.problem import DesignGoal, MachineDesigns
from wm_drake.studies.design.search import DesignProblem, SearchSettings, search_front
from wm_drake.studies.design.surrogate import search_with_surfaces
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.proposal import AFTER, BEFORE, Aim, compared, proposal_of
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.shares import CONFIDENCE, Percentile, percentile_of

SEARCHES = {"genetic": search_front, "surfaces": search_with_surfaces}
"""Searches by name."""

PROPOSED = "proposed"
"""Name of the chosen design that the rule of `wm_drake.studies.proposal` proposes."""


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
        machine itself, moved into the bounds, as `nominal_Dx`.
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
                f"nominal_{goal.name}": goal.quantity.variable((), value)
                for goal, value in zip(designs.objectives, nominal[0], strict=True)
            },
        },
        {"design": np.arange(len(result.designs)) + 1},
    )


def chosen_designs(designs: MachineDesigns, front: xr.Dataset) -> dict[str, int]:
    """Return the number of the best design of each objective, and of the proposed one, by name."""
    goals = designs.objectives
    if not front.sizes["design"]:
        return {}
    values = np.column_stack([front[goal.name].values for goal in goals])
    chosen = {
        f"best {g.given.quantity}": 1 + int(np.argmin(v if g.is_small_better else -v))
        for g, v in zip(goals, values.T, strict=True)
    }
    machine = np.array([front[f"nominal_{goal.name}"].item() for goal in goals])
    aim = Aim(objectives_of(goals), np.vstack([machine, values]), machine)
    number = aim.proposed(values, [1] * len(values))
    return chosen if number is None else {**chosen, PROPOSED: 1 + number}


def objectives_of(goals: tuple[DesignGoal, ...]) -> dict[str, Better]:
    """Return which change of each objective is an improvement, by the name of the goal."""
    return {goal.name: "smaller" if goal.is_small_better else "larger" for goal in goals}


def design_proposal(designs: MachineDesigns, front: xr.Dataset, command: str) -> xr.Dataset:
    """Return the proposed design of a front; its runs are those of the search.

    Args:
        command: Command that runs it.
    """
    number, changes = chosen_designs(designs, front).get(PROPOSED), []
    names = [goal.name for goal in designs.objectives]
    rows = {BEFORE: [front[f"nominal_{name}"].item() for name in names]}
    if number is not None:
        one = front.sel(design=number)
        rows[AFTER] = [one[name].item() for name in names]
        changes = [(d.name, d.text(one[d.name]), ", ".join(d.keys)) for d in designs.dimensions]
    quantities = {goal.name: goal.quantity for goal in designs.objectives}
    values = Quantity("").of_each("response", quantities, ("setting", "response"), [*rows.values()])
    runs = xr.DataArray(values, {"setting": [*rows], "response": names})
    is_made = number is not None
    compared_runs = compared(runs, objectives_of(designs.objectives))
    return proposal_of(compared_runs, changes, is_confirmed=is_made, command=command)


def _values(goal: DesignGoal, cost: FloatArray) -> FloatArray:
    """Return the values of a goal from what the search made small. [SI]"""
    signed = cost if goal.is_small_better else -cost
    return signed if np.isnan(goal.limit) else signed + goal.limit


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
    scores, chosen = designs.scores, chosen_designs(designs, front)
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
        pairs: Promised and fresh value of each chosen design. [SI]
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
                [[getattr(one, field) for one in pair] for pair in pairs],
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
        values: By sample. (n,) [SI]
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


INTERVALS = 120
"""Number of intervals of time, each with the largest value of an envelope in it."""


def front_envelopes(
    designs: MachineDesigns, front: xr.Dataset, experiment: Experiment
) -> xr.Dataset:
    """Return the envelopes of the filtered displacements, the largest over the loads of a design.

    Returns:
        Over `sensor` and `time`, the middle of each interval [s]: `envelope` over `design` too, and
        `nominal`, that of the machine itself [m]. NaN if its runs failed.
    """
    points = [*front.place.values, designs.nominal()]
    runs = [designs.shown_runs(designs.machine_at(p), f"{i}") for i, p in enumerate(points, 1)]
    labels = {"design": range(len(runs)), "scenario": range(len(runs[0]))}
    cases = [case for of_design in runs for case in of_design]
    duration = max(case.profile.duration for case in cases)
    sensors = list(designs.parameters.sensors)
    values = experiment.records(
        labels,
        cases,
        lambda record: envelope_of(record, duration).ravel(),
        len(sensors) * INTERVALS,
        "envelopes of the front",
    )
    largest = np.fmax.reduce(values, axis=1).reshape(len(points), len(sensors), INTERVALS)
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
