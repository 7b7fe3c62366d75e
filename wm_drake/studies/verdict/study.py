"""Judge a machine by all its loads and random laundry, and try changes of its parts in real runs.

Nothing is interpolated: each gap that the result names is that of a run. Changes are tried one at a
time, more and less; the best ones are then combined one after the other, as long as that helps.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.units import Share, Unit
from wm_drake.parameters.variation import value_at
from wm_drake.report.formatting import shape_name
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.measures.responses import GAP, Response
from wm_drake.studies.experiment import Experiment, responses
from wm_drake.studies.tolerance.shares import share_of
from wm_drake.studies.tolerance.study import COUNT, SHARE, crude_ends

SMALLEST_GAP = Quantity("smallest gap", Unit("m", "mm"), 1)
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

LEAST_GAIN = 1e-4
"""Gain of the gap below which a change is not added. [m] Assumption: less cannot be measured."""

SIDES = ("less", "more")
STATES = ("as it is", "best single change", "best combination")


@dataclass(frozen=True)
class VerdictQuestion:
    """What is judged.

    Attributes:
        clearance: Gap that must remain. [m]
        change: Change of a part that is tried, as a share of it.
        responses: Responses that tell what a change costs, and the gap.
        laundry: Description of the random laundry.
        command: Command that gives a verdict on the machine again.
    """

    machine: MachineParameters
    clearance: float
    change: float
    responses: tuple[Response, ...]
    laundry: str
    command: str


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


def combined(experiment: Experiment, base: xr.Dataset, tried: xr.Dataset) -> list[xr.Dataset]:
    """Return the best single change, the best addition to it, and so on.

    The list ends where an addition gains less than `LEAST_GAIN`.

    Args:
        base: Runs of the machine as it is, over `load`.
        tried: As of `influences`.

    Returns:
        Runs over `load`; attribute `changes`, values as text by key path.
    """
    sides = tried.isel(side=smallest(tried).argmax("side"))
    sides = sides.isel(key=np.argsort(-smallest(sides).values, kind="stable")[:MOST_TRIED])
    useful = dict(zip(sides["key"].values.tolist(), sides.text.values.tolist(), strict=True))
    candidates, changes = sides.rename(key="point"), [{key: text} for key, text in useful.items()]
    chosen, last = list[xr.Dataset](), float(smallest(base))
    while changes and len(chosen) < MOST_COMBINED:
        gaps = smallest(candidates).values
        best = int(gaps.argmax())
        if gaps[best] < last + LEAST_GAIN or not np.isfinite(gaps[best]):
            break
        made, last = changes[best], float(gaps[best])
        chosen.append(candidates.isel(point=best).assign_attrs(changes=made))
        if len(chosen) < MOST_COMBINED:
            more = [{**made, key: text} for key, text in useful.items() if key not in made]
            named = {"; ".join(f"{k}={t}" for k, t in each.items()): each for each in more}
            machines = experiment.allowed(named)
            changes = [named[name] for name in machines]
            candidates = experiment.at(list(machines), machines.values(), "combinations")
    return chosen


def states_of(base: xr.Dataset, steps: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return the runs of the machine as it is, and with the best changes, over `state`.

    Args:
        base, steps: As of `combined`.

    Returns:
        The states that exist, of `STATES`. Attribute `changes`: values as text by key path, for
        each of them.
    """
    runs = [base, *steps[:1], *steps[1:][-1:]]
    alike = [run[[*base.data_vars]].reset_coords(drop=True) for run in runs]
    states = xr.concat(alike, xr.Variable("state", list(STATES[: len(runs)])))
    return states.assign_attrs(changes=[run.attrs.get("changes", {}) for run in runs])


def laundry_of(samples: Sequence[xr.Dataset], clearance: float) -> xr.Dataset:
    """Return the gaps of random laundry in the machine as it is, and with the best change.

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
        "probability": (SHARE.named("probability"), probability),
        "lower": (SHARE.named("95 % from"), lower),
        "upper": (SHARE.named("to"), upper),
    }
    data = xr.Dataset({name: q.variable("state", values) for name, (q, values) in numbers.items()})
    states = ["as it is", "after the best change"][: len(samples)]
    gap = SMALLEST_GAP.variable(("state", "sample"), gaps)
    return data.assign(gap=gap).assign_coords(state=states)


def worst_of(question: VerdictQuestion, states: xr.Dataset) -> xr.Dataset:
    """Return the smallest gap and the largest other responses of all loads, over `state`. [SI]"""
    numbers = responses(states, question.responses)
    return xr.Dataset(
        {
            r.name: (numbers[r.name].min if r.name == GAP else numbers[r.name].max)(
                "load", keep_attrs=True
            )
            for r in question.responses
        }
    )


def _text(parameters: MachineParameters, key: str, factor: float) -> str:
    """Return a multiple of a number as the text that `--set` takes, so that it is what is run."""
    if isinstance(value_at(parameters, key), CurveTable):
        return f"{FACTOR.values(factor):.4g} %"
    unit = next(unit for name, _, unit in quantities(parameters) if name == key)
    return f"{unit.from_si(factor * value_at(parameters, key)):.4g} {unit.shown}"


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
