"""Jobs -> ended runs: several side by side, measured as they end."""

import threading
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wm_drake.batch.work_items import BatchKey, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.integration import integrate_lanes
from wm_drake.engines.compiled.mechanics import DRUM_RATE, LINE_SIZE, RATES_SIZE, STATE_SIZE
from wm_drake.engines.compiled.packing import Layout, aligned
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
from wm_drake.simulation.histories import POINT_SIZE, measure_samples_lanes
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
"""What can be measured of each run, and the variables that gives."""

_FILTERED = {"amplitudes", "power means"}
"""Measures of the filtered displacements at the sensors."""

PAUSE_STEPS = 4000
"""Steps between looks at the states: some ten milliseconds."""


@dataclass(frozen=True)
class RunResult:
    """A run that has ended.

    Attributes:
        number: Of its case, in the order given.
        case: What was run.
        values: Measures by name. SI.
        diverged: When and why it stopped early; "" if it did not.
        record: Its history, if that was asked for.
    """

    number: int
    case: Case
    values: dict[str, FloatArray]
    diverged: str
    record: Record | None


class Runner:
    """Runs work_items, in any thread: each has memory of its own, used again from batch to batch."""

    def __init__(
        self, parameters: MachineParameters, step: float, measures: tuple[str, ...], histories: bool
    ) -> None:
        """For a machine; what to measure, and whether records are wanted."""
        self.parameters, self.step, self.measures, self.histories = (
            parameters,
            step,
            measures,
            histories,
        )
        self.stopped = threading.Event()
        self._memory = threading.local()

    def run(self, kind: BatchKey, work_items: list[WorkItem]) -> list[RunResult]:
        """Runs up to `WIDTH` work_items side by side and measures them; none if stopped on the way."""
        schedule = schedule_of(kind.profile, self.step, OUTPUT_PERIOD)
        # without amplitudes only the detergent point is followed, which comes last
        first = 0 if _FILTERED & set(self.measures) else -3 * POINT_SIZE
        points = [item.numbers.points[first:] for item in work_items]
        size, count, rows = (
            len(work_items[0].begin) + kind.layout.rates_size,
            len(points[0]) // POINT_SIZE,
            len(schedule.time),
        )
        p, x = (
            self._lanes("packed", [item.packed for item in work_items]),
            self._lanes("begin", [item.begin for item in work_items]),
        )
        samples, moved, extremes = (
            self._array(name, length)
            for name, length in (
                ("samples", rows * size),
                ("moved", rows * count),
                ("extremes", count + 7),
            )
        )
        self._integrate(schedule, kind.layout, p.ravel(), x, samples)
        if self.stopped.is_set():
            return []
        measured = (
            self._lanes("points", points).ravel(),
            count,
            self._array("work", STATE_SIZE),
            moved,
            extremes,
        )
        bounds = LARGEST_ANGLE, LARGEST_DISPLACEMENT
        measure_samples_lanes(samples, rows, size, bounds, p.ravel(), kind.layout.gasket, *measured)
        histories = (
            samples.reshape(rows, size, WIDTH),
            moved.reshape(rows, count, WIDTH),
            extremes.reshape(-1, WIDTH),
        )
        return [
            self._ended(item, schedule, *(a[..., lane] for a in histories))
            for lane, item in enumerate(work_items)
        ]

    def _integrate(
        self, schedule: Schedule, layout: Layout, p: FloatArray, x: FloatArray, samples: FloatArray
    ) -> None:
        sizes = (len(x), len(x), len(x), LINE_SIZE * len(layout.dampers))
        work = tuple(self._array(f"stage {i}", size) for i, size in enumerate(sizes))
        done, steps, over = 0, len(schedule.step), False
        while done < steps and not over and not self.stopped.is_set():
            over = all(diverging_coordinate(lane) for lane in x.T)
            begin, done = (
                done,
                done + 1 if over else min(done + PAUSE_STEPS, steps),
            )  # one more: writes states out of bounds
            integrate_lanes(
                schedule.steps, begin, done, p, layout.elements, x.ravel(), work, samples
            )
        samples[
            (schedule.row[:done].max(initial=-1) + 1) * (x.size + layout.rates_size * WIDTH) :
        ] = np.nan

    def _ended(
        self,
        item: WorkItem,
        schedule: Schedule,
        samples: FloatArray,
        moved: FloatArray,
        extremes: FloatArray,
    ) -> RunResult:
        good, sensors = (
            int(extremes[-1]),
            moved.shape[1] - 3,
        )  # the last three points are the detergent point's
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
        return record.assign_attrs(engine="compiled", step_s=self.step)

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
        if "scene" not in kept:  # one for each thread: a scene is in one pose at a time
            kept["scene"] = Scene(self.parameters)
        gap = kept["scene"].smallest_gap(time, poses, rest_pose)
        return np.array(np.nan if gap is None else gap.distance)

    def _lanes(self, name: str, rows: list[FloatArray]) -> FloatArray:
        """Arrays of several runs as one of lanes, (size, WIDTH); idle lanes repeat the last."""
        lanes = self._array(name, len(rows[0])).reshape(-1, WIDTH)
        lanes[:] = np.stack([*rows, *[rows[-1]] * (WIDTH - len(rows))], axis=1)
        return lanes

    def _array(self, name: str, size: int) -> FloatArray:
        """An array of lanes of this thread, used again from batch to batch."""
        kept = self._memory.__dict__
        if name not in kept or len(kept[name]) != size * WIDTH:
            kept[name] = aligned(size * WIDTH)
        return kept[name]


def _divergence(time: FloatArray, samples: FloatArray, good: int) -> str:
    """What a record of the run would say."""
    if good == len(time):
        return ""
    reason = diverging_coordinate(samples[good])
    assert reason is not None  # the first sample out of bounds
    return divergence_text(Divergence(float(time[good]), *reason), time[:good], samples[:good])
