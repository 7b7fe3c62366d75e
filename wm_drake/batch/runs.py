"""Work items -> results: several runs side by side, measured as they end."""

import functools
import threading
from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from wm_drake.batch.work_items import BatchKey, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.elements.sensor import POINT_SIZE
from wm_drake.engines.compiled.mechanics import DRUM_ANGLE, DRUM_RATE, RATES_SIZE, STATE_SIZE
from wm_drake.engines.compiled.packing import aligned, fill_lanes
from wm_drake.engines.compiled.run import integrate_runs
from wm_drake.engines.compiled.samples import trajectory_of
from wm_drake.engines.schedule import Schedule, schedule_of
from wm_drake.engines.trajectory import (
    LARGEST_ANGLE,
    LARGEST_DISPLACEMENT,
    Divergence,
    divergence_text,
    diverging_coordinate,
)
from wm_drake.model.machine import OUTPUT_PERIOD
from wm_drake.model.scene import Gap, Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cabinet import floor_forces
from wm_drake.simulation.cases import Case
from wm_drake.simulation.drive import VARIABLES as DRIVE_VARIABLES
from wm_drake.simulation.drive import measured_drive
from wm_drake.simulation.feet import FOOT_VARIABLES, REGION_VARIABLES, cabinet_of, foot_measures
from wm_drake.simulation.histories import measure_samples_lanes, poses_of_runs
from wm_drake.simulation.measures import amplitudes, filtered, filtered_lanes, power_means
from wm_drake.simulation.mount_histories import measure_mounts_lanes
from wm_drake.simulation.mounts import (
    KINDS,
    cabinet_measures,
    mount_measures,
    mount_names,
    mounts_of,
    sums_size,
)
from wm_drake.simulation.records import Record, as_record
from wm_drake.simulation.spring_tension import tensions_at
from wm_drake.simulation.vibration import region_displacements

MEASURES = {
    "extremes": ("detergent_displacement", "gasket_force", "gasket_moment"),
    "amplitudes": ("amplitude", "critical_speed"),
    "amplitudes in regions": ("region_amplitude", "region_critical_speed"),
    "power means": ("power_mean",),
    "gap": ("smallest_gap",),
    "contacts": ("nearest_pair", "contact_gap"),
    "regions": ("region_displacement", "region_displacement_integrated"),
    "mounts": tuple(f"mount_force_{kind}" for kind in KINDS),
    "drive": tuple(DRIVE_VARIABLES),
    "feet": FOOT_VARIABLES,
    "feet regions": REGION_VARIABLES,
    "cabinet": tuple(f"cabinet_{of}_{kind}" for of in ("force", "moment") for kind in KINDS),
    "spring tensions": ("smallest_spring_tension", "smallest_spring_elongation"),
}
"""What can be measured of each run, with the names of its variables."""

_FILTERED = {"amplitudes", "amplitudes in regions", "power means"}
"""Measures that need the filtered displacements at the sensors."""

_OF_GAP = {"gap", "contacts"}
"""Measures that need the poses of the tub."""

_OF_FEET = {"feet", "feet regions"}
"""Measures that need the wrench on the cabinet over time."""

_OF_MOUNTS = {"mounts", "cabinet"} | _OF_FEET
"""Measures that need the forces of the mounts."""


_NONE = np.empty(0, dtype=np.int64)
"""No indices."""


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
    """

    number: int
    case: Case
    values: dict[str, FloatArray]
    diverged: str
    record: Record | None
    gap: Gap | None = None


class Runner:
    """Runs work items in any thread. Each thread reuses memory of its own from batch to batch."""

    def __init__(
        self,
        parameters: MachineParameters,
        measures: tuple[str, ...],
        histories: bool | Container[int],
        scenes: list[Scene] | None = None,
        *,
        are_alike: bool = False,
    ) -> None:
        """Prepare for a machine.

        Args:
            parameters: Of the machine.
            measures: Keys of `MEASURES`.
            histories: Whether results have records, or the numbers of the cases that have one.
            scenes: Scenes of the machine that no thread uses; the runner takes them from the list.
            are_alike: Whether the runs of a batch differ little, so that the smallest gap of the
                first leads to those of the others.
        """
        self.are_alike = are_alike
        self.parameters = parameters
        self.measures, self.histories = measures, histories
        self.stopped = threading.Event()
        self._memory = threading.local()
        self._spare = [] if scenes is None else scenes
        self.scenes: list[Scene] = []

    def run(self, key: BatchKey, work_items: list[WorkItem]) -> list[RunResult]:
        """Run up to `WIDTH` work items side by side and measure them.

        Returns:
            A result for each work item; none if `stopped` was set meanwhile.
        """
        schedule = schedule_of(
            key.profile, key.stepping.step, OUTPUT_PERIOD, key.layout.control_period
        )
        one_derivative = key.stepping.one_derivative(schedule)
        # without amplitudes only the detergent point is followed, which comes last
        first = 0 if _FILTERED & set(self.measures) else -3 * POINT_SIZE
        points = [item.numbers.points[first:] for item in work_items]
        rows, count = len(schedule.time), len(points[0]) // POINT_SIZE
        size = len(work_items[0].begin) + key.layout.rates_size
        p = self._lanes("packed", [item.packed for item in work_items])
        x = self._lanes("begin", [item.begin for item in work_items])
        samples = self._array("samples", rows * size)
        relaxation = None
        if key.stepping.integrator == "midpoint":
            matrices = [item.numbers.stepping.relaxation for item in work_items]
            relaxation = self._lanes("relaxation", matrices)
        for _ in integrate_runs(schedule, one_derivative, key.layout, p, x, samples, relaxation):
            if self.stopped.is_set():
                return []
        moved, extremes = self._array("moved", rows * count), self._array("extremes", count + 7)
        springs = key.layout.elements.springs if "spring tensions" in self.measures else _NONE
        lengths = self._array("spring lengths", len(springs))
        measure_samples_lanes(
            samples,
            rows,
            size,
            (LARGEST_ANGLE, LARGEST_DISPLACEMENT),
            p,
            key.layout.gasket,
            key.layout.elements.branches,
            self._lanes("points", points),
            count,
            springs,
            moved,
            extremes,
            lengths,
        )
        histories = (
            samples.reshape(rows, size, WIDTH),
            moved.reshape(rows, count, WIDTH),
            extremes.reshape(-1, WIDTH),
            *self._forces_of_mounts(key, samples, rows, size, p),
        )
        filtered = self._filtered(moved.reshape(rows, count, WIDTH), extremes[-WIDTH:])
        by_lane = (
            lengths.reshape(-1, WIDTH),
            filtered,
            *_peaks(filtered),
            np.moveaxis(self._poses(samples, rows, size), 0, -1),
        )
        runs = [_Run.of_lane(lane, *histories, *by_lane) for lane in range(len(work_items))]
        if self.are_alike and "gap" in self.measures:
            near = self._smallest_gap(work_items[0], schedule, runs[0])
            for item, run in zip(work_items[1:], runs[1:], strict=True):
                self._smallest_gap(item, schedule, run, near)
        return [
            self._result(item, schedule, run) for item, run in zip(work_items, runs, strict=True)
        ]

    def _poses(self, samples: FloatArray, rows: int, size: int) -> FloatArray:
        """Return the poses of the tub of each run (lanes, rows, 6), if a measure needs them."""
        if not _OF_GAP & set(self.measures):
            return np.empty((WIDTH, 0, 6))
        poses = self._array("poses", rows * 6).reshape(WIDTH, rows, 6)
        poses_of_runs(samples, rows, size, poses)
        return poses

    def _filtered(self, moved: FloatArray, good: FloatArray) -> FloatArray:
        """Return the filtered displacements at the sensors of runs side by side, if needed.

        Args:
            moved: Displacements at the measured points. (rows, points, lanes) [m]
            good: Number of samples of each run before it diverged. (lanes,)

        Returns:
            (rows, sensors, lanes); of no rows if no measure needs them or no run is complete. [m]
        """
        rows, sensors = len(moved), moved.shape[1] - 3
        if not _FILTERED & set(self.measures) or not np.any(good == rows):
            return np.empty((0, 0, WIDTH))
        flat = filtered_lanes(moved.reshape(rows, -1), sensors, OUTPUT_PERIOD, self._array)
        return flat.reshape(rows, sensors, WIDTH)

    def _forces_of_mounts(
        self, key: BatchKey, samples: FloatArray, rows: int, size: int, p: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the sums and the wrenches on the cabinet of `measure_mounts_lanes`.

        Returns:
            (sums, lanes) and (rows, 6, lanes); empty if no measure needs them.
        """
        sums: FloatArray = np.empty(0)
        cabinet: FloatArray = np.empty(0)
        if _OF_MOUNTS & set(self.measures):
            mounts, bounds = mounts_of(key.layout), (LARGEST_ANGLE, LARGEST_DISPLACEMENT)
            count = len(mount_names(self.parameters))
            sums = self._array("sums", sums_size(count))
            keeps = bool(_OF_FEET & set(self.measures))
            cabinet = self._array("cabinet", rows * WRENCH_SIZE) if keeps else np.empty(0)
            measure_mounts_lanes(samples, rows, size, bounds, p, mounts, count, cabinet, sums)
        return sums.reshape(-1, WIDTH), cabinet.reshape(-1, WRENCH_SIZE, WIDTH)

    def _result(self, item: WorkItem, schedule: Schedule, run: "_Run") -> RunResult:
        """Return the measures of a run; each group of measures is computed by its own method."""
        values: dict[str, FloatArray] = {}
        for measure in self.measures:
            arrays = _MEASURED[measure](self, item, schedule, run)
            values |= dict(zip(MEASURES[measure], arrays, strict=True))
        keeps = self.histories
        keeps = keeps if isinstance(keeps, bool) else item.number in keeps
        record = self._record(item, schedule, run.samples.copy()) if keeps else None
        diverged = _divergence(schedule.time, run.samples, run.good, item)
        gap = run.gap[0] if run.gap else None
        return RunResult(item.number, item.case, values, diverged, record, gap)

    def _record(self, item: WorkItem, schedule: Schedule, samples: FloatArray) -> Record:
        trajectory = trajectory_of(samples, schedule, item.packed, item.numbers.layout)
        record = as_record(item.numbers.setup, item.case, trajectory)
        stepping = item.numbers.stepping
        return record.assign_attrs(
            engine="compiled", step_s=stepping.step, integrator=stepping.integrator
        )

    def _regions(self, item: WorkItem, _schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        setup, samples = item.numbers.setup, np.ascontiguousarray(run.samples[: run.good])
        points = np.stack(list(setup.accelerometer_points.values()))
        motion, acceleration = (
            samples[:, :STATE_SIZE],
            samples[:, len(item.begin) :][:, :RATES_SIZE],
        )
        return region_displacements(
            motion, acceleration, points, setup.rest_pose, OUTPUT_PERIOD, item.case.profile
        )

    def _feet(self, item: WorkItem, _schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        return self._of_feet(FOOT_VARIABLES, item, run)

    def _feet_in_regions(
        self, item: WorkItem, _schedule: Schedule, run: "_Run"
    ) -> Iterable[FloatArray]:
        return self._of_feet(REGION_VARIABLES, item, run)

    def _of_feet(self, names: Iterable[str], item: WorkItem, run: "_Run") -> Iterable[FloatArray]:
        if not run.feet:
            parameters = item.numbers.setup.parameters
            found = foot_measures(
                cabinet_of(parameters),
                parameters.gravity,
                run.cabinet[: run.good],
                item.case.profile,
                OUTPUT_PERIOD,
                floor_forces=_floor_forces(item, run),
            )
            run.feet.update(found)
        return [run.feet[name] for name in names]

    def _gap(self, item: WorkItem, schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        gap = self._smallest_gap(item, schedule, run)
        return [np.array(np.nan if gap is None else gap.distance)]

    def _contacts(self, item: WorkItem, schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        gap, scene = self._smallest_gap(item, schedule, run), self.scene()
        pairs = scene.pair_names()
        touching: FloatArray = np.full(len(pairs), np.nan)
        if gap is None:
            return [np.array(np.nan), touching]
        if gap.distance <= 0.0:
            touching = scene.contacts(*run.poses(schedule), item.begin[:6])
        return [np.array(float(pairs.index(f"{gap.moving}|{gap.fixed}"))), touching]

    def _smallest_gap(
        self, item: WorkItem, schedule: Schedule, run: "_Run", near: Gap | None = None
    ) -> Gap | None:
        if not run.gap:
            run.gap.append(self.scene().smallest_gap(*run.poses(schedule), item.begin[:6], near))
        return run.gap[0]

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

    def _amplitudes(
        self, _item: WorkItem, _schedule: Schedule, run: "_Run"
    ) -> Iterable[FloatArray]:
        is_complete = run.good == len(run.of_batch) > 0
        size, at = (run.sizes.copy(), run.at) if is_complete else amplitudes(run.displacement)
        return size, np.where(np.isnan(size), np.nan, run.samples[at, DRUM_RATE])

    def _amplitudes_in_regions(
        self, item: WorkItem, schedule: Schedule, run: "_Run"
    ) -> Iterable[FloatArray]:
        time = schedule.time[: run.good]
        shape = len(item.case.profile.regions), run.sensors
        sizes, speeds = np.full(shape, np.nan), np.full(shape, np.nan)
        for row, region in enumerate(item.case.profile.regions):
            inside = np.flatnonzero((time >= region.begin) & (time < region.end))
            size, at = amplitudes(run.displacement[inside])
            known = ~np.isnan(size)
            sizes[row, known] = size[known]
            speeds[row, known] = run.samples[inside[at[known]], DRUM_RATE]
        return sizes, speeds

    def _power_means(
        self, _item: WorkItem, _schedule: Schedule, run: "_Run"
    ) -> Iterable[FloatArray]:
        return [power_means(run.displacement)]

    def _extremes(self, _item: WorkItem, _schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        return run.extremes[run.sensors : -1].reshape(3, 3).copy()

    def _spring_tensions(
        self, item: WorkItem, _schedule: Schedule, run: "_Run"
    ) -> Iterable[FloatArray]:
        return tensions_at(item.numbers.setup.springs.values(), run.spring_lengths)

    def _drive(self, item: WorkItem, schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        samples = np.ascontiguousarray(run.samples)
        found = trajectory_of(samples, schedule, item.packed, item.numbers.layout)
        motion = found.state[:, DRUM_ANGLE], found.state[:, DRUM_RATE]
        return measured_drive(found.time, *motion, found.motor_torque, item.case.profile)

    def _mounts(self, _item: WorkItem, _schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        return mount_measures(run.mounts)

    def _cabinet(self, _item: WorkItem, _schedule: Schedule, run: "_Run") -> Iterable[FloatArray]:
        return cabinet_measures(run.mounts)

    def _lanes(self, name: str, runs: list[FloatArray]) -> FloatArray:
        """Return the arrays of several runs as one array of lanes."""
        return fill_lanes(self._array(name, len(runs[0])), runs)

    def _array(self, name: str, size: int) -> FloatArray:
        """Return an array of lanes that this thread reuses from batch to batch."""
        kept = self._memory.__dict__
        if name not in kept or len(kept[name]) != size * WIDTH:
            kept[name] = aligned(size * WIDTH)
        return kept[name]


def _floor_forces(item: WorkItem, run: "_Run") -> FloatArray | None:
    """Return the forces of the floor on the feet of a cabinet that moves; None if it is fixed."""
    cabinet = item.numbers.layout.cabinet_part(run.samples[: run.good, : len(item.begin)])
    if cabinet is None:
        return None
    assert item.numbers.setup.cabinet is not None
    return floor_forces(cabinet, item.numbers.setup.cabinet.packed())


def _divergence(time: FloatArray, samples: FloatArray, good: int, item: WorkItem) -> str:
    """Return why and when a run diverged, as its record has it; "" if it did not."""
    if good == len(time):
        return ""
    states = samples[good : good + 1, : len(item.begin)]
    cabinet = item.numbers.layout.cabinet_part(states)
    reason = diverging_coordinate(samples[good], None if cabinet is None else cabinet[0, :2])
    assert reason is not None  # this is the first sample out of bounds
    return divergence_text(Divergence(float(time[good]), *reason), time[:good], samples[:good])


def _peaks(filtered: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the amplitudes (sensors, lanes) of filtered displacements (rows, sensors, lanes)."""
    rows, sensors, lanes = filtered.shape
    sizes, at = amplitudes(filtered.reshape(rows, sensors * lanes))
    return sizes.reshape(sensors, lanes), at.reshape(sensors, lanes)


@dataclass(frozen=True)
class _Run:
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
        all_poses: (n, 6) poses of the tub; empty if not needed. [rad, m]
        feet: Measures of the feet, filled when they are computed first.
        gap: The smallest gap, filled when it is computed first.
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
    all_poses: FloatArray
    feet: dict[str, FloatArray] = field(default_factory=dict)
    gap: list[Gap | None] = field(default_factory=list)

    def poses(self, schedule: Schedule) -> tuple[FloatArray, FloatArray]:
        """Return the times (n,) [s] and the poses (n, 6) of the tub before the run diverged."""
        return schedule.time[: self.good], self.all_poses[: self.good]

    @classmethod
    def of_lane(cls, lane: int, *arrays: np.ndarray) -> "_Run":
        """Return the run in a lane of the arrays, which are in the order of the attributes."""
        samples, moved, extremes, mounts, cabinet, lengths, of_batch, sizes, at, poses = (
            array[..., lane] for array in arrays
        )
        return cls(samples, moved, extremes, mounts, cabinet, lengths, of_batch, sizes, at, poses)

    @property
    def good(self) -> int:
        """Number of samples before the run diverged, or all."""
        return int(self.extremes[-1])

    @property
    def sensors(self) -> int:
        """Number of sensors; the last three points are the detergent point's."""
        return self.moved.shape[1] - 3

    @functools.cached_property
    def displacement(self) -> FloatArray:
        """Filtered displacements (n, sensors). [m]"""
        if self.good == len(self.of_batch):
            return self.of_batch
        return filtered(self.moved[: self.good, : self.sensors], OUTPUT_PERIOD)


_MEASURED = {
    "extremes": Runner._extremes,
    "amplitudes": Runner._amplitudes,
    "amplitudes in regions": Runner._amplitudes_in_regions,
    "power means": Runner._power_means,
    "gap": Runner._gap,
    "contacts": Runner._contacts,
    "regions": Runner._regions,
    "mounts": Runner._mounts,
    "cabinet": Runner._cabinet,
    "drive": Runner._drive,
    "feet": Runner._feet,
    "feet regions": Runner._feet_in_regions,
    "spring tensions": Runner._spring_tensions,
}
"""Method that computes each measure of `MEASURES`."""
