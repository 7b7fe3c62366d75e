"""Displacements of a record: filtered to a band, envelopes, amplitudes, orbits."""

import functools
import json
from collections.abc import Callable

import numpy as np
import xarray as xr

from wm_drake.compiler.kept import kept
from wm_drake.compiler.lane_memory import aligned
from wm_drake.compiler.lanes import WIDTH
from wm_drake.model.scene import REPLAY_RATE
from wm_drake.parameters.types import BoolArray, FloatArray
from wm_drake.simulation.band import (
    FILTER_ORDER,
    LEAST_UPPER_EDGE,
    LOWER_EDGE,
    PADDING_PERIODS,
    pass_band,
)
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.records import Record, profile_of, sample_period
from wm_drake.simulation.signals import filter_both_ways, largest_peaks

LEAST_PADDING = 6 * FILTER_ORDER + 3
"""Samples that the filter needs at both ends: the padding that sosfiltfilt chooses by default."""
REPLAY_SPAN = 8.0
"""Length of a replay. [s]"""
ORBIT_REVOLUTIONS = 6.0
"""Number of drum revolutions that an orbit shows, with the largest amplitude in the middle."""

SAME_PLANE = 0.5e-3
"""Distance below which the planes of two sensors have one orbit. [m]"""

LONGEST_ORBIT = 8.0
"""Longest time that an orbit shows; it matters for a drum that hardly turns. [s]"""


def band_of(record: Record) -> tuple[float, float]:
    """Return the pass band of a record; for 400 rpm if it has no spin profile. [Hz]"""
    if "profile" not in record.attrs:
        return LOWER_EDGE, LEAST_UPPER_EDGE
    return pass_band(profile_of(record), sample_period(record))


def filtered(displacement: FloatArray, period: float, band: tuple[float, float]) -> FloatArray:
    """Return displacements filtered to a band, without phase shift.

    The filter is a Butterworth filter of fourth order.

    Args:
        displacement: (n, k) one column per signal. [m]
        period: Time between samples. [s]
        band: Pass band. [Hz]

    Returns:
        (n, k) filtered displacements. [m] NaN if there are fewer samples than the filter needs, for
        example because the run diverged at once.
    """
    rows, columns = displacement.shape
    groups = -(-columns // WIDTH)
    lanes = aligned(groups * rows * WIDTH).reshape(groups, rows, WIDTH)
    for group, first in enumerate(range(0, columns, WIDTH)):
        part = displacement[:, first : first + WIDTH]
        lanes[group, :, : part.shape[1]] = part
    answer = filtered_lanes(lanes, period, band)
    return np.hstack([*answer])[:, :columns].copy() if groups else displacement.copy()


def filtered_lanes(
    signals: FloatArray,
    period: float,
    band: tuple[float, float],
    array: Callable[[str, int], FloatArray] = lambda name, size: aligned(size * WIDTH),
) -> FloatArray:
    """Return groups of `WIDTH` signals, as from `filtered`.

    Args:
        signals: (groups, n, WIDTH), contiguous. [m]
        period: Time between samples. [s]
        band: Pass band. [Hz]
        array: Function that returns an array of lanes, given a name and a size. A caller that
            filters often can use the same memory again.
    """
    groups, rows, _ = signals.shape
    padding = min(round(PADDING_PERIODS / band[0] / period), rows - 1)
    if padding <= LEAST_PADDING:
        return np.full(signals.shape, np.nan)
    answer, work = array("filtered", rows * groups), array("filter", rows + 2 * padding)
    sections = band_pass(period, band)
    filter_both_ways(signals.ravel(), (rows, groups), *sections, padding, work, answer)
    return answer.reshape(signals.shape)


@functools.cache
def band_pass(period: float, band: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return the sections of the filter, and their states at a constant signal, flat."""

    def designed() -> bytes:
        from scipy.signal import butter, sosfilt_zi  # half a second to import

        sections = butter(FILTER_ORDER, band, btype="bandpass", fs=1.0 / period, output="sos")
        return json.dumps(
            [sections.ravel().tolist(), sosfilt_zi(sections).ravel().tolist()]
        ).encode()

    key = f"band-pass of order {FILTER_ORDER}: {period!r} s, {band!r} Hz"
    sections, states = json.loads(kept(key, designed))
    return np.array(sections), np.array(states)


def filtered_displacement(record: Record) -> xr.DataArray:
    """Return the displacements (time, sensor) of a record, filtered to `band_of` it. [m]

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> wm.filtered_displacement(record).dims
        ('time', 'sensor')
    """
    raw = record.displacement
    return raw.copy(data=filtered(raw.values, sample_period(record), band_of(record)))


def power_means(displacement: FloatArray) -> FloatArray:
    """Return the power mean of order 20, (mean |d|^20)^(1/20), of each signal.

    The power mean is close to the largest absolute value but is a smooth function of all
    parameters. The largest value itself is not: it has a kink where another peak becomes the
    largest one, and searches that use slopes fail there.

    Args:
        displacement: (n, k) one column per signal.

    Returns:
        (k,) in the unit of the signals.
    """
    fourth = np.square(np.square(displacement))
    return np.asarray(np.mean(np.square(np.square(fourth)) * fourth, axis=0) ** (1.0 / 20.0))


def amplitudes(displacement: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the largest absolute value of the envelopes of each signal, and where it occurs.

    An envelope is a straight line from peak to peak, so its largest value is at a peak.

    Args:
        displacement: (n, k) one column per signal.

    Returns:
        The largest value in the unit of the signals and the index of its sample, each (k,). A
        signal that is empty or starts with NaN gives NaN and 0.
    """
    sizes = np.empty(displacement.shape[1])
    samples = np.empty(displacement.shape[1], dtype=np.int64)
    largest_peaks(np.ascontiguousarray(displacement), sizes, samples)
    return sizes, samples


def moment_of_largest_amplitude(record: Record) -> int:
    """Return the sample at which the largest amplitude of all sensors occurs.

    Report, orbit and replay show this moment. In a record that is too short for the filter, it is
    the sample of the largest displacement.
    """
    size, samples = amplitudes(filtered_displacement(record).values)
    if np.isnan(size).all():
        return int(abs(record.displacement).max("sensor").argmax("time"))
    return int(samples[np.nanargmax(size)])


def envelopes(record: Record) -> xr.Dataset:
    """Return the upper and lower envelope (time, sensor) of the filtered displacements. [m]

    An envelope consists of straight lines from peak to peak.

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> envelope = wm.envelopes(record)
        >>> bool((envelope.upper >= envelope.lower).all())
        True
    """
    displacement = filtered_displacement(record)
    time = displacement.time.values
    upper = np.stack([peak_line(time, column) for column in displacement.values.T], axis=1)
    lower = np.stack([-peak_line(time, -column) for column in displacement.values.T], axis=1)
    return xr.Dataset(
        {"upper": displacement.copy(data=upper), "lower": displacement.copy(data=lower)}
    )


def local_maxima(signal: FloatArray) -> np.ndarray:
    """Return the samples of the local maxima of a signal (n,); of a plateau, the middle one.

    They are those of `scipy.signal.find_peaks`.
    """
    steps = np.sign(np.diff(signal))
    changes = np.flatnonzero(steps)
    rises = (steps[changes[:-1]] > 0.0) & (steps[changes[1:]] < 0.0)
    return (changes[:-1][rises] + 1 + changes[1:][rises]) // 2


def peak_line(time: FloatArray, signal: FloatArray) -> FloatArray:
    """Return the line through the local maxima of a signal.

    The line is constant before the first maximum and after the last one. A signal without a local
    maximum is returned unchanged.
    """
    peaks = local_maxima(signal)
    return np.interp(time, time[peaks], signal[peaks]) if len(peaks) else signal


def smooth_envelope(record: Record) -> xr.DataArray:
    """Return the smooth envelope (time, sensor) of the filtered displacements. [m]

    The lower envelope is its negative.
    """
    displacement = filtered_displacement(record)
    sizes = analytic_sizes(displacement.values, sample_period(record), band_of(record))
    return displacement.copy(data=sizes)


def analytic_sizes(signals: FloatArray, period: float, band: tuple[float, float]) -> FloatArray:
    """Return the magnitudes (n, k) of analytic signals d + i H(d), with the Hilbert transform H.

    Unlike a line from peak to peak a magnitude is a smooth function of all parameters: a line jumps
    where a small peak appears, and noise of a slow signal has many. The signals are mirrored at
    both ends, because the transform continues them periodically.

    Args:
        signals: Signals that are filtered to a band. (n, k)
        period: Time between samples. [s]
        band: The band. [Hz]
    """
    from scipy.signal import hilbert  # slow to import: envelopes

    padding = min(round(PADDING_PERIODS / band[0] / period), len(signals) - 1)
    if padding < 1:
        return np.abs(signals)
    mirrored = np.pad(signals, ((padding, padding), (0, 0)), mode="reflect")
    return np.asarray(np.abs(hilbert(mirrored, axis=0))[padding:-padding])


def percent_difference(value: xr.DataArray, reference: xr.DataArray) -> xr.DataArray:
    """Return the difference 100 (value - reference) / reference; [B] Eq. (1). [%]"""
    return 100.0 * (value - reference) / reference


def axis_motion(record: Record, y: float) -> FloatArray:
    """Return the path (n, 3) in W of the point of the drum axis at depth y in T, for orbits. [m]"""
    pose = np.column_stack([record.tub_angle.values, record.tub_position.values])
    return point_positions(pose, np.array([[0.0, y, 0.0]]))[:, 0]


def orbit_window(
    time: FloatArray, drum_angle: FloatArray, index: int, revolutions: float
) -> BoolArray:
    """Return which samples (n,) an orbit shows.

    These are the samples within the given number of drum revolutions around the sample `index`, but
    not beyond the longest time of an orbit.
    """
    turned, passed = np.abs(drum_angle - drum_angle[index]), np.abs(time - time[index])
    return np.asarray((turned <= np.pi * revolutions) & (passed <= 0.5 * LONGEST_ORBIT))


def have_one_orbit(y_front: float, y_rear: float) -> bool:
    """Return whether two positions on the drum axis are so close that one orbit shows both. [m]"""
    return abs(y_rear - y_front) < SAME_PLANE


def replay_samples(time: FloatArray, largest: int) -> slice:
    """Return the samples of a replay around the sample `largest`."""
    ends = time[largest] - REPLAY_SPAN / 2, time[largest] + REPLAY_SPAN / 2
    begin, end = np.searchsorted(time, ends[0]), np.searchsorted(time, ends[1], side="right")
    period = float(time[1] - time[0]) if len(time) > 1 else 1.0 / REPLAY_RATE
    return slice(int(begin), int(end), max(1, round(1.0 / (REPLAY_RATE * period))))


def largest_motion(record: Record) -> tuple[FloatArray, FloatArray]:
    """Return the motion around the largest amplitude of a record, sampled for a replay.

    Returns:
        Times (n,) and positions of the plant (n, >= 7): roll, pitch, yaw, x, y, z of the tub and
        the drum angle; then, for each damper tube that is a body, roll, pitch, yaw, x, y, z of the
        outer tube and the extension of the damper. [s; rad, m]
    """
    samples = replay_samples(record.time.values, moment_of_largest_amplitude(record))
    tubes = [f"tube_{part}" for part in ("angle", "position", "extension") if "tube" in record.dims]
    frames = record[["tub_angle", "tub_position", "drum_angle", *tubes]].isel(time=samples)
    parts = [frames.tub_angle.values, frames.tub_position.values, frames.drum_angle.values]
    for tube in frames.tube.values if "tube" in frames.dims else ():
        one = frames.sel(tube=tube)
        parts += [one.tube_angle.values, one.tube_position.values, one.tube_extension.values]
    return frames.time.values, np.column_stack(parts)
