"""Health of recorded channels: what a sensor, a recorder or a cable did to the samples.

A record is judged before a model is compared with it. `CHECKS` declares each check once: what it
looks at, in which channels, and what becomes of the samples. Those that can be bridged are left
out; a record with others is refused, with place and time. A record without a fault passes all of
them: docs/theory/recordings.md has the rates of false alarms.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray

Kind: TypeAlias = Literal["signal", "vibration", "speed", "pulses"]
"""What a channel records: any signal, one of a sensor that vibrates, a drum speed, or pulses."""

MARKS = (
    *(-999.0, 999.0, -9999.0, 9999.0, -99999.0, 99999.0, -32768.0, 32767.0, 65535.0, 65534.0),
    *(-(2.0**31), 2.0**31 - 1.0, 2.0**32 - 1.0, 1e10, -1e10, 1e30, -1e30, 3.4028234663852886e38),
)
"""Values that recorders write in place of a sample."""

BEYOND = 3.0
"""Smallest ratio of such a mark to the largest other sample."""

SPIKE, SPIKE_OF_ALL, SPIKE_SAMPLES = 6.0, 2.0, 3
"""A spike of at most so many samples is farther from the local median than the neighbours, by the
first ratio, and than 95 % of all samples, by the second one. With Gaussian noise the first ratio
alone needs 7 standard deviations."""

AROUND, FEW = 100, 0.005
"""Samples on each side beyond all of which, by the ratio of a spike, a sample is a spike too; and
largest part of such ones: more are knocks."""

NEAR = 12
"""Samples on each side that are the neighbours of a spike."""

CHANCE = 1e-6
"""Probability that a healthy record has a constant span by chance."""

LONGER = 3.0
"""Smallest ratio of a constant span to the longest other one near it."""

AWAY = 5.0
"""Smallest ratio of the step of a speed at an end of a constant span to usual steps."""

CREST = 4.0
"""Smallest ratio of the step at an end of a span to the smallest steps near it, the resolution: the
crest of a rounded signal is flat too, and leaves it in steps of one or two digits."""

CLIPPED, CLIPPED_PAIRS = 5.0, 3
"""A channel is clipped if its largest value occurs so many times as often as any other in the
nearest third of its range, and in so many pairs of neighbouring samples. A sine that is rounded has
the ratio 2.4."""

LEAST_LINE, BENDS, SIDE = 10, 8.0, 12
"""Smallest number of samples of a straight span. Of so many samples on each side, three quarters
have larger second differences than all inside, by this ratio but for those at a corner."""

STRAIGHT = 5e-3
"""Largest second difference of a straight span, by the median of all; or 1.5 digits."""

NEARLY = 0.005
"""Part of the range within which samples count as the largest value: noise may follow a limit."""

LEAST_CLIPPED = 10
"""Smallest number of samples at a range."""

TOGETHER = 1.0
"""Time between clipped samples that are left out as one span. [s]"""

LEAST = 16
"""Smallest number of samples that are examined."""

BLOCK = 50
"""Smallest number of samples that are the same twice; half of them must have different values."""

APART = 0.25
"""Smallest difference between the samples beside two equal blocks, by the deviation of the block.
Beside the periods of a signal there are further equal ones."""

FASTEST = 10.0 * np.pi
"""Largest acceleration of a drum: 300 rpm in a second. An assumption: usual are 100. [rad/s^2]"""

TENTH = 0.1
"""Largest relative change of a drum speed within a turn."""

LONGEST_BRIDGE = 5.0
"""Longest span without a drum speed that is bridged. [s] An assumption."""

SLOWEST, STARTED = np.pi / 30.0, 2.0 * np.pi
"""Speed below which a drum rests, and the one up to which a tacho may not see it turn: 1 and 60
rpm, that of a turn from rest at 30 rpm in a second. [rad/s]"""

HELD = 4
"""Samples of one value before a jump from which they may be held, and the drum moved meanwhile."""

MOST_SEGMENTS = 300
"""Most pieces between jumps of a speed; one with more is noise."""


@dataclass(frozen=True, eq=False)
class Channel:
    """A recorded channel that is examined.

    Attributes:
        name: Its name in the file.
        kind: What it records.
        time: (n,) [s]
        values: (n,) as the file has them; NaN where a sample is missing.
        factor: Factor to SI.
    """

    name: str
    kind: Kind
    time: FloatArray
    values: FloatArray
    factor: float = 1.0

    @cached_property
    def runs(self) -> tuple[np.ndarray, np.ndarray]:
        """Begin and length of the runs of equal samples, (k,) each; a missing sample ends one."""
        ends = np.flatnonzero(np.diff(self.values) != 0.0) + 1
        begins = np.concatenate([[0], ends])
        return begins, np.diff(np.append(begins, len(self.values)))


@dataclass(frozen=True)
class Finding:
    """What a check found in a channel.

    Attributes:
        check: Name of the check.
        channel: Name of the channel.
        spans: Begin and end of each place, for a reader. [s]
        samples: Number of samples.
        text: What was found.
        is_bridged: Whether the samples can be left out.
    """

    check: str
    channel: str
    spans: tuple[tuple[float, float], ...]
    samples: int
    text: str
    is_bridged: bool = True

    @property
    def where(self) -> str:
        """Return the times of the places, the first ones of many."""
        texts = [f"{a:.4g} s" if b - a < 1e-3 else f"{a:.4g} to {b:.4g} s" for a, b in self.spans]
        more = f" and {len(texts) - 4} more" if len(texts) > 4 else ""
        return ", ".join(texts[:4]) + more

    def __str__(self) -> str:
        """Return what was found where, and what becomes of it."""
        done = f"; {self.samples} samples are left out" if self.samples and self.is_bridged else ""
        return f"{self.text} ({self.where}){done}"


@dataclass(frozen=True)
class Check:
    """A check of a channel.

    Attributes:
        name: Its name, for tables.
        kinds: Channels that it looks at.
        find: Return which samples are faulty (n,).
        words: What is said of them, with `{value}`, that of the first one, and `{count}`.
        longest: Longest span that is left out; a longer one is refused. [s]
    """

    name: str
    kinds: tuple[Kind, ...]
    find: Callable[[Channel], np.ndarray]
    words: str
    longest: float = np.inf


def examined(channel: Channel) -> tuple[FloatArray, list[Finding]]:
    """Return the samples of a channel (n,), NaN where a check leaves them out, and the findings."""
    findings, values = list[Finding](), channel.values
    for check in CHECKS:
        if channel.kind not in check.kinds or np.isfinite(values).sum() < LEAST:
            continue
        seen = Channel(channel.name, channel.kind, channel.time, values, channel.factor)
        mask = check.find(seen) & np.isfinite(values)
        if not mask.any():
            continue
        findings.append(_finding(check, seen, mask))
        values = np.where(mask, np.nan, values)
    return values, findings


def _finding(check: Check, channel: Channel, mask: np.ndarray) -> Finding:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    begins, ends = channel.time[edges[::2]], channel.time[edges[1::2] - 1]
    first, count = float(channel.values[edges[0]]), int(mask.sum())
    spans = tuple(zip(begins.tolist(), ends.tolist(), strict=True))
    text = check.words.format(value=f"{first:.6g}", count=count)
    bridged = bool(np.all(ends - begins <= check.longest))
    return Finding(check.name, channel.name, spans, count, text, bridged)


def _marks(channel: Channel) -> np.ndarray:
    """Return the samples with a value of `MARKS` far beyond all others."""
    is_mark = np.isin(channel.values, MARKS)
    others = np.abs(channel.values[~is_mark & np.isfinite(channel.values)])
    if not is_mark.any() or not len(others):
        return np.zeros(len(is_mark), dtype=bool)
    return is_mark & (np.abs(channel.values) > BEYOND * np.max(others))


def _spikes(channel: Channel) -> np.ndarray:
    """Return short runs of samples that are far from their neighbours and from most others."""
    values = channel.values
    mask = np.zeros(len(values), dtype=bool)
    off = np.abs(values - np.nanmedian(values))
    usual = np.nanpercentile(off, 95.0)
    for at in np.flatnonzero((off > SPIKE_OF_ALL * usual) | ((off > usual) & _lone(off))):
        near = values[max(0, at - NEAR) : at + NEAR + 1]
        near = near[np.isfinite(near)]
        apart = np.abs(near - np.median(near))
        if len(apart) > 2 * SPIKE_SAMPLES + 2:
            usual_near = np.partition(apart, -SPIKE_SAMPLES - 1)[-SPIKE_SAMPLES - 1]
            mask[at] = abs(values[at] - np.median(near)) > SPIKE * usual_near
    return mask


def _lone(off: FloatArray) -> np.ndarray:
    """Return the few samples (n,) that are far beyond all others around them."""
    from scipy.ndimage import maximum_filter1d  # slow to import

    size = np.nan_to_num(off)
    others = np.maximum(
        np.roll(maximum_filter1d(size, AROUND), AROUND // 2 + SPIKE_SAMPLES),
        np.roll(maximum_filter1d(size, AROUND), -AROUND // 2 - SPIKE_SAMPLES),
    )
    lone = size > SPIKE * others
    return lone if lone.sum() <= FEW * len(off) else np.zeros(len(off), dtype=bool)


def _stuck(channel: Channel) -> np.ndarray:
    """Return the samples of spans in which a channel that moves on both sides stays constant.

    With the probability p that neighbouring samples are equal, of the samples near it, a span of L
    samples has the probability p^(L - 1). A crest of a rounded signal is as flat as its neighbours.
    """
    mask = np.zeros(len(channel.values), dtype=bool)
    begins, lengths = channel.runs
    least = max(5.0, 2.0 * float(np.median(np.repeat(lengths, lengths))))
    for number in np.flatnonzero(lengths > least):
        begin, length = int(begins[number]), int(lengths[number])
        is_dead = length == np.isfinite(channel.values).sum() and channel.kind == "vibration"
        if is_dead or _is_stuck(channel, int(number)):
            mask[begin : begin + length] = True
    return mask


def _is_stuck(channel: Channel, number: int) -> bool:
    """Return whether a run of equal samples is too long for what surrounds it."""
    begins, lengths = channel.runs
    values, begin, length = channel.values, int(begins[number]), int(lengths[number])
    end, total = begin + length, len(channel.values)
    reach = max(3 * length, 100)
    low, high = np.searchsorted(begins, [begin - reach, end + reach])
    others = np.delete(lengths[low:high], np.clip(number - low, 0, high - low - 1))
    if not len(others) or length < LONGER * np.max(others):
        return False
    sides = np.diff(values[max(0, begin - 200) : begin]), np.diff(values[end : end + 200])
    for near in (sides[0][-20:], sides[1][:20]):
        if len(near) and np.mean(near == 0.0) > 0.5:
            return False
    around = np.concatenate(sides)
    chance = (np.sum(around == 0.0) + 2.0) / (len(around) + 2.0)
    if len(around) < LEAST or total * chance ** (length - 1) > CHANCE:
        return False
    steps = [abs(values[at] - values[at - 1]) for at in (begin, end) if 0 < at < total]
    moved = np.abs(around[around != 0.0])
    least = CREST * np.nanpercentile(moved, 5.0)
    if channel.kind == "speed":  # steady at last
        least = max(least, AWAY * np.nanmedian(np.abs(around)))
    elif not begin:  # at rest at first
        least = max(least, AWAY * np.nanmax(np.abs(around)))
    elif len(steps) < 2:
        least = max(least, np.nanmedian(np.abs(around)))
    return bool(np.nanmax(steps, initial=0.0) > least)


def _straight(channel: Channel) -> np.ndarray:
    """Return the samples of spans that are a straight line, in a signal that bends on both sides.

    A line that is rounded has second differences of up to a digit.
    """
    values = channel.values
    mask = np.zeros(len(values), dtype=bool)
    bends = np.abs(np.diff(values, 2))  # of sample k + 1
    levels = np.unique(values[np.isfinite(values)])
    digit = np.min(np.diff(levels), initial=np.ptp(levels))
    limit = max(1.5 * digit, STRAIGHT * np.nanmedian(bends), 1e-9 * np.ptp(levels))
    is_line = bends <= limit
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_line, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin < LEAST_LINE or not SIDE < begin <= end < len(bends) - SIDE:
            continue
        sides = np.nan_to_num([bends[begin - 1 - SIDE : begin][::-1], bends[end : end + SIDE + 1]])
        quarter = np.percentile(sides, 25.0, axis=1)
        inside, corners = max(np.max(bends[begin:end]), digit), sides[:, 0]
        rise = abs(values[end] - values[begin + 1])
        is_bent = np.maximum(quarter, corners) > BENDS * inside
        if rise > digit and is_bent.all() and (quarter > limit).all():
            mask[begin + 1 : end + 1] = True
    return mask


def _clipped(channel: Channel) -> np.ndarray:
    """Return spans in which a channel stays at its largest or smallest value."""
    values = channel.values
    at_range = np.zeros(len(values), dtype=bool)
    for side in (1.0, -1.0):
        signed = side * values
        top, low = np.nanmax(signed), np.nanmin(signed)
        for width, reach in ((0.0, 0.35), (NEARLY * (top - low), 0.1)):
            is_top = signed >= top - width
            near = signed[(signed > top - reach * (top - low)) & ~is_top]
            near = np.floor((top - near) / width) if width else near
            most = np.unique(near, return_counts=True)[1].max() if len(near) else 0
            pairs = int(np.sum(is_top[1:] & is_top[:-1]))
            runs = int(np.sum(is_top[1:] & ~is_top[:-1]))
            enough = is_top.sum() >= max(LEAST_CLIPPED, CLIPPED * most)
            if enough and min(pairs, runs) >= CLIPPED_PAIRS:
                at_range |= is_top
    places = np.flatnonzero(at_range)
    if not len(places):
        return at_range
    apart = np.flatnonzero(np.diff(channel.time[places]) > TOGETHER)
    for part in np.split(places, apart + 1):
        at_range[part[0] : part[-1] + 1] = True
    return at_range


def _repeated(channel: Channel) -> np.ndarray:
    """Return samples that are an exact copy of a block before them, and of no other.

    A block must have many different values: signals that rest, or are rounded to few values, repeat
    by themselves. Periodic signals repeat more than once.
    """
    values = channel.values
    mask = np.zeros(len(values), dtype=bool)
    windows = len(values) - BLOCK + 1
    if windows < BLOCK:
        return mask
    key = np.zeros(windows)
    for place, weight in enumerate(np.random.default_rng(0).uniform(1.0, 2.0, BLOCK)):
        key += weight * values[place : place + windows]
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    is_lone = same & ~np.append(same[1:], False) & ~np.append(False, same[:-1])
    first, second = order[:-1][is_lone], order[1:][is_lone]
    for lag in np.unique(second - first):
        equal = np.append(values[lag:] == values[:-lag], False)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], equal]).astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            part = values[begin:end]
            if not BLOCK <= end - begin <= lag or len(np.unique(part)) <= BLOCK // 2:
                continue
            around = np.r_[max(0, begin - 20) : begin, end : min(end + 20, len(values) - lag)]
            apart = np.abs(values[around + lag] - values[around])
            if len(around) and np.nanmedian(apart) > APART * np.std(part):
                mask[begin + lag : end + lag] = True
    return mask


def _jumping(channel: Channel) -> np.ndarray:
    """Return the samples of a drum speed that the drum cannot have reached from the others.

    Between jumps that no drum can do lie segments; kept is the chain of segments, each of which the
    drum can reach from the one before, of the longest duration.
    """
    known = np.flatnonzero(np.isfinite(channel.values))
    time, speed = channel.time[known], np.abs(channel.values[known] * channel.factor)
    changes = np.flatnonzero(np.diff(speed, prepend=np.nan) != 0.0)
    at, value = time[changes], speed[changes]
    if len(value) < 4:
        return np.zeros(len(channel.values), dtype=bool)
    noise = 1.4826 * float(np.median(np.abs(np.diff(value, 2)))) / np.sqrt(6.0)
    digit = float(np.percentile(np.abs(np.diff(value)), 5.0))
    margin = 10.0 * noise + 2.0 * digit + 1e-3 * float(np.max(value))
    waits = np.minimum(np.diff(at), 2.0 * np.percentile(np.diff(at), 95.0))  # values may be held
    is_start = np.minimum(value[:-1], value[1:]) < SLOWEST
    reach = np.where(is_start, STARTED, _reach(waits, value[:-1]))
    jumps = np.flatnonzero(np.abs(np.diff(value)) > reach + margin)
    held = changes[jumps][changes[jumps + 1] - changes[jumps] > HELD]  # a value held before a jump
    inner = np.unique(np.append(changes[jumps + 1], held[held > 0]))
    edges = np.append(0, inner), np.append(inner, len(speed))
    if not len(jumps) or len(edges[0]) > MOST_SEGMENTS:
        return np.zeros(len(channel.values), dtype=bool)
    mask = np.ones(len(channel.values), dtype=bool)
    for begin, end in _chain(time, speed, np.column_stack(edges), margin):
        mask[known[begin:end]] = False
    return mask


def _reach(after: FloatArray, speed: FloatArray) -> FloatArray:
    """Return by how much a drum speed can change within a time. [rad/s]"""
    return np.asarray(after * np.maximum(FASTEST, TENTH * speed**2 / (2.0 * np.pi)))


def _chain(
    time: FloatArray, speed: FloatArray, segments: np.ndarray, margin: float
) -> list[tuple[int, int]]:
    """Return the segments (begin, end) of the longest chain that a drum can follow."""
    totals, before = list[float](), list[int]()
    for number, (begin, end) in enumerate(segments):
        best, chosen = 0.0, -1
        for other, (_, stop) in enumerate(segments[:number]):
            first, last = speed[begin], speed[stop - 1]
            reach = _reach(time[begin] - time[stop - 1], last) + margin
            if totals[other] > best and abs(first - last) <= reach:
                best, chosen = totals[other], other
        totals.append(best + float(end - begin))
        before.append(chosen)
    chain, at = list[tuple[int, int]](), int(np.argmax(totals))
    while at >= 0:
        chain.append((int(segments[at][0]), int(segments[at][1])))
        at = before[at]
    return chain


CHECKS: Sequence[Check] = (
    Check(
        "marks of lost samples",
        ("signal", "vibration", "speed", "pulses"),
        _marks,
        "{count} samples are {value}, a mark that recorders write for a lost sample",
    ),
    Check(
        "spikes",
        ("vibration",),
        _spikes,
        "{count} single samples are impossible beside their neighbours, the first is {value}",
    ),
    Check(
        "constant spans",
        ("vibration", "speed"),
        _stuck,
        "stays at exactly {value} while it moves before and after: a dropout that was filled",
        LONGEST_BRIDGE,
    ),
    Check(
        "straight spans",
        ("vibration",),
        _straight,
        "is a straight line from {value} on while it bends before and after: a dropout that was "
        "interpolated",
        LONGEST_BRIDGE,
    ),
    Check(
        "repeated spans",
        ("vibration",),
        _repeated,
        "repeats samples that were there before, exactly: a buffer that was written twice",
        LONGEST_BRIDGE,
    ),
    Check(
        "clipping",
        ("vibration",),
        _clipped,
        "is clipped: many samples are at exactly {value}, the end of its range",
    ),
    Check(
        "jumps of the speed",
        ("speed",),
        _jumping,
        "the drum speed drops out or jumps as no drum can, to {value}",
        LONGEST_BRIDGE,
    ),
)
"""The checks of single channels, in the order in which they are made."""
