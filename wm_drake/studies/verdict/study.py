"""Judge a machine by all its loads and random laundry, and try changes of its parts in real runs.

Nothing is interpolated: each gap that the result names is that of a run. Changes are tried one at a
time, more and less; `wm_drake.studies.verdict.search` combines the best ones.
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
from wm_drake.simulation.measures.responses import Response
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
        value as `--set` takes it; `is_refused`, whether the machine or its step refuses it.
    """
    parameters, factors = experiment.machine.parameters, (1.0 - change, 1.0 + change)
    texts = {key: [text_of(parameters, key, factor) for factor in factors] for key in keys}
    every = {f"{key}={text}": {key: text} for key in texts for text in texts[key]}
    machines = experiment.allowed(every)
    runs = experiment.at(list(machines), machines.values(), "single changes")
    runs = runs.reindex(point=list(every)).drop_vars("point")
    runs = runs.coarsen(point=len(SIDES)).construct(point=("key", "side"))
    runs = runs.assign_coords(key=list(texts), side=list(SIDES))
    shape = (len(texts), len(SIDES))
    is_refused = np.array([name not in machines for name in every]).reshape(shape)
    less, more = smallest(runs).values.T
    both_ran = np.isfinite(less) & np.isfinite(more)
    span = np.abs(np.subtract(more, less, where=both_ran, out=np.full(len(less), np.inf)))
    span[is_refused.any(axis=1)] = 0.0
    shown = np.array(list(texts.values())).reshape(shape)
    dims = ("key", "side")
    runs = runs.assign(text=(dims, shown), is_refused=(dims, is_refused))
    return runs.isel(key=np.argsort(-span, kind="stable"))


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
        change = CHANGE.text(ratio_of(question.machine, key, text) - 1.0)
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


def text_of(parameters: MachineParameters, key: str, factor: float) -> str:
    """Return a multiple of a number as the text that `--set` takes, so that it is what is run.

    It is rounded in the unit of machine files, whatever the units of the reader.
    """
    if isinstance(value_at(parameters, key), CurveTable):
        return f"{FACTOR.values(factor):.4g} %"
    unit = _unit_of(parameters, key)
    return f"{unit.from_si(factor * value_at(parameters, key)):.4g} {unit.shown}"


def _unit_of(parameters: MachineParameters, key: str) -> Unit:
    return next(unit for name, _, unit in quantities(parameters) if name == key)


def ratio_of(parameters: MachineParameters, key: str, text: str) -> float:
    """Return a changed number over that of the machine; of a table, its percents."""
    value = value_at(parameters, key)
    if isinstance(value, CurveTable):
        return FACTOR.unit.number(text)
    return float(value_at(with_value(parameters, key, text), key) / value)


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
