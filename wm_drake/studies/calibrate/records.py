"""Fit numbers of a machine to what its sensors recorded.

The data are the signals as they were recorded, or their amplitudes, and the model predicts these
signals. What is not known of the recorder are unknowns of the fit beside those of the machine, each
with a prior: the gain of each sensor and how it is tilted, offset and rate of each clock, and for
signals over time the angle of the drum at the start.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from scipy.interpolate import CubicSpline

from wm_drake.batch.ledger import Ledger, LedgerEntry, key_of
from wm_drake.errors import InputError
from wm_drake.parameters import Load, SpinProfile, Unbalance
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import turned_signals
from wm_drake.simulation.records import Record, profile_of, why_diverged
from wm_drake.studies.calibrate.blocks import BlockModel
from wm_drake.studies.calibrate.recorded import (
    By,
    RecordedBlock,
    RecordedLoad,
    amplitude_block,
    history_block,
    mean_of,
    reduced,
)
from wm_drake.studies.compare.pairs import OFFSET, PHASE, Pair, order_one
from wm_drake.studies.compare.study import RATE
from wm_drake.studies.fitting.problem import SMOOTH, Errors, Unknown

RECORDED = replace(SMOOTH, cost=1e-5, point=1e-4, gradient=1e-9, most=25)
"""Descent of a fit to records: noise of the amplitudes is larger than these tolerances."""

MISFIT = Quantity("misfit in standard deviations", decimals=2)

GAIN_SD = 0.01
"""Deviation of the gain of a sensor: an assumption, that of a usual accelerometer."""

TILT_SD = float(np.deg2rad(2.0))
"""Deviation of each of two angles by which the axis of a sensor is off: an assumption. [rad]"""

LEAST_PLACE_SD = 1e-5
"""Deviation of the place of a sensor that is known, where that of another one is not. [m]"""

OFFSET_SD, RATE_SD, ANGLE_SD = 1e-4, 1e-6, 0.05
"""Smallest deviations of a clock [s, 1] and of the angle of the drum at the start [rad]: what the
alignment claims is not better than the model it aligns with. An assumption."""

REACH = 6.0
"""Bounds of such an unknown, in deviations."""

RunKey: TypeAlias = tuple[bytes, str, SpinProfile, float, float]
"""What determines a run: numbers of the machine, load, profile, angle of the drum, factor of the
mass of the load."""

ColumnKey: TypeAlias = tuple[int, RunKey, int, float, float, tuple[float, ...]]
"""What determines the signal of a sensor: recording, run, number of the sensor, offset and rate of
the clock, both angles of the axis, and by what its place is off."""

PLACE_STEP = 1e-3
"""Step of a derivative by the place of a sensor. [m]"""

AT_ONCE = 16
"""Number of points after which the values are kept. Each fills a SIMD lane of two cores at most."""

KEPT_RUNS, KEPT_COLUMNS = 40, 1500
"""Numbers of runs and of amplitudes of a sensor beyond which none are kept for the next call."""


@dataclass(frozen=True, eq=False)
class RecordModel(BlockModel):
    """What sensors record as a function of unknowns of the machine and of the recorder.

    Attributes:
        sensors, points: Sensors by name, and their positions in T. [m]
        loads: Loads with their recordings.
        by: What is fitted.
        ledger: Where the values at each point are kept as soon as they are computed, so that a
            search that was killed goes through the same points again without runs; or None.
        load_deviation: Relative deviation of the mass of each load; 0 if it is known.
    """

    sensors: Mapping[str, RecordedSensor]
    loads: tuple[RecordedLoad, ...]
    points: Mapping[str, FloatArray]
    by: By
    ledger: Ledger | None = None
    load_deviation: float = 0.0

    misfit = MISFIT
    most_misfit = 2.0
    """A choice: planted machines with the right structure stay below it, one without its gasket has
    7."""
    descent = RECORDED

    _runs: dict[RunKey, FloatArray] = field(default_factory=dict, repr=False)
    _columns: dict[ColumnKey, FloatArray] = field(default_factory=dict, repr=False)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """Return all recordings."""
        return tuple(pair for load in self.loads for pair in load.pairs)

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Unknowns of the machine, then those of the recorder."""
        return (
            *self.free.unknowns,
            *self._of_sensors,
            *self._of_loads,
            *self._of_recordings,
        )

    @cached_property
    def has_places(self) -> bool:
        """Whether the place of a sensor is uncertain."""
        return any(sensor.place_deviation for sensor in self.sensors.values())

    @cached_property
    def _of_sensors(self) -> tuple[Unknown, ...]:
        """Gain, two angles of the axis and, where they are uncertain, the place of each sensor."""
        angle, length, unknowns = Unit("rad", "deg"), Unit("m", "mm"), []
        for name, sensor in self.sensors.items():
            unknowns.append(_nuisance(f"gain of {name}", 1.0, GAIN_SD, Unit("", "")))
            unknowns.append(_nuisance(f"tilt of {name}", 0.0, TILT_SD, angle))
            unknowns.append(_nuisance(f"other tilt of {name}", 0.0, TILT_SD, angle))
            for axis in "xyz" if self.has_places else "":
                width = max(sensor.place_deviation, LEAST_PLACE_SD)
                unknowns.append(_nuisance(f"{axis} of {name}", 0.0, width, length))
        return tuple(unknowns)

    @cached_property
    def _of_loads(self) -> tuple[Unknown, ...]:
        """Factor of the mass of each load, if it is uncertain."""
        names = [load.name for load in self.loads] if self.load_deviation else []
        width, unit = self.load_deviation, Unit("", "")
        return tuple(_nuisance(f"mass of load {name}", 1.0, width, unit) for name in names)

    @cached_property
    def _of_recordings(self) -> tuple[Unknown, ...]:
        """Offset and rate of the clock of each recording, and the angle at its start."""
        unknowns, names = [], [pair.recording.path.name for pair in self.pairs]
        for number, pair in enumerate(self.pairs, 1):
            name, at = names[number - 1], pair.alignment
            name = name if names.count(name) == 1 else f"{name} ({number})"
            offset, rate = max(at.offset_sd, OFFSET_SD), max(at.rate_sd, RATE_SD)
            unknowns.append(_nuisance(f"clock of {name}", 0.0, offset, OFFSET.unit))
            unknowns.append(_nuisance(f"clock rate of {name}", 0.0, rate, RATE.unit))
            if self.by == "history":
                start = float(order_one(pair).start)
                unknowns.append(_nuisance(f"drum angle of {name}", start, ANGLE_SD, PHASE.unit))
        return tuple(unknowns)

    @cached_property
    def blocks(self) -> tuple[RecordedBlock, ...]:
        """Return the data."""
        if self.by == "history":
            pairs = ((load, pair) for load in self.loads for pair in load.pairs)
            return tuple(history_block(load, pair, self.sensors) for load, pair in pairs)
        return tuple(amplitude_block(load, self.by) for load in self.loads)

    @property
    def errors(self) -> Errors:
        """Return what the errors are like: those of RMS of regions do not depend on each other."""
        return "alike" if self.by == "rms" else "correlated"

    def apart(self, rmse: float) -> str:
        """Return the RMS of the residuals in words."""
        return f"or by {MISFIT.number(rmse)} standard deviations"

    def computed(self, points: FloatArray) -> list[list[FloatArray]]:
        """Return what is predicted of each block (m, k) at each point; NaN where a run failed."""
        if self.ledger is None:
            return self._at(points)
        keys = [key_of(content=self._content, point=point) for point in points]
        new = {key: p for key, p in zip(keys, points, strict=True) if key not in self.ledger}
        for begin in range(0, len(new), AT_ONCE):
            part = list(new)[begin : begin + AT_ONCE]
            values = self._at(np.stack([new[key] for key in part]))
            self.ledger.put_all(
                {
                    key: LedgerEntry({str(number): one for number, one in enumerate(each)})
                    for key, each in zip(part, values, strict=True)
                }
            )
        return [list(self.ledger.get(key).values.values()) for key in keys]

    @cached_property
    def _content(self) -> str:
        """Return the hash of all that determines the values at a point, beside the machine."""
        machine = self.experiment.machine.parameters
        return key_of(
            fitted=self.by,
            sensors=dict(self.sensors),
            points=dict(self.points),
            records=[
                (
                    load.name,
                    load.load_at(machine),
                    profile_of(pair.run),
                    hashlib.sha256(pair.measured.tobytes()).hexdigest(),
                )
                for load in self.loads
                for pair in load.pairs
            ],
        )

    def _at(self, points: FloatArray) -> list[list[FloatArray]]:
        """Compute the values at points."""
        self._run(points)
        for load in self.loads:
            for pair in load.pairs:
                self._reduce(load, pair, points)
        return [[self._computed(block, point) for block in self.blocks] for point in points]

    def _computed(self, block: RecordedBlock, point: FloatArray) -> FloatArray:
        runs = [self._runs[self._key(block.load, pair, point)] for pair in block.pairs]
        if any(np.isnan(signals[0]).any() for signals in runs):
            return np.full(block.measured.shape, np.nan)
        each = [
            np.stack([self._columns[key] for key in self._keys(block.load, pair, point)], axis=1)
            for pair in block.pairs
        ]
        return mean_of(np.stack(each)) * self.sensors_at(point)[:, 0]

    def sensors_at(self, point: FloatArray) -> FloatArray:
        """Return gain, both angles, and by what the place is off, of each sensor (k, 3 or 6)."""
        count = len(self.free.unknowns)
        return point[count : count + len(self._of_sensors)].reshape(len(self.sensors), -1)

    def _keys(self, load: RecordedLoad, pair: Pair, point: FloatArray) -> list[ColumnKey]:
        """Return what determines the signal of each sensor of a recording at a point."""
        run = self._key(load, pair, point)
        offset, rate = self._of(pair, point)[:2].tolist()
        off = self.sensors_at(point)[:, 1:].tolist()
        return [(id(pair), run, k, offset, rate, tuple(each)) for k, each in enumerate(off)]

    def _reduce(self, load: RecordedLoad, pair: Pair, points: FloatArray) -> None:
        """Keep what is fitted of the signals of a recording at points, all new ones at once."""
        needed = dict.fromkeys(key for point in points for key in self._keys(load, pair, point))
        new = [key for key in needed if key not in self._columns]
        if not new:
            return
        time = pair.run.time.values
        columns = []
        for _, run, k, offset, rate, off in new:
            signal = self._runs[run][:, k] @ np.array([1.0, *off])
            if offset or rate:
                moved = time + offset + rate * (time - 0.5 * time[-1])
                signal = CubicSpline(time, signal)(np.clip(moved, time[0], time[-1]))
            columns.append(np.where(np.isfinite(pair.measured[:, k]), signal, np.nan))
        values = reduced(load, pair, np.stack(columns, axis=1), self.by)
        self._columns.update(zip(new, values.T, strict=True))

    def _of(self, pair: Pair, point: FloatArray) -> FloatArray:
        """Return the unknowns of a recording at a point."""
        size = len(self._of_recordings) // len(self.pairs)
        return point[len(point) - size * (len(self.pairs) - self.pairs.index(pair)) :][:size]

    def _key(self, load: RecordedLoad, pair: Pair, point: FloatArray) -> RunKey:
        """Return what determines the run of a recording at a point."""
        numbers = point[: len(self.free.unknowns)].tobytes()
        angle = float(self._of(pair, point)[2]) if self.by == "history" else 0.0
        factor = 1.0
        if self._of_loads:
            first = len(self.free.unknowns) + len(self._of_sensors)
            factor = float(point[first + self.loads.index(load)])
        return numbers, load.name, profile_of(pair.run), angle, factor

    def _run(self, points: FloatArray) -> None:
        """Run what is not kept of points, and keep the signals (n, k, 3), NaN of failed runs."""
        cases: dict[RunKey, Case] = {}
        needed = {
            self._key(load, pair, point): (load, pair, point)
            for point in points
            for load in self.loads
            for pair in load.pairs
        }
        if len(self._runs) > KEPT_RUNS or len(self._columns) > KEPT_COLUMNS:
            self._runs.clear()
            self._columns.clear()
        for key, (load, pair, point) in needed.items():
            if key in self._runs:
                continue
            self._runs[key] = np.full(
                (len(pair.run.time), len(self.sensors), 6 if self.has_places else 3), np.nan
            )
            try:
                machine = self.free.parameters_at(point[: len(self.free.unknowns)])
            except InputError:
                continue
            if self.experiment.can_run(machine):
                turned = scaled_load(turned_load(load.load_at(machine), key[3]), key[4])
                cases[key] = Case(load.name, turned, profile_of(pair.run), parameters=machine)
        keys = list(cases)

        def keep(number: int, record: Record) -> None:
            if not why_diverged(record):
                pair = needed[keys[number]][1]
                self._runs[keys[number]] = self._signals(record, pair.run.time.values)

        if cases:
            self.experiment.record(self.experiment.machine, list(cases.values()), keep, "records")

    def _signals(self, record: Record, time: FloatArray) -> FloatArray:
        """Return signals of a run and their derivatives by angles and places. (n, k, 3 or 6)

        Args:
            time: Times (n,). A run that was repeated with a shorter step has more samples. [s]
        """
        signals = turned_signals(record, self.sensors, self.points)
        parts = [signals]
        for step in PLACE_STEP * np.eye(3) if self.has_places else ():
            moved = {name: point + step for name, point in self.points.items()}
            of_moved = turned_signals(record, self.sensors, moved)
            parts.append((of_moved[:, :, :1] - signals[:, :, :1]) / PLACE_STEP)
        values = np.concatenate(parts, axis=2)
        if np.array_equal(record.time, time):
            return values
        return np.asarray(CubicSpline(record.time.values, values)(time))


def _nuisance(name: str, expected: float, deviation: float, unit: Unit) -> Unknown:
    reach = REACH * deviation
    prior = (expected, deviation)
    return Unknown(name, expected - reach, expected + reach, unit, prior=prior)


def scaled_load(load: Load, factor: float) -> Load:
    """Return a load whose masses and moments are larger by a factor."""
    if factor == 1.0:
        return load

    def scaled(part: Any) -> Any:
        name = "mass" if isinstance(part, Unbalance) else "moment"
        return part.model_copy(update={name: factor * getattr(part, name)}) if part else None

    return Load(
        unbalances=tuple(map(scaled, load.unbalances)),
        static=scaled(load.static),
        couple=scaled(load.couple),
    )


def turned_load(load: Load, angle: float) -> Load:
    """Return a load in a drum that stands further by an angle at the start. [rad]"""
    if not angle:
        return load

    def turned(part: Any) -> Any:
        return None if part is None else part.model_copy(update={"phase": part.phase + angle})

    return Load(
        unbalances=tuple(map(turned, load.unbalances)),
        static=turned(load.static),
        couple=turned(load.couple),
    )
