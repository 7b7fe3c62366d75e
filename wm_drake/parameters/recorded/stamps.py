"""Time stamps that a recorder rounded, or whose clock was set while it ran."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.csv_files import with_distinct_times
from wm_drake.parameters.recorded.health import Channel, Finding
from wm_drake.parameters.recorded.pulses import rises
from wm_drake.parameters.types import FloatArray

HOLE = 10.0
"""Steps of time, in medians, above which samples are missing: nothing is interpolated there."""

MOST_SHARED = 0.05
"""Largest part of samples that share their time stamp and are averaged."""

MISSED_TICKS = 2.5
"""Ticks between two stamps above which samples are missing."""

NEAR_GAP = 40
"""Samples on each side of a gap that tell how the signals go on."""

SMOOTH, ROUGH = 4.0, 10.0
"""Square of second differences over a gap, by those beside it, up to which signals go on as if no
time had passed; and least median where other samples are put together."""

NEAR_SPEED = 1.5
"""Time on each side of a gap in which the change of the drum speed is taken: a motor makes it vary
within a turn. [s]"""

CYCLES, LEAST_CYCLES, NEAR_CYCLES = 6, 4, 5.0
"""Cycles on each side of a gap that tell whether time passed in it, the least number of them, and
how far from the gap they are searched. [s]"""

FITS, BETTER = 0.05, 0.7
"""Largest RMS of the phases of such cycles by their fit, in cycles; and largest ratio of that
without time in the gap to that with it."""

SAME, OTHER = 0.3, 6.0
"""Part of the change that a drum speed would have had in a gap, up to which no time passed; and
least ratio of that change to the noise of the speed, to tell."""


def with_ticks_spread(path: Path, table: FloatArray) -> tuple[FloatArray, str]:
    """Return samples whose time stamps, if they are ticks of a slow clock, are even again.

    The samples of an even recorder lie on a line over their numbers, within a tick. Where stamps
    are equal for another reason, samples are averaged if they are few.

    Args:
        table: (n, k) with the time in the first column, not falling. [s]

    Returns:
        (m, k), m <= n; what was done, "" if nothing.

    Raises:
        InputError: many stamps are equal, and not as those of an even recorder.
    """
    time = table[:, 0]
    steps = np.diff(time)
    shared = np.mean(np.append(steps == 0.0, False))
    if not shared or not (steps > 0.0).any():
        return table, ""
    tick = float(np.median(steps[steps > 0.0]))
    pieces = np.split(np.arange(len(time)), np.flatnonzero(steps > MISSED_TICKS * tick) + 1)
    longest = max(pieces, key=len)
    begins = longest[1:][np.diff(time[longest]) > 0.0]  # the first tick may be a part of one
    slope = np.polyfit(begins, time[begins], 1)[0] if len(begins) > 2 else 0.0
    even = [_on_line(time[piece], float(slope)) for piece in pieces]
    off = max(float(np.ptp(line - time[p])) for line, p in zip(even, pieces, strict=True))
    if shared > MOST_SHARED and slope > 0.0 and off <= 1.1 * tick + slope:
        text = f"its time stamps are ticks of {tick:.3g} s; its samples are spread evenly, "
        return np.column_stack([np.concatenate(even), table[:, 1:]]), f"{text}{1.0 / slope:.5g} Hz"
    if shared > MOST_SHARED:
        raise input_error(
            f"{100.0 * shared:.0f} % of the samples share their time stamp with the one before, "
            f"and are not even in ticks of {tick:.3g} s (off by {off:.3g} s); samples are missing, "
            "or the time is not that of the samples: record the time with more digits",
            where=str(path),
        )
    return with_distinct_times(table, str(path)), ""


def _on_line(time: FloatArray, slope: float) -> FloatArray:
    """Return even times with a step that lie in the middle of rounded ones."""
    line = slope * np.arange(len(time))
    apart = time - line
    return np.asarray(line + 0.5 * (apart.max() + apart.min()))


def clock_jumps(channels: Sequence[Channel]) -> Iterator[Finding]:
    """Yield the gaps in time over which the channels go on as if no time had passed.

    The drum speed tells it by how much it changes; without one, or at a constant speed, the signals
    do by their second differences, which are large where they are put together at random.

    Args:
        channels: Of one clock.
    """
    time = channels[0].time
    steps = np.diff(time)
    usual = float(np.median(steps))
    for at in np.flatnonzero(steps > HOLE * usual):
        speeds = [_passed(c, int(at), usual) for c in channels if c.kind == "speed"]
        known = [passed for passed in speeds if passed is not None]
        signals = [c.values for c in channels if c.kind == "vibration"]
        if known:
            goes_on = known[0] < SAME
        else:
            goes_on = bool(signals) and _goes_on(np.stack(signals, axis=1), int(at))
            goes_on = goes_on and _cycles_go_on(time, signals, int(at), usual)
        if goes_on:
            gap, begin = float(steps[at]), float(time[at])
            text = (
                f"its time jumps by {gap - usual:.4g} s, and the signals go on as if no time had "
                "passed: the clock of the recorder was set; take the jump off the later stamps, or "
                "cut the record there"
            )
            yield Finding("jumps of the clock", "time", ((begin, begin + gap),), 0, text, False)


def _passed(speed: Channel, at: int, usual: float) -> float | None:
    """Return the change of a drum speed over a gap, by that of a steady change; None if unknown."""
    near = max(NEAR_GAP, int(NEAR_SPEED / usual))
    begin, end = max(0, at + 1 - near), min(len(speed.values), at + 1 + near)
    parts = speed.values[begin : at + 1], speed.values[at + 1 : end]
    if min(map(len, parts)) < NEAR_GAP // 2 or not all(np.isfinite(part).all() for part in parts):
        return None
    stamps = [usual * np.arange(len(part)) for part in parts]
    fits = [np.polyfit(t, part, 1) for t, part in zip(stamps, parts, strict=True)]
    lines = [np.polyval(fit, t) for fit, t in zip(fits, stamps, strict=True)]
    noise = max(float(np.std(part - line)) for part, line in zip(parts, lines, strict=True))
    gap = float(speed.time[at + 1] - speed.time[at])
    before, after = (float(slope) * gap for slope, _ in fits)
    steady = min(before, after, key=abs)
    if before * after <= 0.0 or abs(steady) < OTHER * noise:
        return None
    return float((lines[1][0] - lines[0][-1]) / steady)


def _goes_on(signals: FloatArray, at: int) -> bool:
    """Return whether signals (n, k) go on after a sample as if the next one were its neighbour."""
    before, after = signals[max(0, at + 1 - NEAR_GAP) : at + 1], signals[at + 1 : at + 1 + NEAR_GAP]
    if min(len(before), len(after)) < NEAR_GAP // 2 or not np.isfinite([*before, *after]).all():
        return False
    scale = np.mean(np.vstack([np.diff(before, 2, axis=0), np.diff(after, 2, axis=0)]) ** 2, axis=0)

    def rough(left: FloatArray, right: FloatArray) -> float:
        joined = np.diff(np.vstack([left[-2:], right[:2]]), 2, axis=0)
        return float(np.mean(joined**2 / np.where(scale > 0.0, scale, np.inf)))

    others = [rough(before[: len(before) - k], after) for k in range(2, len(before) - 2)]
    here = rough(before, after)
    rarer = np.mean([other <= here for other in others])
    return here < SMOOTH and float(np.median(others)) > ROUGH and float(rarer) < 0.1


def _cycles_go_on(time: FloatArray, signals: Sequence[FloatArray], at: int, usual: float) -> bool:
    """Return whether the cycles of signals fit better if no time passed in a gap, or do not tell.

    The phase of a signal is a quadratic function of time: it counts the cycles before the gap, a
    whole number of them in it, and those after it.
    """
    begin, end = np.searchsorted(time, [time[at] - NEAR_CYCLES, time[at + 1] + NEAR_CYCLES])
    misfits = []
    for values in signals:
        before = rises(time[begin : at + 1], values[begin : at + 1])[-CYCLES:]
        after = rises(time[at + 1 : end], values[at + 1 : end])[:CYCLES]
        if min(len(before), len(after)) >= LEAST_CYCLES:
            later = after - (time[at + 1] - time[at] - usual)
            misfits.append([_misfit_of_cycles(before, each) for each in (later, after)])
    if not misfits:
        return True
    without, with_time = np.median(misfits, axis=0)
    return bool(without < BETTER * with_time or with_time > FITS)


def _misfit_of_cycles(before: FloatArray, after: FloatArray) -> float:
    """Return the RMS of the phases of cycles by a quadratic function, with the best number between.

    Args:
        before, after: Times of equal phase. [s]
    """
    times = np.append(before, after)
    powers = np.vander((times - times.mean()) / np.ptp(times), 3)
    counts = np.append(np.arange(len(before)), len(before) + np.arange(len(after)))
    between = np.append(np.zeros(len(before)), np.ones(len(after)))
    rests = [y - powers @ np.linalg.lstsq(powers, y, rcond=None)[0] for y in (counts, between)]
    most = 2.0 * (after[0] - before[-1]) / min(np.diff(before)[-1], np.diff(after)[0])
    numbers = np.arange(np.ceil(most) + 1.0)
    return float(
        np.sqrt(np.mean((rests[0][:, None] + np.outer(rests[1], numbers)) ** 2, axis=0)).min()
    )
