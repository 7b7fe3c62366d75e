"""Place the clock of a recording on the time of a run: offset and clock rate, with uncertainty.

Three sources, the first that there is:

    speed    the recorded drum speed follows the speed of the run
    pulses   the counted angle follows the angle of the run
    signals  spectra over time, then the phases of order 1, follow those of the predicted signals

The phase of order 1 of sensor s differs by w(t) (do + (t - t_m) dr) + c_s, with the drum speed w;
the constants c_s are the unknown angle of the drum at the start and the polarity of the sensor.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.optimize import least_squares

from wm_drake.parameters.recorded import resampled
from wm_drake.parameters.recorded.pulses import Pulses
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.orders import PERIOD, frequency_map, order_vectors
from wm_drake.simulation.records import Record, sample_period

RATE_SD = 1e-3
"""Standard deviation of a clock rate before the fit. An assumption: crystals are far better."""

OFFSET_SD = 0.25
"""Standard deviation of an offset from spectra, which have a line every `PERIOD`. [s]"""

LEAST_COMMON = 0.5
"""Smallest part of the shorter of recording and run that both have in common."""

LEAST_PART = 0.05
"""Smallest amplitude of order 1, by the largest one, whose phase counts."""

LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 0.3, 30.06
"""Frequencies between which spectra over time are compared; no line of them is at an end. [Hz]"""

UNKNOWN_ANGLE = 1e3
"""Standard deviation of an angle of which nothing is known. [rad]"""

SCALE_OF_SPEED, SCALE_OF_PHASE = 0.5, 0.3
"""Residuals above which a difference counts less. [rad/s, rad]"""


@dataclass(frozen=True)
class Alignment:
    """Time of a run from the time of a recording: t = offset + (1 + rate) t_recorded.

    Attributes:
        offset: Time of the run at time 0 of the recording. [s]
        rate: By how much the clock of the recorder is slow.
        offset_sd, rate_sd: Standard deviations. [s, 1] That of the offset is in the middle of the
            recording.
        source: What was aligned: "speed", "pulses" or "signals".
        misfit: RMS of what remains: speed [rad/s], angle of pulses or phase of order 1 [rad].
    """

    offset: float = 0.0
    rate: float = 0.0
    offset_sd: float = 0.0
    rate_sd: float = 0.0
    source: str = "start"
    misfit: float = 0.0

    def of_run(self, recorded: FloatArray) -> FloatArray:
        """Return times of the run from those of the recording. [s]"""
        return np.asarray(self.offset + (1.0 + self.rate) * recorded)

    def of_recording(self, time: FloatArray) -> FloatArray:
        """Return times of the recording from those of the run. [s]"""
        return np.asarray((time - self.offset) / (1.0 + self.rate))


def at_run(time: FloatArray, values: FloatArray, run: FloatArray, at: Alignment) -> FloatArray:
    """Return recorded signals at the times of a run; NaN in gaps and beyond the recording.

    Frequencies that the run does not resolve are filtered out.

    Args:
        time, values: Recording (n,) [s], (n, k).
        run: Times of the run (m,), evenly spaced. [s]

    Returns:
        (m, k)
    """
    places = at.of_recording(run)
    step = float(places[1] - places[0])
    return resampled(time, values, places, step)


def align_speed(time: FloatArray, speed: FloatArray, run: Record) -> Alignment:
    """Align a recorded drum speed with that of a run.

    Args:
        time: Rising times of the recording. (n,) [s]
        speed: Drum speed, NaN where there is none. (n,) [rad/s]
    """
    known = np.isfinite(speed)
    time, speed = _means(time[known], np.abs(speed[known]))
    offset, middle = _offset_of_speed(time, speed, run), float(np.mean(time))

    def residuals(x: FloatArray) -> FloatArray:
        at, inside = _places(offset + x[0] + time + x[1] * (time - middle), run)
        of_run = np.interp(at, run.time.values, np.abs(run.drum_speed.values))
        return np.where(inside, of_run - speed, 0.0)

    fit = _robust(residuals, (0.0, 0.0), (OFFSET_SD, RATE_SD), SCALE_OF_SPEED)
    return fit.alignment(Alignment(offset), middle, "speed")


def align_pulses(pulses: Pulses, angle: float, run: Record) -> Alignment:
    """Align the pulses of a tacho with the angle of the drum in a run.

    Where their count is lost, it starts anew with another constant.

    Args:
        angle: Angle of the drum between two pulses. [rad]
    """
    stamps, of_run, times = run.time.values, np.abs(run.drum_angle.values), pulses.times
    speed, between = angle * np.diff(pulses.counts) / np.diff(times), 0.5 * (times[1:] + times[:-1])
    offset = _offset_of_speed(*_means(between, speed), run)
    middle, turned = float(np.mean(times)), angle * pulses.counts

    def residuals(x: FloatArray) -> FloatArray:
        at, inside = _places(offset + x[0] + times + x[1] * (times - middle), run)
        start = x[2:][pulses.pieces]
        return np.where(inside, np.interp(at, stamps, of_run) - turned - start, 0.0)

    apart = np.interp(offset + times, stamps, of_run) - turned
    starts = [float(np.median(apart[pulses.pieces == k])) for k in np.unique(pulses.pieces)]
    priors = (OFFSET_SD, RATE_SD, *[UNKNOWN_ANGLE] * len(starts))
    fit = _robust(residuals, (0.0, 0.0, *starts), priors, SCALE_OF_PHASE)
    return fit.alignment(Alignment(offset), middle, "pulses")


def align_signals(
    time: FloatArray, values: FloatArray, predicted: FloatArray, run: Record
) -> Alignment:
    """Align recorded signals with those that a run predicts.

    The result holds if the model moves as the machine does; what it does not explain counts in the
    standard deviations.

    Args:
        time, values: Recording (n,) [s], (n, k).
        predicted: Predicted signals at the times of the run. (m, k)
    """
    offset = _offset_of_spectra(time, values, predicted, run)
    result = Alignment(offset)
    for _ in range(2):  # the first one is off by up to a window, over which phases turn
        result = _of_phases(time, values, predicted, run, result)
    return result


def _of_phases(
    time: FloatArray, values: FloatArray, predicted: FloatArray, run: Record, before: Alignment
) -> Alignment:
    """Return an alignment improved by the phases of order 1."""
    measured, computed = vectors_of_order_one(
        at_run(time, values, run.time.values, before), predicted, run
    )
    products = measured.values * np.conj(computed.values)
    sizes = np.sqrt(np.abs(products))
    largest = np.nanmax(sizes, axis=0, initial=0.0)
    counts = sizes > LEAST_PART * largest
    if not counts.any():
        return Alignment(before.offset, before.rate, OFFSET_SD, RATE_SD, "signals", np.pi)
    stamps, speed = measured.time.values, measured.speed.values
    middle = float(before.of_run(np.array(np.mean(time))))
    rows, columns, phases, weights = [], [], [], []
    for k in np.flatnonzero(counts.any(axis=0)):
        at = np.flatnonzero(counts[:, k])
        rows.append(at)
        columns.append(np.full(len(at), k))
        phases.append(np.unwrap(np.angle(products[at, k])))
        weights.append(sizes[at, k] / largest[k])
    row, column, phase, weight = map(np.concatenate, (rows, columns, phases, weights))
    constants = (column[:, None] == np.unique(column)).astype(float)
    slopes = np.column_stack([speed[row], speed[row] * (stamps[row] - middle), constants])

    def residuals(x: FloatArray) -> FloatArray:
        return np.asarray(weight * (phase - slopes @ x))

    start = (0.0, 0.0, *(np.median(phase[one > 0.0]) for one in constants.T))
    priors = (OFFSET_SD, RATE_SD, *[UNKNOWN_ANGLE] * constants.shape[1])
    fit = _robust(residuals, start, priors, SCALE_OF_PHASE)
    return fit.alignment(before, float(np.mean(time)), "signals")


def vectors_of_order_one(
    measured: FloatArray, predicted: FloatArray, run: Record
) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the complex amplitudes of order 1 of signals at the times of a run.

    Returns:
        Measured and predicted (time, signal); a window that touches a gap is NaN in both.
    """
    gaps = np.where(np.isfinite(measured), 0.0, np.nan)
    angle, time = run.drum_angle.values, run.time.values
    both = np.hstack([measured, predicted + gaps])
    vectors = order_vectors(both, angle, time, np.array([1.0])).isel(order=0)
    count = measured.shape[1]
    return vectors.isel(signal=slice(count)), vectors.isel(signal=slice(count, None))


def _places(at: FloatArray, run: Record) -> tuple[FloatArray, np.ndarray]:
    """Return times, and which of them are times of the run.

    Before time 0 the drum rests if the run begins at standstill.
    """
    rests = abs(float(run.drum_speed.values[0])) < 1e-9
    return at, (at <= run.time.values[-1]) & ((at >= 0.0) | rests)


def _means(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the means in windows of `PERIOD`: what is left of noise is independent there."""
    if len(time) < 2:
        return time, values
    window = ((time - time[0]) / PERIOD).astype(int)
    counts = np.bincount(window)
    filled = counts > 0
    return (
        np.bincount(window, time)[filled] / counts[filled],
        np.bincount(window, values)[filled] / counts[filled],
    )


def _offset_of_speed(time: FloatArray, speed: FloatArray, run: Record) -> float:
    """Return the offset at which the mean absolute difference of the speeds is smallest. [s]"""
    stamps, of_run = run.time.values, np.abs(run.drum_speed.values)
    size = np.abs(speed)
    span, duration = float(np.ptp(time)), float(stamps[-1])
    common = LEAST_COMMON * min(span, duration)
    offsets = np.arange(common - span, duration - common + 0.02, 0.02) - time[0]
    best, least = 0.0, np.inf
    for offset in offsets:
        at, inside = _places(float(offset) + time, run)
        if np.sum(inside) * PERIOD < common:
            continue
        error = float(np.mean(np.abs(np.interp(at, stamps, of_run) - size)[inside]))
        if error < least:
            best, least = float(offset), error
    return best


def _offset_of_spectra(
    time: FloatArray, values: FloatArray, predicted: FloatArray, run: Record
) -> float:
    """Return the offset at which spectra over time agree best, by their correlation. [s]"""
    period = sample_period(run)
    even = np.arange(time[0], time[-1], period)
    if len(even) < 2:
        return -float(time[0])
    recorded = resampled(time, values, even, period)
    maps = [
        _log_spectra(signals, stamps)
        for signals, stamps in ((recorded, even), (predicted, run.time.values))
    ]
    (first, measured), (second, computed) = maps
    count, length = len(measured), len(computed)
    if not (count and length):
        return -float(time[0])
    common = max(1, round(LEAST_COMMON * min(count, length)))
    best, highest = 0, -np.inf
    for lag in range(common - count, length - common + 1):
        begin, end = max(0, -lag), min(count, length - lag)
        fit = _correlation(measured[begin:end], computed[begin + lag : end + lag])
        if fit > highest:
            best, highest = lag, fit
    return best * PERIOD + second - first


def _log_spectra(signals: FloatArray, time: FloatArray) -> tuple[float, FloatArray]:
    """Return the time of the first window, and logarithms of spectra (window, lines)."""
    spectra = frequency_map(signals, time).sel(frequency=slice(LOWEST_FREQUENCY, HIGHEST_FREQUENCY))
    values = spectra.values
    floor = 1e-3 * np.nanmax(values, axis=(0, 1), initial=1e-300)
    logs = np.log(np.maximum(values, floor))
    logs -= np.nanmean(logs, axis=(0, 1))
    return float(spectra.time.values[0]) if len(values) else 0.0, logs.reshape(len(logs), -1)


def _correlation(a: FloatArray, b: FloatArray) -> float:
    valid = np.isfinite(a) & np.isfinite(b)
    x, y = a[valid], b[valid]
    size = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    return float(np.sum(x * y)) / size if size > 0.0 else -1.0


@dataclass(frozen=True)
class _ClockFit:
    """Change of offset [s] in the middle and of clock rate, deviations, and RMS of what remains."""

    change: FloatArray
    deviations: FloatArray
    misfit: float

    def alignment(self, before: Alignment, middle: float, source: str) -> Alignment:
        """Return an alignment, changed by this fit.

        Args:
            middle: Middle of the recording. [s]
        """
        rate = before.rate + float(self.change[1])
        offset = before.offset + float(self.change[0] - self.change[1] * middle)
        offset_sd, rate_sd = (float(sd) for sd in self.deviations[:2])
        return Alignment(offset, rate, offset_sd, rate_sd, source, self.misfit)


def _robust(
    residuals: Callable[[FloatArray], FloatArray],
    start: Sequence[float],
    priors: Sequence[float],
    scale: float,
) -> _ClockFit:
    """Return the least squares of residuals of which large ones count less.

    Neighbouring residuals are not independent: their scatter counts (1 + r) / (1 - r) fold, with
    the correlation r of neighbours.

    Args:
        residuals: Function of the unknowns: offset, clock rate, others.
        start: Start of the search.
        priors: Standard deviations of the unknowns about the start before the fit.
        scale: Size of residuals above which they count less, in a first fit.
    """
    first, width = np.array(start, dtype=float), np.array(priors)
    x, size = first, scale
    for _ in range(3):

        def weighted(x: FloatArray, size: float = size) -> FloatArray:
            return np.concatenate([residuals(x) / size, (x - first) / width])

        result = least_squares(weighted, x, loss="soft_l1", x_scale=width)
        x = result.x
        rest = residuals(x)
        sizes = np.abs(rest[rest != 0.0])  # rows beyond the run are zero
        spread = max(1.4826 * float(np.median(sizes)) if len(sizes) else 0.0, 1e-3 * scale)
        inner = np.clip(rest, -5.0 * spread, 5.0 * spread)
        alike = float(np.sum(inner[1:] * inner[:-1]) / max(np.sum(inner**2), 1e-300))
        alike = min(max(alike, 0.0), 0.999)
        size = spread * np.sqrt((1.0 + alike) / (1.0 - alike))
    jacobian = result.jac
    variances = np.diag(np.linalg.inv(jacobian.T @ jacobian))
    return _ClockFit(x, np.sqrt(variances), float(np.sqrt(np.mean(rest**2))))
