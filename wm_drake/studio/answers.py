"""Run what a page has chosen, and return what it draws, as plain numbers for JSON.

The page gets its answer in two parts. The first is the picture: motion, gap and contact. The second
is the numbers: table of measures, forces and arrows; a picture that is overtaken has none.

A run has eight lanes, which together cost little more than one. The first has the chosen load. In
a picture, the others have the other loads of the machine. In the numbers, they have one number each
turned by a hundredth of its slider, which gives the sensitivity arrows.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wm_drake.batch.runs import Runner, RunResult, ShownMotion
from wm_drake.batch.work_items import BatchKey, Preparation, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.errors import InputError, Problem
from wm_drake.live.machine import SLIDER_STEPS, OpenMachine, drum_of, is_same
from wm_drake.live.measures import foot_title, heads_of, mount_title, shown_measures
from wm_drake.live.state import PageState
from wm_drake.model.expectations import unusual_springs
from wm_drake.model.machine import Setup
from wm_drake.model.scene import Gap
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.plausibility import unusual_numbers
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import plain, shape_name
from wm_drake.report.quantity import SPEED, STEP, Quantity
from wm_drake.simulation.band import band_warnings, pass_band
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import (
    ORBIT_REVOLUTIONS,
    have_one_orbit,
    local_maxima,
    orbit_window,
    replay_samples,
)
from wm_drake.simulation.measures import MEASURES, Variable
from wm_drake.simulation.measures.record import foot_loads_of
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.records import Record, cabinet_in
from wm_drake.studies.inputs import friction_warnings
from wm_drake.studio.saving import mark_of

LANES = WIDTH - 1
"""How many numbers one run turns."""

BINS = 350
"""Number of time bins of a force; each is drawn from its smallest to its largest value."""

DISTANCE = Quantity("distance", Unit("m", "mm"))
NOT_CONVERGED = "not converged"
MICRO, MILLI = 1e-6, 1e-3
"""Displacements are sent in whole micrometres, times in whole milliseconds."""


def picture_runner_of(machine: OpenMachine) -> Runner:
    """Return the runner of the pictures of a machine: the first run of a batch has a motion."""
    runner = Runner(machine.parameters, ("amplitudes", "gap"), histories=False, motions={0})
    runner.most_steps = SLIDER_STEPS
    return runner


def runner_of(machine: OpenMachine) -> Runner:
    """Return the runner of the numbers of a machine: the first run of a batch has a history."""
    measures = shown_measures(machine.parameters)
    runner = Runner(machine.parameters, measures, histories={0})
    runner.most_steps = SLIDER_STEPS
    return runner


def picture(machine: OpenMachine, runner: Runner, state: PageState) -> dict[str, Any]:
    """Run what a page has chosen and return the motion, and the gap with each load."""
    with machine.lock:
        case = machine.case(state)
        assert case.parameters is not None  # a page's case has parameters of its own
        others = [
            replace(case, name=name, load=load)
            for name, load in case.parameters.loads.items()
            if state.masses or name != state.load
        ]
        batches = list(machine.preparation(case.parameters).batches([case, *others]))
        batch_key, items = next(batch for batch in batches if batch[1][0].number == 0)
        setup = items[0].numbers.setup
        profile, period = batch_key.profile, batch_key.period
        warnings = [
            *(Problem("", "profile.band", text) for text in band_warnings(profile)),
            *unusual_numbers(setup.parameters, state.values),
            *unusual_springs(setup),
            *(Problem("", "damper_types", text) for text in friction_warnings(setup.parameters)),
        ]
    runs = sorted((run for batch in batches for run in runner.run(*batch)), key=lambda r: r.number)
    main = runs[0]
    return {
        **_motion(main, setup),
        "mark": mark_of(case.parameters, state),
        "duration": profile.duration,
        "profile": {
            "time": list(profile.time),
            "rpm": SPEED.values(profile.speed).tolist(),
        },
        "values": machine.shown_values(case, state),
        **_gap_of(main),
        "gap_points": _gap_points(runner, main),
        "loads": [{"load": run.case.name, **_gap_of(run)} for run in runs],
        "measured": machine.measured(state),
        "warnings": [{"key": p.key, "message": p.message} for p in warnings],
        "band": pass_band(profile, period),
        "stepping": {
            "integrator": batch_key.stepping.integrator,
            "step": STEP.text(main.accuracy.step if main.accuracy else batch_key.stepping.step),
        },
    }


def numbers(
    machine: OpenMachine, runner: Runner, state: PageState, keys: Sequence[str] = ()
) -> dict[str, Any]:
    """Run what a page has chosen and return measures, forces and arrows.

    Args:
        keys: Key paths of up to `LANES` numbers to turn slightly.
    """
    turned, results = _run_turned(machine, runner, state, keys)
    record = results[0].record
    assert record is not None  # the runner keeps that of the first run
    return {
        "rows": _rows_of(machine, results[0]),
        "forces": _forces(record) if record.sizes["time"] > 1 else None,
        "arrows": _arrows(machine, turned, results),
    }


def arrows(
    machine: OpenMachine, runner: Runner, state: PageState, keys: Sequence[str]
) -> list[dict[str, Any]]:
    """Return the arrow of each of up to `LANES` numbers, without the answer itself."""
    return _arrows(machine, *_run_turned(machine, runner, state, keys))


def _run_turned(
    machine: OpenMachine, runner: Runner, state: PageState, keys: Sequence[str]
) -> tuple[list[tuple[str, float, Case]], dict[int, RunResult]]:
    """Run a case and its turned cases side by side; return these and the results by number."""
    with machine.lock:
        case = machine.case(state)
        turned = _turned(machine, case, keys[:LANES])
        batch_key, items = _batch(machine, [case, *(other for _, _, other in turned)])
    results = runner.run(batch_key, items)
    return turned, {run.number: run for run in results}


def _turned(machine: OpenMachine, case: Case, keys: Iterable[str]) -> list[tuple[str, float, Case]]:
    """Return key, step and case of each number that is turned by a hundredth of its slider.

    A step beyond the allowed range is taken to the other side. A number that can be turned to
    neither side is left out.
    """
    turned = []
    assert case.parameters is not None  # a page's case has parameters of its own
    preparation = machine.preparation(case.parameters)
    for key in keys:
        slider = machine.sliders.get(key)
        for step in (slider.step, -slider.step) if slider is not None and slider.step else ():
            try:
                parameters = machine.moved_by(case.parameters, key, step)
            except InputError:
                continue
            if not is_same(preparation.machine, parameters):  # it would be another machine
                continue
            if key.startswith("loads."):  # the same machine: it needs no set-up of its own
                other = replace(case, load=parameters.loads[case.name])
            else:
                other = replace(case, parameters=parameters, profile=parameters.profile)
            if _can_be_set_up(preparation, other):
                turned.append((key, step, other))
                break
    return turned


def _can_be_set_up(preparation: Preparation, case: Case) -> bool:
    """Return whether a case has an equilibrium and a step; its set-up is kept for the run."""
    try:
        return any(True for _ in preparation.batches([case]))
    except InputError:
        return False


def _batch(machine: OpenMachine, cases: list[Case]) -> tuple[BatchKey, list[WorkItem]]:
    """Return the batch of the first case, with all others that can run side by side with it."""
    parameters = cases[0].parameters
    assert parameters is not None  # see _turned
    for key, items in machine.preparation(parameters).batches(cases):
        if items[0].number == 0:
            return key, items
    raise AssertionError("the first case is in some batch")


def _rows_of(machine: OpenMachine, run: RunResult) -> list[dict[str, Any]]:
    """Return the rows of the table of measures, in units for reading."""
    return [
        row
        for name in shown_measures(machine.parameters)
        for variable in MEASURES[name].variables
        if variable.studio is not None
        for row in _rows(machine, run, variable)
    ]


def _rows(machine: OpenMachine, run: RunResult, variable: Variable) -> list[dict[str, Any]]:
    """Return a row for each number of a variable of a run."""
    values = plain(np.ravel(run.values[variable.name] * variable.unit.from_si(1.0)))
    heads = heads_of(machine.parameters, run.case.profile, variable)
    if _unconverged(run):
        return [head | {"value": None, "alarm": False, "missing": NOT_CONVERGED} for head in heads]
    return [
        head | {"value": value, "alarm": head["touches"] and value is not None and value <= 0.0}
        for head, value in zip(heads, values, strict=True)
    ]


def _gap_of(run: RunResult) -> dict[str, Any]:
    """Return the smallest gap of a run, and why it has none: it diverged, or is not converged."""
    if why := _unconverged(run):
        return {"gap": None, "diverged": why}
    gap = None if run.gap is None else _gap(run.gap, run.case.profile)
    return {"gap": gap, "diverged": run.diverged}


def _unconverged(run: RunResult) -> str:
    """Return that a run is not converged, and its error; "" if it is."""
    accuracy = run.accuracy
    return "" if accuracy is None or accuracy.is_converged else accuracy.text


def _gap(gap: Gap, profile: SpinProfile) -> dict[str, Any]:
    return {
        "distance": float(DISTANCE.values(gap.distance)),
        "time": gap.time,
        "rpm": float(SPEED.values(profile.speed_at(gap.time))),
        "moving": shape_name(gap.moving),
        "fixed": shape_name(gap.fixed),
    }


def _arrows(
    machine: OpenMachine, turned: list[tuple[str, float, Case]], results: dict[int, RunResult]
) -> list[dict[str, Any]]:
    """Return the arrow of each turned number that ran side by side with the first case."""
    return [
        _arrow(machine, results[0], key, step, results[number])
        for number, (key, step, _) in enumerate(turned, start=1)
        if number in results
    ]


def _arrow(
    machine: OpenMachine, main: RunResult, key: str, step: float, run: RunResult
) -> dict[str, Any]:
    """Return what a number does when it is moved up by a hundredth of its slider."""
    up = math.copysign(1.0, step)
    unit = machine.sliders[key].unit
    before, after = (_rows_of(machine, one) for one in (main, run))
    pairs = [(now["value"], was["value"]) for now, was in zip(after, before, strict=True)]
    changes = [None if now is None or was is None else up * (now - was) for now, was in pairs]
    return {"key": key, "step": unit.from_si(abs(step)), "changes": changes}


def _motion(run: RunResult, setup: Setup) -> dict[str, Any]:
    """Return the curves of a motion: envelopes, orbits, and the motion around its largest."""
    motion = run.motion
    if motion is None:
        return {"envelopes": [], "orbits": [], "motion": None}
    largest, replay = motion.largest, replay_samples(motion.time, motion.largest)
    return {
        "envelopes": _envelopes(motion),
        "orbits": _orbits(motion, setup),
        "motion": {
            "time": np.round(motion.time[replay], 4).tolist(),
            "frames": _frames(motion, replay),
            "masses": _masses(run, motion),
            "drum": drum_of(setup),
        },
        "largest": {
            "time": float(motion.time[largest]),
            "rpm": float(SPEED.values(motion.drum_speed[largest])),
        },
    }


def _frames(motion: ShownMotion, samples: Any) -> list[dict[str, Any]]:
    """Return pose of the tub, angle of the drum, and balls of each ring, at some samples."""
    poses, angles = motion.poses[samples], motion.drum_angle[samples]
    balls = [np.round(ring[samples], 5).tolist() for ring in motion.balls]
    return [
        {"pose": pose, "angle": angle, "balls": [ring[k] for ring in balls]}
        for k, (pose, angle) in enumerate(
            zip(np.round(poses, 6).tolist(), np.round(angles, 4).tolist(), strict=True)
        )
    ]


def _masses(run: RunResult, motion: ShownMotion) -> list[dict[str, float]]:
    """Return the masses of the load, each with the share of water that is left in it."""
    load = run.case.load
    water = dict(zip(load.wet, motion.left.tolist(), strict=True))
    return [
        {"mass": mass, "radius": u.radius, "y": u.y, "phase": u.phase, "wet": water.get(k, 0.0)}
        for k, (u, mass) in enumerate(zip(load.unbalances, load.masses(motion.left), strict=True))
    ]


def _envelopes(motion: ShownMotion) -> list[dict[str, Any]]:
    """Return the corners of the upper and lower envelope of each sensor: straight lines between.

    They are `measures.envelopes`, which are lines from peak to peak, without the samples between.
    """
    time = _milliseconds(motion.time)
    corners: list[dict[str, Any]] = []
    for column in motion.filtered.T:
        sides: dict[str, Any] = {}
        if np.isnan(column[0]):  # too short to be filtered
            corners.append({"upper": [[], []], "lower": [[], []]})
            continue
        for name, sign in (("upper", 1.0), ("lower", -1.0)):
            at = local_maxima(sign * column)
            at = at if len(at) else np.arange(len(column))
            sides[name] = [time[at].tolist(), _whole(column[at])]
        corners.append(sides)
    return corners


def _orbits(motion: ShownMotion, setup: Setup) -> list[dict[str, Any]]:
    """Return the paths of the drum axis around the largest amplitude, at the sensors' depths."""
    depths = [point[1] for point in setup.sensor_points.values()]
    front, rear = float(min(depths)), float(max(depths))
    window = orbit_window(motion.time, motion.drum_angle, motion.largest, ORBIT_REVOLUTIONS)
    at = (front,) if have_one_orbit(front, rear) else (front, rear)
    points = np.array([[0.0, y, 0.0] for y in at])
    paths = point_displacements(motion.poses[window], points, motion.rest_pose)
    return [
        {"y": float(DISTANCE.values(y)), "x": _whole(path[:, 0]), "z": _whole(path[:, 2])}
        for y, path in zip(at, np.moveaxis(paths, 1, 0), strict=True)
    ]


def _forces(record: Record) -> dict[str, Any]:
    """Return smallest and largest value in each time bin of gasket and mount forces. [N, N m]"""
    forces = {}
    has_gasket = record.attrs["gasket"] == "yes"
    if has_gasket:
        gasket = record.sel(bushing="gasket")
        for kind, letter in (("force", "F"), ("moment", "M")):
            for index, axis in enumerate("xyz"):
                forces[f"gasket {letter}{axis}"] = gasket[f"bushing_{kind}"].values[:, index]
    size = np.linalg.norm(record.mount_force.values, axis=2)
    for index, name in enumerate(record.mount.values):
        if name == "gasket" and not has_gasket:
            continue
        forces[mount_title(str(name))] = size[:, index]
    if cabinet_in(record):
        feet = foot_loads_of(record)
        forces |= {foot_title(name): feet.normal[:, k] for k, name in enumerate(feet.feet)}
    count = record.sizes["time"]
    begins = np.unique(np.linspace(0, count, min(BINS, count), endpoint=False).astype(int))
    return {
        "time": _milliseconds(record.time.values[begins]).tolist(),
        "bands": {
            name: [
                np.round(reduce.reduceat(values, begins), 3).tolist()
                for reduce in (np.minimum, np.maximum)
            ]
            for name, values in forces.items()
        },
    }


def _gap_points(runner: Runner, run: RunResult) -> dict[str, Any] | None:
    """Return the two nearest points in W [m] and the frame of the smallest gap."""
    gap, motion = run.gap, run.motion
    if gap is None or motion is None:
        return None
    at = int(np.argmin(np.abs(motion.time - gap.time)))
    _, points = runner.scene().nearest_points(motion.poses[at], gap.moving, gap.fixed)
    return {"points": points.tolist(), "frame": _frames(motion, [at])[0]}


def _whole(values: FloatArray) -> list[int]:
    """Return displacements in whole micrometres."""
    return np.rint(values / MICRO).astype(int).tolist()


def _milliseconds(time: FloatArray) -> np.ndarray:
    """Return times in whole milliseconds."""
    return np.asarray(np.rint(time / MILLI).astype(int))
