"""What a page without a server knows of its machine: compiled code, numbers, words."""

import base64
import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from wm_drake.compiler.kept import all_sources, kept
from wm_drake.engines.compiled.multistep import STEPS_BEFORE
from wm_drake.engines.compiled.stepping import LARGEST_TURN, LARGEST_TURN_OF_MIDPOINT
from wm_drake.errors import input_error
from wm_drake.export.object_code import function_here
from wm_drake.export.page_contents import Contents
from wm_drake.export.page_kernel import AFTERWARDS, FIRST, MEANWHILE, page_code
from wm_drake.export.page_model import (
    UNBALANCE_FIELDS,
    Candidates,
    MovedNumber,
    PageModel,
    page_model,
    without_wrong,
)
from wm_drake.export.page_second import SecondProcess
from wm_drake.export.page_steps import FARTHEST, other_steps
from wm_drake.export.tunable import ends_of
from wm_drake.export.wasm import wasm_module
from wm_drake.live.machine import MOST_STEPS, SLIDER_STEPS, OpenMachine, drum_of
from wm_drake.live.measures import foot_title, heads_of, mount_title, shown_measures
from wm_drake.live.state import PageState
from wm_drake.model.build import build_machine
from wm_drake.model.scene import REPLAY_RATE, Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.files import machine_tree
from wm_drake.parameters.spin import SAMPLES_OF_TURN
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import shape_name
from wm_drake.report.provenance import program
from wm_drake.simulation.band import PADDING_PERIODS
from wm_drake.simulation.convergence import MOST_HALVINGS
from wm_drake.simulation.displacements import (
    LEAST_PADDING,
    LONGEST_ORBIT,
    ORBIT_REVOLUTIONS,
    REPLAY_SPAN,
    have_one_orbit,
)
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.mounts import mount_names


class _Source(NamedTuple):
    """Where the answer of a worker has the first value of a measure.

    Attributes:
        array: Array of the answer.
        after: Count of the plan after whose values it begins; "" at the begin of the array.
        first: Index from there on.
    """

    array: str
    after: str = ""
    first: int = 0


SOURCES = {
    "amplitude": _Source("sizes"),
    "smallest_gap": _Source("gap"),
    "detergent_displacement": _Source("extremes", after="sensors"),
    "gasket_force": _Source("extremes", after="points"),
    "gasket_moment": _Source("extremes", after="points", first=3),
    "mount_force_peak": _Source("mounts"),
}
"""Where the measures are that the compiled machine has, by the names of their variables."""
LARGEST_TURNS = {
    "multistep": LARGEST_TURN,
    "midpoint": LARGEST_TURN_OF_MIDPOINT,
    "runge_kutta": FARTHEST,
}
"""Largest turn of the drum in a step, by integrator. [rad]"""
NOT_HERE = ("loads.", "profile.", "step", "output_period")
"""Numbers that do not enter the packed numbers: the page changes loads and profile itself."""
AS_EXPORTED = "it is that of the exported file"


def page_data(parameters: MachineParameters) -> dict[str, Any]:
    """Return all that the page knows of a machine, its compiled code too; kept on disk."""
    machine = f"{parameters.model_dump_json()} {sorted(parameters.sources.items())}"
    key = f"page by {all_sources()} of {machine}"
    data: dict[str, Any] = json.loads(
        kept(key, lambda: json.dumps(_page_data(parameters), allow_nan=False).encode())
    )
    return data


def _page_data(parameters: MachineParameters) -> dict[str, Any]:
    """Return all that the page knows."""
    opened = OpenMachine(parameters, build_machine(parameters), Scene(parameters))
    candidates = _candidates(opened)
    setup, profile = opened.machine.set_up(None), parameters.profile
    ends = [point[1] for point in setup.sensor_points.values()]
    front, rear = float(min(ends)), float(max(ends))
    depths = [front] if have_one_orbit(front, rear) else [front, rear]

    def move(values: Mapping[str, float]) -> MachineParameters:
        changed = parameters
        for key, value in values.items():
            changed = opened.moved_by(changed, key, value - candidates[key].value)
        return changed

    contents = Contents(opened.machine, move, profile, depths)
    _check_length(profile.duration / contents.stepping.step)
    compiled = _compiled(contents, candidates)
    model = compiled.model
    return {
        "program": program(),
        "tree": machine_tree(parameters),
        "machine": _machine(opened, model.places, model.refused, compiled.limits),
        "model": _model(contents, model, compiled.moved),
        "wasm": base64.b64encode(_wasm(model.plan, compiled.code)).decode(),
        "loads": _loads(parameters, model.of_load),
        "profile": {"time": profile.time, "speed": profile.speed},
        "band": contents.band,
        "depths": depths,
        "drum": drum_of(setup),
        "pairs": [[shape_name(n) for n in pair.split("|")] for pair in model.pair_names],
        "measured": _measured(opened),
        "rows": [
            row
            for name in shown_measures(parameters)
            for row in _rows(opened, name, model.plan.count)
        ],
        "forces": _forces(parameters, model.plan.gasket >= 0),
        "masses": _masses(),
        "drawing": {
            "orbits": {"revolutions": ORBIT_REVOLUTIONS, "longest": LONGEST_ORBIT},
            "replay": {"span": REPLAY_SPAN, "rate": REPLAY_RATE},
        },
    }


class _Compiled(NamedTuple):
    """The compiled machine of a page.

    Attributes:
        model: The machine, with the numbers that may change.
        moved, limits: Steps and limits of these numbers, from `other_steps`.
        code: Object code of each function.
    """

    model: PageModel
    moved: Sequence[Mapping[str, Any]]
    limits: Mapping[str, Sequence[float]]
    code: Mapping[str, str]


def _compiled(contents: Contents, candidates: Candidates) -> _Compiled:
    """Compile the functions of a page in two processes.

    The functions of a run are the same whatever may change. The second process begins with them,
    while this one finds which of the candidates the function of the set-up follows.
    """
    with SecondProcess() as second:
        of_run = page_model(contents, {}).plan
        second.compile(of_run)
        every = page_model(contents, candidates)
        code = page_code(every.plan, FIRST)
        set_up = function_here("wm_set_up", code["wm_set_up"])
        model = without_wrong(every, set_up, contents, candidates)
        moved, limits = other_steps(contents, candidates, model.places)
        code |= page_code(of_run, AFTERWARDS)
        second.wait()
        code |= page_code(of_run, MEANWHILE)
    return _Compiled(model, moved, limits, code)


def _model(
    contents: Contents, model: PageModel, moved: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return what the engine of the page works on: numbers, their places, and how runs are stepped.

    Args:
        moved: Steps of moved numbers, from `other_steps`.
    """
    begins, stepping = model.plan.elements.begins, contents.stepping
    return {
        "at": model.plan.at._asdict(),
        "count": model.plan.count._asdict(),
        "numbers": model.numbers.tolist(),
        "constants": _finite(model.constants.tolist()),
        "places": model.places,
        "sample": begins.size + begins.rates,
        "balls": contents.layout.balls,
        "padding": round(PADDING_PERIODS / contents.band[0] / contents.period),
        "leastPadding": LEAST_PADDING,
        "mostSteps": MOST_STEPS,
        "accuracy": contents.setup.parameters.accuracy,
        "mostHalvings": MOST_HALVINGS,
        "sliderSteps": SLIDER_STEPS,
        "fastest": (1.0 + 1e-9) * 2.0 * math.pi / (SAMPLES_OF_TURN * contents.period),
        "stepping": {
            "integrator": stepping.integrator,
            "step": stepping.step,
            "period": contents.period,
            "moved": moved,
            "largestTurns": LARGEST_TURNS,
            "control": contents.layout.control_period,
            "stepsBefore": STEPS_BEFORE,
        },
    }


def _wasm(plan: Any, code: Mapping[str, str]) -> bytes:
    """Return the module of the functions of a plan, from its file if kept."""
    return kept(f"wasm by {all_sources()} of {plan!r}", lambda: wasm_module(code))


def _check_length(steps: float) -> None:
    """Raise an InputError for a run of too many steps."""
    if steps > MOST_STEPS:
        raise input_error(
            f"a run of {steps:.0f} steps is too long for a page; allowed are {MOST_STEPS}: give "
            "the machine a shorter profile",
            key="profile.time",
        )


def _candidates(opened: OpenMachine) -> Candidates:
    """Return value and ends of each number that may enter the compiled functions. [SI]"""
    candidates = {}
    for key, slider in opened.sliders.items():
        if slider.needs or key.startswith(NOT_HERE):
            continue
        si = 1.0 / slider.unit.from_si(1.0)
        value = float(slider.number.nominal or 0.0)
        candidates[key] = MovedNumber(value, slider.low * si, slider.high * si)
    return candidates


def _machine(
    opened: OpenMachine,
    places: Mapping[str, int],
    refused: Mapping[str, str],
    limits: Mapping[str, Sequence[float]],
) -> dict[str, Any]:
    """Return the machine as the studio has it; each number also with its units and limits."""
    machine = opened.for_page()
    numbers: Any = machine["numbers"]
    labels: dict[str, dict[str, float]] = {}
    for slider in opened.sliders.values():
        units = labels.setdefault(slider.unit.si, {})
        for unit in (slider.unit, Unit(slider.unit.si, slider.unit.si)):
            units[unit.label] = 1.0 / unit.from_si(1.0)
    for number in numbers:
        key = number["key"]
        slider = opened.sliders[key]
        number["units"] = labels[slider.unit.si]
        number["kind"] = (
            "table" if slider.number.is_table else "entry" if slider.is_entry else "number"
        )
        number["least"], number["most"] = _finite([*ends_of(slider.allowed)])
        _put_limits(number, limits.get(key, (-FARTHEST, FARTHEST)), slider.unit)
        runs = key in places or re.fullmatch(
            r"loads\..*\.unbalances\.\d+\.\w+|profile\.(time|speed)\.\d+", key
        )
        if not runs and not number["needs"]:
            number["needs"], number["fixed"] = refused.get(key, AS_EXPORTED), True
        if number["needs"]:
            number["low"] = number["high"] = number["value"]
    return machine


def _put_limits(number: dict[str, Any], limits: Sequence[float], unit: Unit) -> None:
    """Put limits that only the page has [SI] on field and slider of a number."""
    number["least"] = max(number["least"], limits[0])
    number["most"] = min(number["most"], limits[1])
    for sign, end, limit in zip("≥≤", ("low", "high"), limits, strict=True):
        if abs(limit) < FARTHEST:
            shown = unit.from_si(limit)
            number[end] += 1.01 * (shown - number[end])
            number["allowed"] = f"{number['allowed']} (on this page {sign} {shown:.4g})".strip()


def _finite(values: list[float]) -> list[float]:
    """Return numbers for JSON, which has no infinite ones."""
    return [max(-FARTHEST, min(FARTHEST, value)) for value in values]


def _loads(parameters: MachineParameters, of_load: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: {
            "unbalances": [{f: getattr(u, f) for f in UNBALANCE_FIELDS} for u in load.unbalances],
            "harmonics": of_load[name].tolist() if of_load[name].any() else [],
        }
        for name, load in parameters.loads.items()
    }


def _masses() -> dict[str, Any]:
    """Return units and limits of the numbers of a described mass."""
    fields = {"mass": ("kg", "g"), "radius": ("m", "mm"), "y": ("m", "mm"), "phase": ("rad", "deg")}
    return {
        name: {
            "units": {u.label: 1.0 / u.from_si(1.0) for u in (Unit(si, si), Unit(si, shown))},
            "least": 0.0 if name in ("mass", "radius") else -FARTHEST,
            "most": FARTHEST,
            "allowed": "≥ 0" if name in ("mass", "radius") else "any number",
        }
        for name, (si, shown) in fields.items()
    }


def _measured(opened: OpenMachine) -> dict[str, Any]:
    """Return what was measured, by load and by whether the gasket is in."""
    return {
        load: {
            word: opened.measured(PageState(machine="", load=load, gasket=word == "yes"))
            for word in ("yes", "no")
        }
        for load in opened.parameters.loads
    }


def _rows(opened: OpenMachine, measure: str, count: Any) -> list[dict[str, Any]]:
    """Return the rows of the table of measures, and where the answer of a worker has each value."""
    rows = []
    for variable in MEASURES[measure].variables:
        if variable.studio is None or variable.name not in SOURCES:
            continue
        source = SOURCES[variable.name]
        first = source.first + (getattr(count, source.after) if source.after else 0)
        heads = heads_of(opened.parameters, opened.parameters.profile, variable)
        factor = variable.unit.from_si(1.0)
        rows += [
            head | {"from": [source.array, first + k], "factor": factor}
            for k, head in enumerate(heads)
        ]
    return rows


def _forces(parameters: MachineParameters, has_gasket: bool) -> list[tuple[str, int]]:
    """Return name and number of each force that is drawn over time."""
    gasket = [f"gasket {letter}{axis}" for letter in "FM" for axis in "xyz"] if has_gasket else []
    others = [mount_title(name) for name in mount_names(parameters)]
    if parameters.cabinet:
        others += map(foot_title, parameters.cabinet.corners)
    return [*((n, k) for k, n in enumerate(gasket)), *((n, 6 + k) for k, n in enumerate(others))]
