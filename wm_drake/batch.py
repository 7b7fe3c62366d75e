"""simulate_many(machine, cases): thousands of cases on all cores, measured as they end, in flat memory."""

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
import xarray as xr
from pydrake.systems.framework import Context

from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.kernel.histories import POINT_SIZE, measure_samples_lanes
from wm_drake.kernel.integration import integrate_lanes
from wm_drake.kernel.mechanics import DRUM_RATE, LINE_SIZE
from wm_drake.kernel.packing import Layout, initial_state, pack_bodies, pack_elements
from wm_drake.kernel.schedule import Schedule, schedule_of
from wm_drake.laws.lanes import WIDTH
from wm_drake.laws.vectors import rotate, rotation_from_rpy
from wm_drake.machine import OUTPUT_PERIOD, Machine, Setup
from wm_drake.measures import amplitudes, filtered
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.elements import FloatArray
from wm_drake.simulation import AXES, DEFAULT_STEP, Case, check_step
from wm_drake.trajectory import Divergence, divergence_text, diverging_coordinate

MEASURES = {
    "extremes": ("detergent_displacement", "gasket_force", "gasket_moment"),
    "amplitudes": ("amplitude", "critical_speed"),
}
"""What `simulate_many` can measure, and the variables that gives."""

_VARIABLES = {
    "detergent_displacement": ("axis", "m", "largest displacement of the tub point nearest the detergent box, D of [B]"),
    "gasket_force": ("axis", "N", "largest force of the gasket on the housing, F of [B]"),
    "gasket_moment": ("axis", "N m", "largest moment of the gasket on the housing, M of [B]"),
    "amplitude": ("sensor", "m", "largest absolute value of the envelopes"),
    "critical_speed": ("sensor", "rad/s", "drum speed where it occurs"),
}

_KEPT_BODIES, _KEPT_NUMBERS = 64, 2048
PAUSE_STEPS = 4000
"""Steps between looks at the states: some ten milliseconds."""


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C during `simulate_many`; `finished` is the table of the runs that had ended."""

    def __init__(self, finished: xr.Dataset) -> None:
        """Keeps the table of what had ended."""
        super().__init__(f"interrupted after {finished.sizes['run']} runs")
        self.finished = finished


@dataclass(frozen=True)
class Ended:
    """A run that has ended.

    Attributes:
        number: Of its case, in the order given.
        case: What was run.
        values: Measures by name. SI.
        diverged: When and why it stopped early; "" if it did not.
    """

    number: int
    case: Case
    values: dict[str, FloatArray]
    diverged: str


@dataclass(frozen=True)
class _Job:
    """A case, packed: all that its run needs."""

    number: int
    case: Case
    packed: FloatArray
    points: FloatArray
    begin: FloatArray


@dataclass(frozen=True)
class _Numbers:
    """What is packed of a set of numbers apart from bodies and load; `parameters` are held so that no other takes their id."""

    parameters: MachineParameters
    elements: FloatArray
    layout: Layout
    points: FloatArray
    rest: FloatArray


@dataclass(frozen=True)
class _Kind:
    """What runs side by side must have in common."""

    profile: SpinProfile
    layout: Layout


def simulate_many(
    machine: Machine,
    cases: Iterable[Case],
    *,
    measures: Iterable[str] = MEASURES,
    step: float = DEFAULT_STEP,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
    finished: Callable[[Ended], None] = lambda ended: None,
) -> xr.Dataset:
    """Runs many cases of one machine with the compiled engine, several side by side in the vector units of each core.

    The numbers of a run do not depend on how many workers there are or what it runs beside.

    Args:
        machine: A built machine.
        cases: What to run; taken one by one as they are needed, so a generator keeps memory flat.
        measures: Keys of `MEASURES`: "extremes" are D, F, M of [B], "amplitudes" those of `measure` with their speeds.
        step: As for `simulate`.
        workers: Threads; as many as cores by default.
        progress: Called with the number of runs that have ended.
        finished: Called with each run as it ends.

    Returns:
        Table over `run`, the number of the case: coordinate `case` with its name; the measures as in `Measures` (SI,
        attrs["units"]); `diverged`: when and why a run stopped early, "" if it did not; its measures are those up to there.

    Raises:
        InputError: a case or an argument at fault; runs that had ended were handed to `finished`.
        SimulationInterrupted: Ctrl-C.
    """
    wanted = tuple(dict.fromkeys(measures))
    for name in wanted:
        if name not in MEASURES:
            raise input_error(f"no measure '{name}'{nearest_names(name, MEASURES)}", key="measures")
    check_step(step)
    results: dict[int, tuple[str, str, list[FloatArray]]] = {}

    def collect(runs: list[Ended]) -> None:
        for ended in runs:
            results[ended.number] = (ended.case.name, ended.diverged, list(ended.values.values()))
            finished(ended)
        progress(len(results))

    try:
        _run_all(_Batches(machine, step, wanted), cases, workers or os.cpu_count() or 1, collect)
    except KeyboardInterrupt:
        raise SimulationInterrupted(_table(machine, wanted, results)) from None
    return _table(machine, wanted, results)


def _table(machine: Machine, measures: tuple[str, ...], results: dict[int, tuple[str, str, list[FloatArray]]]) -> xr.Dataset:
    numbers = sorted(results)
    labels = {
        "run": numbers,
        "case": ("run", [results[number][0] for number in numbers]),
        "axis": list(AXES),
        "sensor": list(machine.parameters.sensors),
    }
    variables = {}
    for index, name in enumerate(name for measure in measures for name in MEASURES[measure]):
        dim, unit, text = _VARIABLES[name]
        values = np.reshape([results[number][2][index] for number in numbers], (len(numbers), len(labels[dim])))
        variables[name] = (("run", dim), values, {"units": unit, "long_name": text})
    diverged = np.array([results[number][1] for number in numbers], dtype=object)
    return xr.Dataset({**variables, "diverged": ("run", diverged)}, labels)


def _run_all(batches: "_Batches", cases: Iterable[Case], workers: int, collect: Callable[[list[Ended]], None]) -> None:
    """Feeds batches to threads, no more of them than keeps those busy, and hands on what ends."""
    running: set[Future[list[Ended]]] = set()

    def gather(at_most: int) -> None:
        nonlocal running
        while len(running) > at_most:
            ended, running = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                collect(future.result())

    with ThreadPoolExecutor(workers) as pool:
        try:
            for kind, jobs in batches.prepared(cases):
                running.add(pool.submit(batches.run, kind, jobs))
                gather(workers)  # one waits while the others run
            gather(0)
        except BaseException:
            batches.stopped.set()
            pool.shutdown(wait=True, cancel_futures=True)
            for future in running:  # what had ended meanwhile is not lost
                if future.done() and not future.cancelled() and future.exception() is None:
                    collect(future.result())
            raise


class _Batches:
    """Packs cases of a machine into batches, and runs those."""

    def __init__(self, machine: Machine, step: float, measures: tuple[str, ...]) -> None:
        self.machine, self.step, self.measures = machine, step, measures
        self.sensors = list(machine.parameters.sensors)
        self.stopped = threading.Event()
        self._context: Context | None = None
        self._schedules: dict[SpinProfile, Schedule] = {}
        self._known_bodies: list[tuple[object, FloatArray]] = []
        self._known_numbers: dict[tuple[int, bool], _Numbers] = {}
        self._memory = threading.local()

    def prepared(self, cases: Iterable[Case]) -> Iterator[tuple[_Kind, list[_Job]]]:
        """Batches of up to `WIDTH` jobs that can run side by side, in the order of the cases as far as that goes."""
        waiting: dict[_Kind, list[_Job]] = {}
        for number, case in enumerate(cases):
            kind, job = self._job(number, case)
            jobs = waiting.setdefault(kind, [])
            jobs.append(job)
            if len(jobs) == WIDTH:
                yield kind, waiting.pop(kind)
        yield from waiting.items()

    def _job(self, number: int, case: Case) -> tuple[_Kind, _Job]:
        if case.profile not in self._schedules:
            self._schedules[case.profile] = schedule_of(case.profile, self.step, OUTPUT_PERIOD)
        try:
            bodies, numbers = self._bodies(case), self._numbers(case)
        except InputError as error:
            raise InputError(Problem(f"case {number} '{case.name}'", p.key, p.message) for p in error.problems) from None
        begin = numbers.rest.copy()
        begin[DRUM_RATE] = case.profile.speed[0]
        job = _Job(number, case, np.concatenate([bodies, numbers.elements]), numbers.points, begin)
        return _Kind(case.profile, numbers.layout), job

    def _bodies(self, case: Case) -> FloatArray:
        """Packed bodies: the same for all cases with these bodies, frames and load."""
        parameters = case.parameters or self.machine.parameters
        key = (parameters.bodies, parameters.frames, case.load)
        for known, bodies in self._known_bodies:
            if known == key:
                return bodies
        bodies = pack_bodies(self._set_up(case, case.load))
        self._known_bodies = [(key, bodies), *self._known_bodies[: _KEPT_BODIES - 1]]
        return bodies

    def _numbers(self, case: Case) -> "_Numbers":
        """All else of a case: the same whatever its load."""
        parameters = case.parameters or self.machine.parameters
        key = (id(parameters), case.gasket)
        if key not in self._known_numbers:
            if len(self._known_numbers) >= _KEPT_NUMBERS:
                del self._known_numbers[next(iter(self._known_numbers))]
            setup = self._set_up(case, None)
            elements, layout = pack_elements(setup)
            rest = initial_state(setup, case.profile)
            self._known_numbers[key] = _Numbers(parameters, elements, layout, _points(setup), rest)
        return self._known_numbers[key]

    def _set_up(self, case: Case, load: Load | None) -> Setup:
        setup = self.machine.set_up(load, parameters=case.parameters, gasket=case.gasket, context=self._context)
        if list(setup.sensors) != self.sensors:
            raise input_error(f"has sensors {', '.join(setup.sensors)}; the machine has {', '.join(self.sensors)}")
        self._context = setup.context
        return setup

    def run(self, kind: _Kind, jobs: list[_Job]) -> list[Ended]:
        """Runs up to `WIDTH` jobs side by side and measures them; none if stopped on the way."""
        schedule = self._schedules[kind.profile]
        size, count, rows = len(jobs[0].begin), len(jobs[0].points) // POINT_SIZE, len(schedule.time)
        filled = [*jobs, *[jobs[-1]] * (WIDTH - len(jobs))]  # idle lanes repeat the last
        p, points, x = (self._lanes(name, [getattr(job, name) for job in filled]) for name in ("packed", "points", "begin"))
        samples, moved, extremes = (
            self._array(name, length)
            for name, length in (("samples", rows * size), ("moved", rows * count), ("extremes", count + 7))
        )
        samples[: x.size] = x.ravel()
        self._integrate(schedule, kind.layout, p.ravel(), x, samples)
        if self.stopped.is_set():
            return []
        work = self._array("work", size)
        measure_samples_lanes(samples, rows, size, p.ravel(), kind.layout.gasket, points.ravel(), count, work, moved, extremes)
        histories = samples.reshape(rows, size, WIDTH), moved.reshape(rows, count, WIDTH), extremes.reshape(-1, WIDTH)
        return [self._ended(job, schedule, *(a[..., lane] for a in histories)) for lane, job in enumerate(jobs)]

    def _integrate(self, schedule: Schedule, layout: Layout, p: FloatArray, x: FloatArray, samples: FloatArray) -> None:
        sizes = (len(x), len(x), len(x), LINE_SIZE * len(layout.dampers))
        work = tuple(self._array(f"stage {i}", size) for i, size in enumerate(sizes))
        done, count = 0, len(schedule.step)
        while done < count and not self.stopped.is_set():
            begin, done = done, min(done + PAUSE_STEPS, count)
            integrate_lanes(schedule.steps, begin, done, p, layout.elements, x.ravel(), work, samples)
            if all(diverging_coordinate(lane) for lane in x.T):
                samples[(np.max(schedule.row[:done]) + 1) * x.size :] = np.nan
                return

    def _ended(self, job: _Job, schedule: Schedule, samples: FloatArray, moved: FloatArray, extremes: FloatArray) -> Ended:
        sensors, good = len(self.sensors), int(extremes[-1])
        values: dict[str, FloatArray] = {}
        for measure in self.measures:
            if measure == "extremes":
                arrays: Iterable[FloatArray] = extremes[sensors:-1].reshape(3, 3).copy()
            else:
                size, at = amplitudes(filtered(moved[:good, :sensors], OUTPUT_PERIOD))
                arrays = size, np.where(np.isnan(size), np.nan, samples[at, DRUM_RATE])
            values |= dict(zip(MEASURES[measure], arrays, strict=True))
        return Ended(job.number, job.case, values, _divergence(schedule.time, samples, good))

    def _lanes(self, name: str, rows: list[FloatArray]) -> FloatArray:
        """Arrays of several runs as one of lanes, (size, WIDTH)."""
        lanes = self._array(name, len(rows[0])).reshape(-1, WIDTH)
        lanes[:] = np.stack(rows, axis=1)
        return lanes

    def _array(self, name: str, size: int) -> FloatArray:
        """An array of lanes of this thread, used again from batch to batch, at an address vectors are loaded from in one go."""
        kept = self._memory.__dict__
        if name not in kept or len(kept[name]) != size * WIDTH:
            raw = np.zeros(size * WIDTH + WIDTH)
            begin = (-raw.ctypes.data // raw.itemsize) % WIDTH
            kept[name] = raw[begin : begin + size * WIDTH]
        return kept[name]


def _divergence(time: FloatArray, samples: FloatArray, good: int) -> str:
    """What a record of the run would say."""
    if good == len(time):
        return ""
    reason = diverging_coordinate(samples[good])
    assert reason is not None  # the first sample out of bounds
    return divergence_text(Divergence(float(time[good]), *reason), time[:good], samples[:good])


def _points(setup: Setup) -> FloatArray:
    """What is measured of the motion, packed for `measure_samples`: the sensors, then the detergent point along x, y, z."""
    places = [*setup.sensor_points.values(), *[setup.detergent_point] * 3]
    axes = [*(AXES.index(sensor.axis) for sensor in setup.sensors.values()), 0, 1, 2]
    rotation = rotation_from_rpy(*map(float, setup.rest_pose[:3]))
    packed = []
    for place, axis in zip(places, axes, strict=True):
        at_rest = setup.rest_pose[3 + axis] + rotate(rotation, tuple(map(float, place)))[axis]
        packed += [*place, *(float(axis == i) for i in range(3)), at_rest]
    return np.array(packed)
