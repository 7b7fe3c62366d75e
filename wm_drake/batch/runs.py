"""Work items -> results: several runs side by side, measured as they end."""

import threading
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wm_drake.batch.work_items import BatchKey, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.elements.sensor import POINT_SIZE
from wm_drake.engines.compiled.mechanics import DRUM_RATE, RATES_SIZE, STATE_SIZE
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
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.histories import measure_samples_lanes
from wm_drake.simulation.measures import amplitudes, filtered, power_means
from wm_drake.simulation.records import Record, as_record
from wm_drake.simulation.vibration import region_displacements

MEASURES = {
    "extremes": ("detergent_displacement", "gasket_force", "gasket_moment"),
    "amplitudes": ("amplitude", "critical_speed"),
    "power means": ("power_mean",),
    "gap": ("smallest_gap",),
    "regions": ("region_displacement", "region_displacement_integrated"),
}
"""What can be measured of each run, with the names of its variables."""

_FILTERED = {"amplitudes", "power means"}
"""Measures that need the filtered displacements at the sensors."""


@dataclass(frozen=True)
class RunResult:
    """The result of one run.

    Attributes:
        number: Number of its case, in the given order.
        case: The case.
        values: Measures by name. SI.
        diverged: When and why the run stopped early; "" if it did not.
        record: Its history; None if histories were not requested.
    """

    number: int
    case: Case
    values: dict[str, FloatArray]
    diverged: str
    record: Record | None


class Runner:
    """Runs work items in any thread. Each thread reuses memory of its own from batch to batch."""

    def __init__(
        self, parameters: MachineParameters, measures: tuple[str, ...], histories: bool
    ) -> None:
        """Prepare for a machine.

        Args:
            parameters: Of the machine.
            measures: Keys of `MEASURES`.
            histories: Whether results have records.
        """
        self.parameters = parameters
        self.measures, self.histories = measures, histories
        self.stopped = threading.Event()
        self._memory = threading.local()

    def run(self, key: BatchKey, work_items: list[WorkItem]) -> list[RunResult]:
        """Run up to `WIDTH` work items side by side and measure them.

        Returns:
            A result for each work item; none if `stopped` was set meanwhile.
        """
        schedule = schedule_of(key.profile, key.stepping.step, OUTPUT_PERIOD)
        one_derivative = key.stepping.one_derivative(schedule)
        # without amplitudes only the detergent point is followed, which comes last
        first = 0 if _FILTERED & set(self.measures) else -3 * POINT_SIZE
        points = [item.numbers.points[first:] for item in work_items]
        rows, count = len(schedule.time), len(points[0]) // POINT_SIZE
        size = len(work_items[0].begin) + key.layout.rates_size
        p = self._lanes("packed", [item.packed for item in work_items])
        x = self._lanes("begin", [item.begin for item in work_items])
        samples = self._array("samples", rows * size)
        for _ in integrate_runs(schedule, one_derivative, key.layout, p, x, samples):
            if self.stopped.is_set():
                return []
        moved, extremes = self._array("moved", rows * count), self._array("extremes", count + 7)
        measure_samples_lanes(
            samples,
            rows,
            size,
            (LARGEST_ANGLE, LARGEST_DISPLACEMENT),
            p,
            key.layout.gasket,
            self._lanes("points", points),
            count,
            moved,
            extremes,
        )
        histories = (
            samples.reshape(rows, size, WIDTH),
            moved.reshape(rows, count, WIDTH),
            extremes.reshape(-1, WIDTH),
        )
        return [
            self._result(item, schedule, *(a[..., lane] for a in histories))
            for lane, item in enumerate(work_items)
        ]

    def _result(
        self,
        item: WorkItem,
        schedule: Schedule,
        samples: FloatArray,
        moved: FloatArray,
        extremes: FloatArray,
    ) -> RunResult:
        # the last three points are the detergent point's
        good, sensors = int(extremes[-1]), moved.shape[1] - 3
        values: dict[str, FloatArray] = {}
        if _FILTERED & set(self.measures):
            displacement = filtered(moved[:good, :sensors], OUTPUT_PERIOD)
        for measure in self.measures:
            if measure == "extremes":
                arrays: Iterable[FloatArray] = extremes[sensors:-1].reshape(3, 3).copy()
            elif measure == "gap":
                arrays = [self._gap(schedule.time[:good], samples[:good, :6], item.begin[:6])]
            elif measure == "regions":
                arrays = self._regions(item, np.ascontiguousarray(samples[:good]))
            elif measure == "power means":
                arrays = [power_means(displacement)]
            else:
                size, at = amplitudes(displacement)
                arrays = size, np.where(np.isnan(size), np.nan, samples[at, DRUM_RATE])
            values |= dict(zip(MEASURES[measure], arrays, strict=True))
        record = self._record(item, schedule, samples.copy()) if self.histories else None
        return RunResult(
            item.number, item.case, values, _divergence(schedule.time, samples, good), record
        )

    def _record(self, item: WorkItem, schedule: Schedule, samples: FloatArray) -> Record:
        trajectory = trajectory_of(samples, schedule, item.packed, item.numbers.layout)
        record = as_record(item.numbers.setup, item.case, trajectory)
        stepping = item.numbers.stepping
        return record.assign_attrs(
            engine="compiled", step_s=stepping.step, integrator=stepping.integrator
        )

    def _regions(self, item: WorkItem, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        setup = item.numbers.setup
        points = np.stack(list(setup.accelerometer_points.values()))
        motion, acceleration = (
            samples[:, :STATE_SIZE],
            samples[:, len(item.begin) :][:, :RATES_SIZE],
        )
        return region_displacements(
            motion, acceleration, points, setup.rest_pose, OUTPUT_PERIOD, item.case.profile
        )

    def _gap(self, time: FloatArray, poses: FloatArray, rest_pose: FloatArray) -> FloatArray:
        kept = self._memory.__dict__
        if "scene" not in kept:  # one for each thread: a scene has one pose at a time
            kept["scene"] = Scene(self.parameters)
        gap = kept["scene"].smallest_gap(time, poses, rest_pose)
        return np.array(np.nan if gap is None else gap.distance)

    def _lanes(self, name: str, runs: list[FloatArray]) -> FloatArray:
        """Return the arrays of several runs as one array of lanes."""
        return fill_lanes(self._array(name, len(runs[0])), runs)

    def _array(self, name: str, size: int) -> FloatArray:
        """Return an array of lanes that this thread reuses from batch to batch."""
        kept = self._memory.__dict__
        if name not in kept or len(kept[name]) != size * WIDTH:
            kept[name] = aligned(size * WIDTH)
        return kept[name]


def _divergence(time: FloatArray, samples: FloatArray, good: int) -> str:
    """Return why and when a run diverged, as its record has it; "" if it did not."""
    if good == len(time):
        return ""
    reason = diverging_coordinate(samples[good])
    assert reason is not None  # this is the first sample out of bounds
    return divergence_text(Divergence(float(time[good]), *reason), time[:good], samples[:good])
