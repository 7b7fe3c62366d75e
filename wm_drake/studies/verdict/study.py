"""Judge a machine by all its loads and random laundry, and try changes of its parts in real runs.

Nothing is interpolated: each gap that the result names is that of a run. Changes are tried one at a
time, more and less; the best ones are then combined one after the other, as long as that helps. The
rule of `wm_drake.studies.proposal` chooses among them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, with_value
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit
from wm_drake.parameters.variation import value_at
from wm_drake.report.formatting import shape_name
from wm_drake.report.quantity import CHANGE, Quantity, of_measure
from wm_drake.simulation.measures.kind import Better
from wm_drake.simulation.measures.responses import GAP, Response
from wm_drake.studies.experiment import Experiment, in_three_digits, responses
from wm_drake.studies.proposal import (
    AFTER,
    BEFORE,
    Aim,
    compared,
    proposal_of,
    worst_of,
)
from wm_drake.studies.tolerance.shares import share_of
from wm_drake.studies.tolerance.study import COUNT, OF_RUNS, crude_ends

SMALLEST_GAP = of_measure("smallest_gap")
FACTOR = Quantity("factor", Share())

PARTS = ("spring_types", "damper_types", "bushing_types", "gasket")
"""Tables of the parts that a designer can exchange."""

PHYSICAL = ("N/m", "N*s/m", "N", "N*m/rad", "N*m*s/rad", "N*m")
"""SI units of stiffness, damping and friction; other numbers, such as the velocity at which
friction is full, belong to a law and not to a part."""

MOST_COMBINED = 3
"""Largest number of changes in a combination: more are hard to make."""

MOST_TRIED = 10
"""Number of single changes, the best ones, that a combination may contain."""

SMALLER = (0.5, 0.25)
"""Parts of the change that are tried too of these: a limit may allow less of a change only."""

SIDES = ("less", "more")
STATES = ("as it is", "with the proposal")


@dataclass(frozen=True)
class VerdictQuestion:
    """What is judged.

    Attributes:
        clearance: Gap that must remain. [m]
        change: Change of a part that is tried, as a share of it.
        responses: Responses that tell what a change costs, and the gap.
        laundry: Description of the random laundry.
        command: Command that gives a verdict on the machine again.
        changes: Values of the proposed change, as text by key path; empty without a proposal.
    """

    machine: MachineParameters
    clearance: float
    change: float
    responses: tuple[Response, ...]
    laundry: str
    command: str
    changes: Mapping[str, str]


class ChangedRuns(NamedTuple):
    """Runs over `load` with a change of the machine: its values, as text by key path."""

    runs: xr.Dataset
    changes: Mapping[str, str]


class Judged(NamedTuple):
    """What a verdict found.

    Attributes:
        states, tried, laundry: As of `states_of`, `influences` and `laundry_of`.
        masses: Smallest and largest mass of the laundry [kg]; None if loads scatter in its place.
    """

    question: VerdictQuestion
    states: xr.Dataset
    tried: xr.Dataset
    laundry: xr.Dataset
    masses: tuple[float, float] | None


def smallest(runs: xr.Dataset) -> xr.DataArray:
    """Return the smallest gap of all loads; minus infinity with a run that failed. [m]"""
    return runs.smallest_gap.fillna(-np.inf).min("load")


def influences(experiment: Experiment, keys: Iterable[str], change: float) -> xr.Dataset:
    """Run less and more of each number with all loads.

    Args:
        change: Change of a number, as a share of it.

    Returns:
        The measures over `key`, the strongest first, `side`, less and more, and `load`; `text`, the
        value as `--set` takes it. Numbers of which machine or step refuse a side are left out.
    """
    parameters, factors = experiment.machine.parameters, (1.0 - change, 1.0 + change)
    texts = {key: [_text(parameters, key, factor) for factor in factors] for key in keys}
    names = {key: [f"{key}={text}" for text in both] for key, both in texts.items()}
    machines = experiment.allowed(
        {n: {k: t} for k in texts for n, t in zip(names[k], texts[k], strict=True)}
    )
    complete = [key for key in texts if all(name in machines for name in names[key])]
    runs = experiment.over(
        {"key": complete, "side": SIDES, "load": [case.name for case in experiment.loads]},
        (
            case
            for key in complete
            for name in names[key]
            for case in experiment.cases_of(machines[name], name)
        ),
        "single changes",
    )
    less, more = smallest(runs).values.T
    both_ran = np.isfinite(less) & np.isfinite(more)
    span = np.abs(np.subtract(more, less, where=both_ran, out=np.full(len(less), np.inf)))
    shown = np.array([texts[key] for key in complete]).reshape(-1, len(SIDES))
    return runs.assign(text=(("key", "side"), shown)).isel(key=np.argsort(-span, kind="stable"))


def aim_of(
    base: xr.Dataset, tried: xr.Dataset, chosen: Sequence[Response], limits: Sequence[float]
) -> Aim:
    """Return what a change shall reach.

    Args:
        base: Runs of the machine as it is, over `load`.
        tried: As of `influences`.
        chosen: Responses that a change may not make worse, and the gap.
        limits: Largest rise of each, a share of that of the machine.
    """
    goals, parts = goals_of(chosen), [values_of(runs, chosen) for runs in (base, tried)]
    ranges = np.concatenate([part.reshape(-1, len(goals)) for part in parts])
    return Aim(goals, ranges, worst_of(parts[0], goals), np.array(limits))


def proposed(
    experiment: Experiment,
    aim: Aim,
    tried: xr.Dataset,
    chosen: Sequence[Response],
    change: float,
) -> ChangedRuns | None:
    """Return the proposed change, as of `wm_drake.studies.proposal`.

    The candidates are the single changes, the strongest ones also smaller, and the best one with
    the best additions to it.

    Args:
        experiment: Runs of the machine with all loads.
        aim: As of `aim_of`.
        tried: As of `influences`.
        chosen: Responses.
        change: Change of a number in `tried`, as a share of it.

    Returns:
        None if no change is clearly better.
    """
    if not aim.can_choose or not tried.sizes["key"]:
        return None
    single = _singles(experiment, aim, tried, chosen, change)
    candidates = [*single, *_combined(experiment, aim, single, chosen)]
    values = np.array([_worst(one, aim, chosen) for one in candidates])
    number = aim.proposed(values, [len(one.changes) for one in candidates])
    return None if number is None else candidates[number]


def _worst(one: ChangedRuns, aim: Aim, chosen: Sequence[Response]) -> FloatArray:
    return worst_of(values_of(one.runs, chosen), aim.goals)


def _singles(
    experiment: Experiment,
    aim: Aim,
    tried: xr.Dataset,
    chosen: Sequence[Response],
    change: float,
) -> list[ChangedRuns]:
    """Return the changes of one number that reach most, each as large as is best, best first."""
    worst = worst_of(values_of(tried, chosen), aim.goals)
    reached = np.nan_to_num(
        aim.reached(worst.reshape(-1, len(aim.goals))).reshape(worst.shape[:2]), nan=-np.inf
    )
    ranked = np.argsort(-reached.max(axis=1), kind="stable")[:MOST_TRIED]
    sizes: dict[str, list[ChangedRuns]] = {}
    smaller: dict[str, tuple[str, str]] = {}
    for k in ranked.tolist():
        side = int(reached[k].argmax())
        one = tried.isel(key=k, side=side)
        key = one["key"].item()
        sizes[key] = [ChangedRuns(one, {key: one.text.item()})]
        for part in SMALLER:
            factor = 1.0 + (2 * side - 1) * part * change
            text = _text(experiment.machine.parameters, key, factor)
            smaller[f"{key}={text}"] = key, text
    machines = experiment.allowed({name: {key: text} for name, (key, text) in smaller.items()})
    runs = experiment.at(list(machines), machines.values(), "smaller changes") if machines else None
    for name in machines:
        key, text = smaller[name]
        assert runs is not None
        sizes[key].append(ChangedRuns(runs.sel(point=name), {key: text}))
    best = []
    for of_key in sizes.values():
        value = aim.value(np.array([_worst(one, aim, chosen) for one in of_key]))
        best.append((float(value.max()), of_key[int(value.argmax())]))
    return [one for _, one in sorted(best, key=lambda pair: -pair[0])]


def reasons(
    aim: Aim, tried: xr.Dataset, chosen: Sequence[Response], changed: ChangedRuns | None
) -> list[str]:
    """Return why the better side of each change that was tried is not proposed; "" if it is."""
    worst = worst_of(values_of(tried, chosen), aim.goals)
    gaps, machine = smallest(tried).values, aim.machine[list(aim.goals).index(GAP)]
    made = {} if changed is None else changed.changes
    texts = []
    for k, key in enumerate(tried["key"].values.tolist()):
        side = int(np.nan_to_num(gaps[k], nan=-np.inf).argmax())
        rise = aim.rises(worst[k])[side]
        beyond = int(np.argmax(rise - aim.limits))
        if key in made:
            texts.append("")
        elif not np.isfinite(rise).all():
            texts.append("a run fails")
        elif gaps[k, side] <= machine:
            texts.append("the gap does not grow")
        elif rise[beyond] > np.broadcast_to(aim.limits, rise.shape)[beyond]:
            amount = CHANGE.text(rise[beyond])
            texts.append(f"{chosen[beyond].title} ({chosen[beyond].name}) changes by {amount}")
        else:
            texts.append("gains less" if made else "gains too little")
    return texts


def _combined(
    experiment: Experiment, aim: Aim, singles: Sequence[ChangedRuns], chosen: Sequence[Response]
) -> list[ChangedRuns]:
    """Return the best single change with each addition, then of the best pair, ...

    They end where no addition is better.

    Args:
        experiment: Runs of the machine with all loads.
        aim: What a change shall reach.
        singles: Single changes, the best one first.
        chosen: Responses.
    """
    best, combined = singles[0], list[ChangedRuns]()
    useful = {key: text for one in singles for key, text in one.changes.items()}
    for _ in range(MOST_COMBINED - 1):
        made = best.changes
        more = [{**made, key: text} for key, text in useful.items() if key not in made]
        named = {"; ".join(f"{k}={t}" for k, t in each.items()): each for each in more}
        machines = experiment.allowed(named)
        if not machines:
            break
        data = experiment.at(list(machines), machines.values(), "combinations")
        added = [ChangedRuns(data.sel(point=name), named[name]) for name in machines]
        values = [worst_of(values_of(one.runs, chosen), aim.goals) for one in (best, *added)]
        first, *others = aim.value(np.array(values)).tolist()
        combined += added
        if max(others) <= first:
            break
        best = added[int(np.argmax(others))]
    return combined


def goals_of(chosen: Sequence[Response]) -> dict[str, Better]:
    """Return which change of each response is an improvement."""
    return {response.name: response.better for response in chosen}


def values_of(runs: xr.Dataset, chosen: Sequence[Response]) -> FloatArray:
    """Return the responses of runs, NaN of a run that failed. (..., loads, responses) [SI]"""
    values = responses(runs, chosen)
    return np.stack([values[response.name].values for response in chosen], axis=-1)


def proposal(question: VerdictQuestion, states: xr.Dataset) -> xr.Dataset:
    """Return the proposal with its runs, as of `wm_drake.studies.proposal.proposal_of`.

    Args:
        question: What is judged.
        states: As of `states_of`.
    """
    chosen, changes = question.responses, question.changes
    each, dims = in_three_digits(chosen), ("setting", "load", "response")
    labels = {
        "setting": [BEFORE, AFTER][: states.sizes["state"]],
        "load": states["load"].values,
        "response": list(each),
    }
    values = Quantity("").of_each("response", each, dims, values_of(states, chosen))
    runs = compared(xr.DataArray(values, labels), goals_of(chosen))
    texts = []
    for key, text in changes.items():
        change = CHANGE.text(_ratio(question.machine, key, text) - 1.0)
        value = f"{text} of its table"
        if not text.endswith("%"):
            changed = value_at(with_value(question.machine, key, text), key)
            value = f"{_unit_of(question.machine, key).reading(changed, digits=4)} ({change})"
        texts.append((words_of(key), value, key))
    sets = [f'--set "{key}={text}"' for key, text in changes.items()]
    command = " ".join([question.command, *sets])
    return proposal_of(runs, texts, is_confirmed=bool(changes), command=command)


def states_of(base: xr.Dataset, changed: ChangedRuns | None) -> xr.Dataset:
    """Return the runs of the machine as it is, and with the proposed change, over `state`.

    Args:
        base: Runs of the machine as it is, over `load`.
        changed: As of `proposed`.

    Returns:
        The states that exist, of `STATES`.
    """
    runs = [base] if changed is None else [base, changed.runs]
    alike = [run[[*base.data_vars]].reset_coords(drop=True) for run in runs]
    return xr.concat(alike, xr.Variable("state", list(STATES[: len(runs)])))


def laundry_of(samples: Sequence[xr.Dataset], clearance: float) -> xr.Dataset:
    """Return the gaps of random laundry in the machine as it is, and with the proposal.

    Args:
        samples: As of `ToleranceTrials.samples`, the first ones of the machine as it is.
        clearance: Gap that must remain. [m]

    Returns:
        Over `state`: `smallest_gap` of all samples, minus infinity if a run failed [m], `count`,
        number of samples with too small a gap, and their share, `probability`, with the ends of its
        95 % interval, `lower` and `upper`; `gap` over `sample` too [m].
    """
    gaps = np.array([one.smallest_gap.fillna(-np.inf).values for one in samples])
    shares = [share_of(row <= clearance) for row in gaps]
    probability, lower, upper = np.array([crude_ends(share) for share in shares]).T
    numbers = {
        "smallest_gap": (SMALLEST_GAP, gaps.min(axis=1)),
        "count": (COUNT.named("runs with too small a gap"), [share.count for share in shares]),
        "probability": (OF_RUNS.named("probability"), probability),
        "lower": (OF_RUNS.named("95 % from"), lower),
        "upper": (OF_RUNS.named("to"), upper),
    }
    data = xr.Dataset({name: q.variable("state", values) for name, (q, values) in numbers.items()})
    states = list(STATES[: len(samples)])
    gap = SMALLEST_GAP.variable(("state", "sample"), gaps)
    return data.assign(gap=gap).assign_coords(state=states)


def _text(parameters: MachineParameters, key: str, factor: float) -> str:
    """Return a multiple of a number as the text that `--set` takes, so that it is what is run.

    It is rounded in the unit of machine files, whatever the units of the reader.
    """
    if isinstance(value_at(parameters, key), CurveTable):
        return f"{FACTOR.values(factor):.4g} %"
    unit = _unit_of(parameters, key)
    return f"{unit.from_si(factor * value_at(parameters, key)):.4g} {unit.shown}"


def _unit_of(parameters: MachineParameters, key: str) -> Unit:
    return next(unit for name, _, unit in quantities(parameters) if name == key)


def _ratio(parameters: MachineParameters, key: str, text: str) -> float:
    """Return a changed number over that of the machine; 1 for a table, which has its percents."""
    value = value_at(parameters, key)
    changed = value_at(with_value(parameters, key, text), key)
    return 1.0 if isinstance(value, CurveTable) else changed / value


def words_of(key: str) -> str:
    """Return a number in words: `gasket.stiffness_x` becomes `stiffness along x of the gasket`."""
    table, *middle, last = key.split(".")
    field, _, axis = last.rpartition("_")
    is_along = field and axis in ("x", "y", "z")
    name = shape_name(field if is_along else last)
    if is_along:
        turns = "rotational" in name or "torque" in name
        name = f"{name} {'about' if turns else 'along'} {axis}"
    if table == "bodies":
        return f"{name} of the {shape_name(middle[0])}"
    if table == "gasket":
        return f"{name} of the gasket"
    of_part = f"{shape_name(middle[1])}s, " if len(middle) > 1 else ""
    return f"{name} of the {of_part}{WORDS_OF_PARTS[table]} '{middle[0]}'"


WORDS_OF_PARTS = {
    "spring_types": "springs",
    "damper_types": "dampers",
    "bushing_types": "bushings of the dampers",
}


def changeable(parameters: MachineParameters) -> Iterator[str]:
    """Yield the key paths of what a designer can change: numbers of parts, counterweights.

    Numbers that are 0 are left out.
    """
    for key, value, unit in quantities(parameters):
        table = key.partition(".")[0]
        is_part = table in PARTS and unit.si in PHYSICAL
        is_weight = table == "bodies" and COUNTERWEIGHT in key and key.endswith(".mass")
        if (is_part or is_weight) and isinstance(value, float) and value != 0.0:
            yield key
        curve = key.rpartition(".")[0]
        if (
            is_part
            and isinstance(value, tuple)
            and isinstance(value_at(parameters, curve), CurveTable)
        ):
            yield curve


COUNTERWEIGHT = "counterweight"
"""Part of the name of a body whose mass a designer can choose."""
