"""Pulses of a tacho: their times, and how many turns of the shaft lie between them.

A tacho misses pulses, sees some twice, or bounces. A drum changes its speed little from pulse to
pulse, which tells the pulses that are missing and those that are too many.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.recorded.health import Finding
from wm_drake.parameters.types import FloatArray

LEAST_PULSES = 20
"""Smallest number of pulses of a tacho that tell a speed."""

CHANGE = 0.1
"""Relative change of the speed from pulse to pulse that is usual: a tenth within a turn."""

USUAL_ACCELERATION = 0.5
"""Acceleration of a shaft that is always allowed for: 30 rpm in a second. [1/s^2]"""

FAULT, FURTHER = 15.0, 3.0
"""Cost of a pulse that is missing or too many, and of each further one that is missing in a row, in
squares of usual changes. One that is not seen as missing costs 2 (ln 2 / `CHANGE`)^2 = 96."""

MOST_EXTRA, MOST_MISSING = 3, 8
"""Most pulses in a row that are too many, and largest number of steps between two pulses."""

SUSPECT = 0.25
"""Logarithm of the ratio of neighbouring intervals from which pulses are searched for faults."""

UNEVEN = 0.3
"""Part of such ratios from which a wheel has uneven marks; then no pulse is known to be missing."""

LOST = 0.4
"""Logarithm of the ratio of a speed to those beside it from which the count is lost there, if the
interval is twice as long as those beside it."""


@dataclass(frozen=True, eq=False)
class Pulses:
    """Pulses of a shaft.

    Attributes:
        times: Rising times of the pulses (n,). [s]
        counts: Number of each pulse, with those that are missing (n,).
        pieces: Number of the piece of each (n,): between pieces the count is lost.
    """

    times: FloatArray
    counts: np.ndarray
    pieces: np.ndarray

    def speed(self, time: FloatArray) -> FloatArray:
        """Return the pulses in a second at other times; NaN beyond and between pieces. (m,)"""
        middles = 0.5 * (self.times[1:] + self.times[:-1])
        rates = np.diff(self.counts) / np.diff(self.times)
        speed = np.interp(time, middles, rates, left=np.nan, right=np.nan)
        for at in np.flatnonzero(np.diff(self.pieces)):
            speed[(time > self.times[at]) & (time < self.times[at + 1])] = np.nan
        return np.asarray(speed)


def rises(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return the times at which a signal rises through its middle (n,). [s]

    It must have passed both the lower and the upper quarter of its range.
    """
    valid = np.isfinite(values)
    low, high = np.percentile(values[valid], (1.0, 99.0)) if valid.any() else (0.0, 0.0)
    if valid.any() and np.max(values[valid]) - low > 3.0 * (high - low):  # short pulses
        high = float(np.max(values[valid]))
    middle, quarter = 0.5 * (low + high), 0.25 * (high - low)
    states = np.where(values > middle + quarter, 1, np.where(values < middle - quarter, -1, 0))
    known = np.flatnonzero((states != 0) & valid)
    is_rise = (states[known[1:]] > 0) & (states[known[:-1]] < 0)
    after, before = known[1:][is_rise], known[:-1][is_rise]
    part = (middle - values[before]) / (values[after] - values[before])
    return np.asarray(time[before] + part * (time[after] - time[before]))


def counted(
    times: FloatArray, channel: str, resolution: float = 0.0
) -> tuple[Pulses, list[Finding]]:
    """Count pulses, with those that are missing and without those that are too many.

    Of all ways to count them, the result has the least sum of squared changes of the logarithm of
    the speed, each by what is usual, and of `FAULT` for each fault (dynamic programming).

    Args:
        times: Rising times of the pulses, at least `LEAST_PULSES`. [s]
        channel: Name of the channel.
        resolution: Of the times. [s]
    """
    logs = np.abs(np.diff(np.log(np.diff(times))))
    suspect = logs[LEAST_PULSES // 2 :] > SUSPECT
    if np.mean(suspect) > UNEVEN or not (suspect.any() or (logs > np.log(3.0)).any()):
        return Pulses(times, np.arange(len(times)), np.zeros(len(times), dtype=int)), []
    kept, steps = _best_count(times, resolution)
    is_kept = np.isin(np.arange(len(times)), kept)
    speeds = np.log(steps / np.diff(times[kept]))
    around = np.pad(speeds, 3, mode="edge")
    usual = np.median([around[k : k + len(speeds)] for k in (0, 1, 2, 4, 5, 6)], axis=0)
    allowed = LOST + USUAL_ACCELERATION * np.diff(times[kept]) / np.exp(usual)
    is_long = np.diff(times[kept]) > 2.0 * np.exp(-usual)
    is_lost = is_long & (np.abs(speeds - usual) > allowed)
    is_lost |= np.diff(times[kept]) * np.exp(usual) > MOST_MISSING + 1.0
    pulses = Pulses(
        times[kept],
        np.concatenate([[0], np.cumsum(np.where(is_lost, 1, steps))]),
        np.concatenate([[0], np.cumsum(is_lost)]),
    )
    between = pulses.times[:-1]
    missing = [(float(between[k]), float(pulses.times[k + 1])) for k in np.flatnonzero(steps > 1)]
    extra = [(float(t), float(t)) for t in times[~is_kept]]
    lost = [(float(between[k]), float(pulses.times[k + 1])) for k in np.flatnonzero(is_lost)]
    words = (
        (missing, int(np.sum(steps[~is_lost] - 1)), "{} pulses are missing; they are counted"),
        (extra, len(extra), "{} pulses are too many, double or bouncing; they are not counted"),
        (lost, len(lost), "the count of the pulses is lost in {} places, and starts anew"),
    )
    return pulses, [
        Finding("irregular pulses", channel, tuple(spans), 0, text.format(count))
        for spans, count, text in words
        if count
    ]


def _best_count(times: FloatArray, resolution: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the pulses that count (k,), and the steps between them (k - 1,)."""
    steps = np.arange(1.0, MOST_MISSING + 1.0)
    shape = MOST_EXTRA + 1, MOST_MISSING
    costs = np.full((len(times), *shape), np.inf)
    speeds = np.zeros((len(times), *shape))
    origin = np.zeros((len(times), *shape, 2), dtype=int)
    drift = _acceleration(times)
    for at in range(1, len(times)):
        for back in range(1, min(at, MOST_EXTRA + 1) + 1):
            wait, before = times[at] - times[at - back], at - back
            speed = steps / wait
            faults = FAULT * ((steps > 1.0) + back - 1.0) + FURTHER * np.maximum(steps - 2.0, 0.0)
            speeds[at, back - 1] = np.log(speed)
            begin = faults + FAULT * before  # the pulses before are left out
            if before == 0:
                costs[at, back - 1] = faults
                continue
            width = np.hypot(CHANGE + 2.0 * resolution / wait, drift * wait / speed)
            change = (speeds[at, back - 1] - speeds[before].reshape(-1, 1)) / width
            total = costs[before].reshape(-1, 1) + change**2
            best = np.argmin(total, axis=0)
            reached = total[best, np.arange(len(steps))] + faults
            is_begin = begin < reached
            costs[at, back - 1] = np.where(is_begin, begin, reached)
            origin[at, back - 1] = np.column_stack(np.unravel_index(best, shape))
            origin[at, back - 1][is_begin] = -1
    at = len(times) - 1
    back, step = divmod(int(np.argmin(costs[at])), MOST_MISSING)
    kept, counts = [at], list[int]()
    while at > 0 and back >= 0:
        source = origin[at, back, step]
        at -= back + 1
        kept.append(at)
        counts.append(step + 1)
        back, step = int(source[0]), int(source[1])
    return np.array(kept[::-1]), np.array(counts[::-1])


def _acceleration(times: FloatArray) -> float:
    """Return the acceleration of a shaft that is usual in a record, twice the median. [1/s^2]"""
    rates = 1.0 / np.diff(times)
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(rates, 8), axis=1)
    usual = float(np.median(np.abs(np.diff(smooth)) / np.diff(times)[4:-4]))
    return max(2.0 * usual, USUAL_ACCELERATION)
