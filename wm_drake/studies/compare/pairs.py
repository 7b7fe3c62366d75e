"""Recordings on the times of runs: clocks, speeds; order 1 of measured and predicted."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import SPEED, TIME, Quantity
from wm_drake.simulation.alignment import (
    Alignment,
    align_pulses,
    align_signals,
    align_speed,
    at_run,
    vectors_of_order_one,
)
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.records import Record
from wm_drake.studies.compare.recordings import TestRecording, pulse_angle

SPEED_STEP = 0.25
"""Time between the points of a measured profile. [s]"""

LEAD_ACCELERATION, LEAD_LONGEST, LEAD_HELD = 2.5, 10.0, 3.0
"""How a model comes to the first recorded speed if that does not rise by itself: the acceleration,
24 rpm in a second, and longest time of a rise from rest, and the time at the speed until its
beginning has died away. [rad/s^2, s, s] Assumptions: those of usual run-ups."""

QUANTITIES = {
    "displacement": Quantity("displacement", Unit("m", "mm"), 3),
    "velocity": Quantity("velocity", Unit("m/s", "mm/s"), 2),
    "acceleration": Quantity("acceleration", Unit("m/s^2", "m/s^2"), 3),
}
"""What sensors measure."""

CORRELATION = Quantity("correlation", decimals=3)
PHASE = Quantity("phase difference", Unit("rad", "deg"), 1)
OFFSET = Quantity("offset of the clock", Unit("s", "ms"), 2)


@dataclass(frozen=True, eq=False)
class Pair:
    """A recording on the times of its run, and what the model predicts of it.

    Attributes:
        recording: The recording.
        run: Record of the run.
        alignment: Clock of the recording.
        measured, predicted: Signals at the times of the run (n, sensors); measured ones are NaN in
            gaps. SI.
        speed: Recorded drum speed at the samples of the recording; None without one. [rad/s]
    """

    recording: TestRecording
    run: Record
    alignment: Alignment
    measured: FloatArray
    predicted: FloatArray
    speed: FloatArray | None = None

    @property
    def both(self) -> FloatArray:
        """Measured, then predicted signals, both with the gaps of the measured ones (2, n, k)."""
        gaps = np.where(np.isfinite(self.measured), 0.0, np.nan)
        return np.stack([self.measured, self.predicted + gaps])


def predicted_signals(
    run: Record, sensors: Mapping[str, RecordedSensor], points: Mapping[str, FloatArray]
) -> FloatArray:
    """Return the signals of sensors that a run predicts. (n, sensors) [SI]

    Args:
        points: Positions of the sensors in T, (3,) each. [m]
    """
    columns = [recorded_signal(run, sensor, points[name]) for name, sensor in sensors.items()]
    return np.stack(columns, axis=1)


def paired(recording: TestRecording, run: Record, predicted: FloatArray) -> Pair:
    """Return a recording on the times of a run."""
    alignment = _alignment(recording, run, predicted)
    return replace(pair_at(recording, run, predicted, alignment), speed=recording.speed)


def pair_at(
    recording: TestRecording,
    run: Record,
    predicted: FloatArray,
    alignment: Alignment,
    begin: float = 0.0,
) -> Pair:
    """Return a recording on the times of a run, by a known alignment.

    Args:
        begin: Time of the run at which it begins to follow the recording. [s]
    """
    values = np.stack([*recording.channels.values.values()], axis=1)
    measured = at_run(recording.channels.time, values, run.time.values, alignment)
    measured[run.time.values < begin] = np.nan
    return Pair(recording, run, alignment, measured, predicted)


def _alignment(recording: TestRecording, run: Record, predicted: FloatArray) -> Alignment:
    time, speed = recording.channels.time, recording.speed
    if speed is None:
        values = np.stack([*recording.channels.values.values()], axis=1)
        return align_signals(time, values, predicted, run)
    if recording.pulses is not None and recording.about is not None:
        return align_pulses(recording.pulses, pulse_angle(recording.about), run)
    return align_speed(time, speed, run)


def measured_profile(
    recording: TestRecording, speed: FloatArray
) -> tuple[SpinProfile, Alignment, float]:
    """Return the recorded drum speed as a profile, and the alignment of a run that follows it.

    A drum does not start at the first recorded speed, so the profile leads there from rest.

    Args:
        speed: At the samples of the recording, NaN where there is none. (n,) [rad/s]

    Returns:
        Profile, alignment, and the time of the profile at which the recorded speed begins. [s]

    Raises:
        InputError: it is known for less than ten points.
    """
    from scipy.signal import savgol_filter  # slow to import: measured speeds

    time = recording.channels.time
    known = np.flatnonzero(np.isfinite(speed))
    begin, end = (float(time[known[0]]), float(time[known[-1]])) if len(known) else (0.0, 0.0)
    edges = np.arange(begin, end, SPEED_STEP)
    if len(edges) < 10:
        raise input_error("has a drum speed for less than 2.5 s", where=str(recording.path))
    window = np.minimum(((time[known] - begin) / SPEED_STEP).astype(int), len(edges) - 1)
    counts = np.bincount(window, minlength=len(edges))
    means = np.bincount(window, np.abs(speed[known]), len(edges)) / np.maximum(counts, 1)
    middles = edges + 0.5 * SPEED_STEP
    filled = np.interp(middles, middles[counts > 0], means[counts > 0])
    smooth = np.maximum(savgol_filter(filled, 9, 2), 0.0)
    lead = _lead(smooth)
    *times, begin = np.cumsum([0.0, *(duration for duration, _ in lead)]).tolist()
    profile = SpinProfile(
        time=(*times, *(middles - middles[0] + begin).tolist()),
        speed=(*(start for _, start in lead), *smooth.tolist()),
    )
    return profile, Alignment(begin - float(middles[0])), begin


def _lead(speed: FloatArray) -> list[tuple[float, float]]:
    """Return duration [s] and speed at the start [rad/s] of each part before a recorded speed.

    Args:
        speed: Recorded speed every `SPEED_STEP`. [rad/s]
    """
    first, slope = float(speed[0]), float(speed[8] - speed[0]) / (8 * SPEED_STEP)
    if first <= LEAD_LONGEST * slope:
        return [(first / slope, 0.0)] if first > 0.0 else []
    return [(min(first / LEAD_ACCELERATION, LEAD_LONGEST), 0.0), (LEAD_HELD, first)]


def speed_of_order_one(pair: Pair) -> FloatArray:
    """Return the drum speed that order 1 of all sensors tells, at the samples of the recording.

    It is the speed of the run, corrected by how the phases between measured and predicted signals
    turn. NaN where no sensor shows order 1. (n,) [rad/s]
    """
    measured, predicted = vectors_of_order_one(pair.measured, pair.predicted, pair.run)
    products = np.nan_to_num(measured.values * np.conj(predicted.values))
    scale = np.max(np.abs(products), axis=0)
    products = products / np.where(scale > 0.0, scale, 1.0)
    turned = np.sum(products[1:] * np.conj(products[:-1]), axis=1)
    turned = np.where(measured.speed.values[1:] < 0.0, np.conj(turned), turned)
    time = measured.time.values
    known = np.abs(turned) > 0.0
    middles = 0.5 * (time[1:] + time[:-1])[known]
    at = pair.alignment.of_run(pair.recording.channels.time)
    if len(middles) < 2:
        return np.full(len(at), np.nan)
    slip = np.interp(at, middles, np.angle(turned[known]) / np.diff(time)[known])
    run = pair.run
    speed = np.interp(at, run.time.values, np.abs(run.drum_speed.values), np.nan, np.nan)
    inside = (at >= middles[0]) & (at <= middles[-1])
    return np.where(inside, speed * (1.0 + pair.alignment.rate) + slip, np.nan)


def order_one(pair: Pair) -> xr.Dataset:
    """Return order 1 of measured and predicted signals of a recording.

    Returns:
        Over time and sensor: complex `measured` and `predicted`, whose phases count from the drum
        angle of the run; over sensor, the `correlation` of both after the turn by the angle `start`
        [rad], by which the drum stood otherwise at the start; `speed` [rad/s] over time.
    """
    measured, predicted = vectors_of_order_one(pair.measured, pair.predicted, pair.run)
    m, c = measured.values, predicted.values
    sizes = np.sqrt(np.nansum(np.abs(m) ** 2, axis=0) * np.nansum(np.abs(c) ** 2, axis=0))
    alike = np.nansum(m * np.conj(c), axis=0) / np.where(sizes > 0.0, sizes, np.inf)
    start = 0.5 * float(np.angle(np.sum(alike**2)))  # a wrong sign of a sensor does not matter
    turned = np.real(alike * np.exp(-1j * start))
    if np.sum(np.sign(turned) * turned**2) < 0.0:
        start, turned = start + np.pi, -turned
    sensors = list(pair.recording.channels.values)
    return xr.Dataset(
        {
            "measured": (("time", "sensor"), m),
            "predicted": (("time", "sensor"), c),
            "correlation": CORRELATION.variable("sensor", turned),
            "start": PHASE.variable((), start),
            "speed": SPEED.variable("time", np.abs(measured.speed.values)),
        },
        {"time": TIME.variable("time", measured.time.values), "sensor": sensors},
    )
