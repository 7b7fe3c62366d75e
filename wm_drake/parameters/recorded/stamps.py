"""Time stamps that a recorder rounded, or whose clock was set while it ran."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.csv_files import with_distinct_times
from wm_drake.parameters.recorded.health import Channel, Finding
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
    begin, end = max(0, at + 1 - NEAR_GAP), min(len(speed.values), at + 1 + NEAR_GAP)
    parts = speed.values[begin : at + 1], speed.values[at + 1 : end]
    if min(map(len, parts)) < NEAR_GAP // 2 or not all(np.isfinite(part).all() for part in parts):
        return None
    fits = [np.polyfit(usual * np.arange(len(part)), part, 1) for part in parts]
    noise = max(float(np.std(np.diff(part, 2))) / np.sqrt(6.0) for part in parts)
    slope = 0.5 * (fits[0][0] + fits[1][0])
    gap = float(speed.time[at + 1] - speed.time[at])
    if abs(slope) * gap < OTHER * noise or slope == 0.0:
        return None
    last = np.polyval(fits[0], usual * len(parts[0]))
    return float((fits[1][1] - last) / (slope * gap))


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
