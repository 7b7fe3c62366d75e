"""Work items -> results: several runs side by side, measured as they end."""

import functools
import threading
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np

from wm_drake.batch.work_items import BatchKey, WorkItem, side_by_side
from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH
from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.elements.sensor import POINT_SIZE
from wm_drake.elements.state_map import RATES_SIZE, WATER
from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.engines.compiled.local_error import SUMS_SIZE, estimates_of
from wm_drake.engines.compiled.mechanics import DRUM_ANGLE, DRUM_RATE, STATE_SIZE
from wm_drake.engines.compiled.run import RunLanes, integrate_runs
from wm_drake.engines.compiled.samples import torque_at_samples, trajectory_of
from wm_drake.engines.memory import available_memory, needed_memory
from wm_drake.engines.schedule import Schedule, schedule_of
from wm_drake.engines.trajectory import (
    LARGEST_ANGLE,
    LARGEST_DISPLACEMENT,
    Divergence,
    divergence_text,
    diverging_coordinate,
)
from wm_drake.model.scene import Gap, Path, Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.cabinet import floor_forces
from wm_drake.simulation.cases import Case
from wm_drake.simulation.convergence import (
    ACCURACY,
    COMPARED,
    LARGEST_LOSS,
    Accuracy,
    Attempt,
    Refinement,
    attributes_of,
    judged,
)
from wm_drake.simulation.displacements import amplitudes, filtered_lanes
from wm_drake.simulation.feet import FeetLoaded, cabinet_of
from wm_drake.simulation.histories import measure_samples_lanes
from wm_drake.simulation.measures import MEASURES, Measure, Run
from wm_drake.simulation.measures.run import Need
from wm_drake.simulation.mount_histories import measure_mounts_lanes
from wm_drake.simulation.mounts import mount_names, sums_size
from wm_drake.simulation.records import Record, as_record
from wm_drake.simulation.spring_tension import tensions_at
from wm_drake.simulation.stops import approaches

_NONE = np.empty(0, dtype=np.int64)
"""No indices."""


@dataclass(frozen=True)
class ShownMotion:
    """The motion of a run, for a picture; a record, with all forces, takes much longer.

    Attributes:
        time: Of each sample. (n,) [s]
        poses: Poses of the tub: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
        rest_pose: Pose of the tub at rest. (6,) [rad, m]
        drum_angle, drum_speed: Of the drum against the tub. (n,) [rad, rad/s]
        filtered: Filtered displacements at the sensors. (n, sensors) [m]
        largest: Sample of the largest amplitude of all sensors.
        left: Share of the water of each wet mass of the load at that sample. (wet,)
        balls: Of each ring on the drum: places in T of its balls, from the point of the drum axis.
            (n, balls, 3) [m]
    """

    time: FloatArray
    poses: FloatArray
    rest_pose: FloatArray
    drum_angle: FloatArray
    drum_speed: FloatArray
    filtered: FloatArray
    largest: int
    left: FloatArray
    balls: list[FloatArray]


@dataclass(frozen=True)
class RunResult:
    """The result of one run.

    Attributes:
        number: Number of its case, in the given order.
        case: The case.
        values: Measures by name. SI.
        diverged: When and why the run stopped early; "" if it did not.
        record: Its history; None if histories were not requested.
        gap: Where the smallest gap is; None if it was not measured.
        motion: Its motion; None if it was not requested, or has fewer than two samples.
        accuracy: How accurate it is; the runner knows it of each.
    """

    number: int
    case: Case
    values: dict[str, FloatArray]
    diverged: str
    record: Record | None
    gap: Gap | None = None
    motion: ShownMotion | None = None
    accuracy: Accuracy | None = None

    @property
    def stored_values(self) -> dict[str, FloatArray]:
        """Return the values, and the accuracy among them, for tables and ledgers."""
        known = {} if self.accuracy is None else {ACCURACY: np.array(self.accuracy)}
        return self.values | known


@dataclass(frozen=True)
class BatchOptions:
    """How cases are run; see `simulate_many`, and `Runner` for `compared`."""

    measures: tuple[str, ...]
    step: float | None = None
    integrator: str | None = None
    histories: bool = False
    workers: int | None = None
    engine: str = DEFAULT_ENGINE
    compared: tuple[str, ...] = COMPARED


Advance: TypeAlias = Callable[[int, float], None]
"""Function that is called with the number of a case and the fraction of its run that is done."""

BatchJobs: TypeAlias = Iterator[tuple[Any, ...]]
"""Functions that return lists of `RunResult`, each followed by its arguments."""


class Runner:
    """Runs work items in any thread. Each thread reuses memory of its own from batch to batch.

    Attributes:
        most_steps: Largest number of steps of a run that is repeated.
        compared: Keys of the measures that are compared where runs are repeated, if the runner has
            no measures of its own.
    """

    most_steps = float("inf")
    compared: tuple[str, ...] = COMPARED

    def __init__(
        self,
        parameters: MachineParameters,
        measures: tuple[str, ...],
        histories: bool | Container[int],
        scenes: list[Scene] | None = None,
        *,
        motions: Container[int] = (),
    ) -> None:
        """Prepare for a machine.

        Args:
            parameters: Of the machine.
            measures: Keys of `MEASURES`.
            histories: Whether results have records, or the numbers of the cases that have one.
            scenes: Scenes of the machine that no thread uses; the runner takes them from the list.
            motions: Numbers of the cases whose results have a motion; the measures must need
                sensors and shapes.
        """
        self.parameters = parameters
        self.measures = [MEASURES[name] for name in measures]
        self.histories, self.motions = histories, motions
        self.stopped = threading.Event()
        self._memory = threading.local()
        self._spare = [] if scenes is None else scenes
        self._again = list[WorkItem]()
        self.scenes: list[Scene] = []

    def run(
        self,
        key: BatchKey,
        work_items: list[WorkItem],
        progress: Callable[[float], None] = lambda fraction: None,
    ) -> list[RunResult]:
        """Run up to `WIDTH` work items side by side until each is accurate, and measure them.

        Args:
            key: What they have in common.
            work_items: The work items.
            progress: Called with the fraction of the first integration that is done.

        Returns:
            A result for each work item; none if `stopped` was set meanwhile.
        """
        results, again = self.attempt(key, work_items, progress)
        while again:
            batches, again = list(side_by_side(again)), []
            for finer, items in batches:
                ended, left = self.attempt(finer, items)
                results += ended
                again += left
        return results

    def run_or_postpone(
        self, key: BatchKey, work_items: list[WorkItem], progress: Callable[[float], None]
    ) -> list[RunResult]:
        """Run work items once; those that are not accurate wait for `postponed`."""
        results, again = self.attempt(key, work_items, progress)
        self._again.extend(again)
        return results

    def postponed(self, fewest: int) -> Iterator[tuple[BatchKey, list[WorkItem]]]:
        """Yield batches of work items that wait, of at least some items; call it in one thread."""
        items, self._again = self._again, []
        for key, batch in side_by_side(items):
            if len(batch) < fewest:
                self._again.extend(batch)
            else:
                yield key, batch

    def attempt(
        self,
        key: BatchKey,
        work_items: list[WorkItem],
        progress: Callable[[float], None] = lambda fraction: None,
    ) -> tuple[list[RunResult], list[WorkItem]]:
        """Run work items side by side; return results, and the items that must be repeated."""
        schedule = schedule_of(
            key.profile, key.stepping.step, key.period, key.layout.control_period
        )
        packed = self._lanes("packed", [item.packed for item in work_items])
        samples = self._samples(key, schedule, work_items, packed, progress)
        if samples is None:
            return [], []
        estimates, allowed = estimates_of(self._array("sums", SUMS_SIZE)), self._allowed
        is_compared = any(
            item.before or of_run.steps > allowed(item) or of_run.samples > LARGEST_LOSS
            for item, of_run in zip(work_items, estimates, strict=False)
        )
        is_bare = is_compared and not self.measures
        chosen = [MEASURES[name] for name in self.compared] if is_bare else self.measures
        needs = {need for measure in chosen for need in measure.needs}
        arrays = self._measured(key, work_items, packed, samples, needs)
        paths: list[Path | None] = [None] * len(work_items)
        if "shapes" in needs:
            good = arrays[2][-1, : len(work_items)].astype(int).tolist()
            rest_poses = [item.begin[:6] for item in work_items]
            paths = self.scene().paths(schedule.time, arrays[0], good, rest_poses)
        runs = [
            LaneRun(item, schedule, self.scene, Lane(*(array[..., lane] for array in arrays)), path)
            for lane, (item, path) in enumerate(zip(work_items, paths, strict=True))
        ]
        blocks = [measure.evaluate(runs) for measure in chosen]
        results, again = list[RunResult](), list[WorkItem]()
        for lane, run in enumerate(runs):
            values = _values_of(lane, chosen, blocks)
            this = Attempt(
                estimates[lane], key.stepping.step, run.item.halvings, run.diverged, values,
                float(np.abs(run.largest[0]).max()),
            )  # fmt: skip
            accuracy, finer = judged(this, run.item.before, allowed(run.item))
            if finer is not None and self._may_repeat(run.item, finer):
                again.append(run.item.repeated(this, finer))
            else:
                results.append(self._result(run, values, accuracy, "shapes" in needs))
        return results, again

    def _may_repeat(self, item: WorkItem, finer: Refinement) -> bool:
        """Return whether there are time and memory for a run that is repeated."""
        step, period = item.numbers.stepping.halved(finer.step).step, item.numbers.period
        profile = item.case.profile
        if profile.duration / step > self.most_steps:
            return False
        return needed_memory(profile, step, period / 2**finer.period) <= available_memory()

    def _allowed(self, item: WorkItem) -> float:
        """Return the largest error that the machine of a work item allows."""
        return (item.case.parameters or self.parameters).accuracy

    def _samples(
        self,
        key: BatchKey,
        schedule: Schedule,
        work_items: list[WorkItem],
        packed: FloatArray,
        progress: Callable[[float], None],
    ) -> FloatArray | None:
        """Return the samples of runs side by side (rows, state and rates, lanes).

        Args:
            key, work_items, progress: As for `run`.
            schedule: Steps of the runs.
            packed: Packed numbers of all lanes.

        Returns:
            None if `stopped` was set meanwhile.
        """
        rows = len(schedule.time)
        size = len(work_items[0].begin) + key.layout.states.begins.rates
        state = self._lanes("begin", [item.begin for item in work_items])
        samples, sums = self._array("samples", rows * size), self._array("sums", SUMS_SIZE)
        sums[:] = 0.0
        relaxation = None
        if key.stepping.integrator == "midpoint":
            matrices = [item.numbers.stepping.relaxation for item in work_items]
            relaxation = self._lanes("relaxation", matrices)
        lanes = RunLanes(packed, state, samples, sums, relaxation)
        one_derivative = key.stepping.one_derivative(schedule)
        for done in integrate_runs(schedule, one_derivative, key.layout, lanes):
            if self.stopped.is_set():
                return None
            progress(done)
        return samples.reshape(rows, size, WIDTH)

    def _measured(
        self,
        key: BatchKey,
        work_items: list[WorkItem],
        packed: FloatArray,
        samples: FloatArray,
        needs: set[Need],
    ) -> tuple[np.ndarray, ...]:
        """Return the arrays of `Lane` of runs side by side, lanes last, as far as needed."""
        # without amplitudes only the detergent point is followed, which comes last
        first = 0 if "sensors" in needs else -3 * POINT_SIZE
        points = [item.numbers.points[first:] for item in work_items]
        rows, size, count = *samples.shape[:2], len(points[0]) // POINT_SIZE
        moved, extremes = self._array("moved", count * rows), self._array("extremes", count + 7)
        springs = key.layout.mounts.springs if "springs" in needs else _NONE
        lengths = self._array("spring lengths", len(springs))
        measure_samples_lanes(
            samples.ravel(),
            rows,
            size,
            (LARGEST_ANGLE, LARGEST_DISPLACEMENT),
            packed,
            key.layout.gasket,
            key.layout.mounts.branches,
            self._lanes("points", points),
            count,
            springs,
            moved,
            extremes,
            lengths,
        )
        by_point = moved.reshape(count, rows, WIDTH)
        sensors = by_point[:-3] if "sensors" in needs else by_point[:0]
        filtered = self._filtered(sensors, extremes[-WIDTH:], key)
        return (
            samples,
            by_point.transpose(1, 0, 2),
            extremes.reshape(-1, WIDTH),
            *self._forces_of_mounts(key, samples, packed, needs),
            lengths.reshape(-1, WIDTH),
            filtered.transpose(1, 0, 2),
            *_peaks(filtered),
        )

    def _filtered(self, moved: FloatArray, good: FloatArray, key: BatchKey) -> FloatArray:
        """Return the filtered displacements at the sensors of runs side by side, if needed.

        Args:
            moved: Displacements at the sensors, none if not needed. (sensors, rows, lanes) [m]
            good: Number of samples of each run before it diverged. (lanes,)
            key: What the runs have in common.

        Returns:
            (sensors, rows, lanes); empty if no measure needs them or no run is complete. [m]
        """
        if not len(moved) or not np.any(good == moved.shape[1]):
            return np.empty((0, 0, WIDTH))
        band = pass_band(key.profile, key.period)
        return filtered_lanes(moved, key.period, band, self._array)

    def _forces_of_mounts(
        self, key: BatchKey, samples: FloatArray, p: FloatArray, needs: set[Need]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the sums and the wrenches on the cabinet of `measure_mounts_lanes`.

        Returns:
            (sums, lanes) and (rows, 6, lanes); empty if no measure needs them.
        """
        sums: FloatArray = np.empty(0)
        cabinet: FloatArray = np.empty(0)
        rows, size = samples.shape[:2]
        if {"mounts", "feet"} & needs:
            mounts, bounds = key.layout.mounts, (LARGEST_ANGLE, LARGEST_DISPLACEMENT)
            count = len(mount_names(self.parameters))
            sums = self._array("sums", sums_size(count))
            if "feet" in needs:
                cabinet = self._array("cabinet", rows * WRENCH_SIZE)
            measure_mounts_lanes(
                samples.ravel(), rows, size, bounds, p, mounts, count, cabinet, sums
            )
        return sums.reshape(-1, WIDTH), cabinet.reshape(-1, WRENCH_SIZE, WIDTH)

    def _result(
        self, run: "LaneRun", values: dict[str, FloatArray], accuracy: Accuracy, has_shapes: bool
    ) -> RunResult:
        """Return the result of a run that need not be repeated, from the values of its measures."""
        item, keeps = run.item, self.histories
        keeps = keeps if isinstance(keeps, bool) else item.number in keeps
        record = self._record(item, run.schedule, run.lane.samples.copy()) if keeps else None
        if record is not None:
            record.attrs |= attributes_of(accuracy)
        gap = run.gap if has_shapes else None
        motion = run.motion() if item.number in self.motions else None
        asked = {name: values[name] for measure in self.measures for name in measure.names}
        return RunResult(item.number, item.case, asked, run.diverged, record, gap, motion, accuracy)

    def _record(self, item: WorkItem, schedule: Schedule, samples: FloatArray) -> Record:
        trajectory = trajectory_of(samples, schedule, item.packed, item.layout)
        record = as_record(item.numbers.setup, item.case, trajectory)
        stepping = item.numbers.stepping
        return record.assign_attrs(
            engine="compiled", step_s=stepping.step, integrator=stepping.integrator
        )

    def scene(self) -> Scene:
        """Return the shapes of the machine, those of the thread that calls."""
        kept = self._memory.__dict__
        if "scene" not in kept:  # one for each thread: a scene has one pose at a time
            try:
                kept["scene"] = self._spare.pop()
            except IndexError:
                kept["scene"] = Scene(self.parameters)
            self.scenes.append(kept["scene"])
        return cast(Scene, kept["scene"])

    def _lanes(self, name: str, runs: list[FloatArray]) -> FloatArray:
        """Return the arrays of several runs as one array of lanes."""
        return fill_lanes(self._array(name, len(runs[0])), runs)

    def _array(self, name: str, size: int) -> FloatArray:
        """Return an array of lanes that this thread reuses from batch to batch."""
        kept = self._memory.__dict__
        if name not in kept or len(kept[name]) != size * WIDTH:
            kept[name] = aligned(size * WIDTH)
        return kept[name]


def _values_of(
    lane: int, measures: Sequence[Measure], blocks: Sequence[Sequence[FloatArray]]
) -> dict[str, FloatArray]:
    """Return the values of measures of the run in a lane by the names of their variables."""
    return {
        name: np.asarray(value[lane])
        for measure, block in zip(measures, blocks, strict=True)
        for name, value in zip(measure.names, block, strict=True)
    }


def _peaks(filtered: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the amplitudes (sensors, lanes) of filtered displacements (sensors, rows, lanes)."""
    if not len(filtered):
        return np.empty((0, WIDTH)), np.empty((0, WIDTH), dtype=int)
    sizes, at = zip(*map(amplitudes, filtered), strict=True)
    return np.stack(sizes), np.stack(at)


@dataclass(frozen=True)
class Lane:
    """The arrays of one run, one lane of the batch.

    Attributes:
        samples: (n, state and rates) samples.
        moved: (n, points) displacements at the sensors and the detergent point. [m]
        extremes: Largest values, then the number of good samples.
        mounts: Sums of `measure_mounts_lanes`; empty if not needed.
        cabinet: (n, 6) wrenches on the cabinet; empty if not needed.
        spring_lengths: (springs) smallest lengths; empty if not needed. [m]
        of_batch: (n, sensors) filtered displacements, computed for all runs of the batch at once;
            empty if not needed. [m]
        sizes, at: (sensors,) amplitudes of these displacements [m], and the numbers of their
            samples.
    """

    samples: FloatArray
    moved: FloatArray
    extremes: FloatArray
    mounts: FloatArray
    cabinet: FloatArray
    spring_lengths: FloatArray
    of_batch: FloatArray
    sizes: FloatArray
    at: np.ndarray


class LaneRun(Run):
    """The run in one lane of a batch."""

    def __init__(
        self,
        item: WorkItem,
        schedule: Schedule,
        scene: Callable[[], Scene],
        lane: Lane,
        path: Path | None = None,
    ) -> None:
        """Hold a work item, its schedule, the function that returns the shapes, lane and path."""
        self.item, self.schedule, self._find_scene, self.lane = item, schedule, scene, lane
        self.path = path
        self.profile, self.period = item.case.profile, item.numbers.period
        self.good = int(lane.extremes[-1])
        self._sensors = lane.moved.shape[1] - 3  # the last three points are the detergent point's

    @property
    def time(self) -> FloatArray:
        return self.schedule.time[: self.good]

    @property
    def drum_angle(self) -> FloatArray:
        return self.lane.samples[: self.good, DRUM_ANGLE]

    @property
    def drum_speed(self) -> FloatArray:
        return self.lane.samples[: self.good, DRUM_RATE]

    @property
    def motor_torque(self) -> FloatArray:
        samples = np.ascontiguousarray(self.lane.samples)
        of_run = samples, self.schedule, self.item.packed, self.item.layout
        return torque_at_samples(*of_run)[: self.good]

    @property
    def largest(self) -> FloatArray:
        return self.lane.extremes[self._sensors : -1].reshape(3, 3)

    @property
    def displacement(self) -> FloatArray:
        return self.lane.moved[: self.good, : self._sensors]

    @functools.cached_property
    def filtered(self) -> FloatArray:
        if self.good == len(self.lane.of_batch):
            # in the order of a record: sums are then rounded as those of a record
            return np.ascontiguousarray(self.lane.of_batch)
        return super().filtered

    @functools.cached_property
    def amplitudes(self) -> tuple[FloatArray, np.ndarray]:
        if self.good == len(self.lane.of_batch) > 0:
            return self.lane.sizes, self.lane.at
        return amplitudes(self.filtered)

    @property
    def poses(self) -> FloatArray:
        return self.lane.samples[: self.good, :6]

    @property
    def rest_pose(self) -> FloatArray:
        return self.item.begin[:6]

    def motion(self) -> ShownMotion | None:
        """Return the motion of the run; None if it has fewer than two samples."""
        if self.good < 2:
            return None
        sizes, at = self.amplitudes
        if not np.isnan(sizes).all():
            largest = at[np.nanargmax(sizes)]
        else:  # too short to be filtered
            largest = np.argmax(np.abs(self.displacement).max(axis=1))
        return ShownMotion(  # copies: the next batch uses the memory again
            self.time,
            self.poses.copy(),
            self.rest_pose.copy(),
            self.drum_angle.copy(),
            self.drum_speed.copy(),
            self.filtered.copy(),
            int(largest),
            self._water_left[largest].copy(),
            [
                self.lane.samples[: self.good, np.add.outer(ring, range(3))]
                for ring in self.item.layout.balls
            ],
        )

    @property
    def scene(self) -> Scene:
        return self._find_scene()

    @property
    def tub_motion(self) -> FloatArray:
        return self._samples(slice(STATE_SIZE))

    @property
    def tub_acceleration(self) -> FloatArray:
        begin = len(self.item.begin)
        return self._samples(slice(begin, begin + RATES_SIZE))

    def _samples(self, columns: slice) -> FloatArray:
        """Return columns of the samples; they are not kept, in all lanes they are much memory."""
        return np.ascontiguousarray(self.lane.samples[: self.good, columns])

    @property
    def accelerometer_points(self) -> FloatArray:
        return np.stack(list(self.item.numbers.setup.accelerometer_points.values()))

    @property
    def gravity(self) -> float:
        return self.item.numbers.setup.parameters.gravity

    @property
    def mount_sums(self) -> FloatArray:
        return self.lane.mounts

    @property
    def feet(self) -> FeetLoaded:
        parameters, wrenches = self.item.numbers.setup.parameters, self.lane.cabinet[: self.good]
        return FeetLoaded(
            cabinet_of(parameters), parameters.gravity, wrenches, self._floor_forces()
        )

    def _floor_forces(self) -> FloatArray | None:
        """Return the forces of the floor on the feet of a cabinet that moves, else None."""
        states = self.lane.samples[: self.good, : len(self.item.begin)]
        cabinet = self.item.layout.states.cabinet(states)
        if cabinet is None:
            return None
        assert self.item.numbers.setup.cabinet is not None
        return floor_forces(cabinet, self.item.numbers.setup.cabinet.packed())

    @functools.cached_property
    def _springs(self) -> tuple[FloatArray, FloatArray]:
        return tensions_at(self.item.numbers.setup.springs.values(), self.lane.spring_lengths)

    @property
    def smallest_tensions(self) -> FloatArray:
        return self._springs[0]

    @property
    def smallest_elongations(self) -> FloatArray:
        return self._springs[1]

    @property
    def approaches(self) -> tuple[FloatArray, FloatArray]:
        return approaches(self.item.numbers.setup, self._samples(slice(STATE_SIZE)))

    @property
    def mass_left(self) -> FloatArray:
        return np.asarray(self.item.case.load.masses(self._water_left).sum(axis=1))

    @property
    def _water_left(self) -> FloatArray:
        """Return the share of the water of each wet mass. (n, wet)"""
        states = self.lane.samples[: self.good, : len(self.item.begin)]
        return self.item.layout.states.take(states, WATER)

    @property
    def diverged(self) -> str:
        """Return why and when the run diverged, as its record has it; "" if it did not."""
        time, samples, good = self.schedule.time, self.lane.samples, self.good
        if good == len(time):
            return ""
        states = samples[good : good + 1, : len(self.item.begin)]
        cabinet = self.item.layout.states.cabinet(states)
        reason = diverging_coordinate(samples[good], None if cabinet is None else cabinet[0, :2])
        assert reason is not None  # this is the first sample out of bounds
        return divergence_text(Divergence(float(time[good]), *reason), time[:good], samples[:good])
