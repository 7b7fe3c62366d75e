"""Several clocks become one: common span, no value beyond a record, gaps left out, no aliases."""

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wm_drake.errors import InputNotice, Problem, input_error
from wm_drake.parameters.recorded.health import Channel, Finding, Kind, examined
from wm_drake.parameters.recorded.signal import Signal
from wm_drake.parameters.recorded.stamps import HOLE, clock_jumps, with_ticks_spread
from wm_drake.parameters.types import FloatArray

SAME_RATE = 1.05
"""Largest ratio of two sampling rates that count as the same."""

PASSED = 0.8
"""Part of the new Nyquist frequency that the filter against aliasing passes."""

FILTER_ORDER = 8
"""Order of that Butterworth filter; it runs forwards and backwards, so it shifts no phase."""

UNEVEN = 1e-3
"""Largest relative difference of two steps of time of equally spaced samples."""

SCATTER = 2.0
"""Largest ratio of a step of time to the median one that interpolation makes even."""

MOST_FILLED = 10
"""Most samples of an even grid for each recorded one."""


@dataclass(frozen=True, eq=False)
class Synchronous:
    """Channels on one clock, in SI units.

    Attributes:
        path: The file.
        time: Strictly rising (n,). [s] It is zero where the first of the channels begins to count.
        values: Samples of each channel, by its word (n,). NaN where the channel has none, or where
            a check of its health leaves samples out.
        findings: What these checks found.
    """

    path: Path
    time: FloatArray
    values: Mapping[str, FloatArray]
    findings: tuple[Finding, ...] = ()

    @property
    def gaps(self) -> FloatArray:
        """Return begin and end of the spans without a sample of all channels (k, 2). [s]"""
        valid = np.all([np.isfinite(column) for column in self.values.values()], axis=0)
        inside = self.time[valid]
        if len(inside) < 2:
            return np.empty((0, 2))
        order = np.flatnonzero(valid)
        steps = np.diff(inside)
        apart = (np.diff(order) > 1) | (steps > HOLE * np.median(np.diff(self.time)))
        return np.column_stack([inside[:-1][apart], inside[1:][apart]])

    def whole(self) -> "Synchronous":
        """Return the samples that all channels have."""
        valid = np.all([np.isfinite(column) for column in self.values.values()], axis=0)
        return replace(
            self,
            time=self.time[valid],
            values={word: column[valid] for word, column in self.values.items()},
        )


@dataclass(frozen=True, eq=False)
class _Clock:
    """Channels with the same time stamps.

    Attributes:
        words: Their words.
        time: (n,) [s]
        samples: (n, k), one column for each word.
    """

    words: list[str]
    time: FloatArray
    samples: FloatArray

    @property
    def step(self) -> float:
        """Median step of time. [s]"""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else np.inf

    @property
    def name(self) -> str:
        return " and ".join(self.words) if len(self.words) < 3 else f"{self.words[0]} and others"


def notice(path: Path, message: str, key: str = "") -> None:
    """Say that an input is used, but not exactly as it was given."""
    warnings.warn(str(Problem(str(path), key, message)), InputNotice, stacklevel=2)


@dataclass(frozen=True)
class Use:
    """How the samples of a channel are used.

    Attributes:
        factor: Factor that converts them to SI.
        kind: What they record, for the checks of their health.
        is_main: Whether the channel may set the clock; others follow.
    """

    factor: float = 1.0
    kind: Kind = "signal"
    is_main: bool = True


def synchronous(path: Path, signals: Mapping[str, Signal], uses: Mapping[str, Use]) -> Synchronous:
    """Return channels in SI on the slowest clock of the main ones, over the span that all have.

    Args:
        signals: Channels by word.
        uses: How each is used.

    Raises:
        InputError: a channel cannot be used, was not sampled over time, its time falls, or two
            channels have no time in common; or a check finds what cannot be left out.
    """
    findings: list[Finding] = []
    clocks = [_examined(path, clock, uses, findings) for clock in _clocks(path, signals)]
    leading = [clock for clock in clocks if any(uses[word].is_main for word in clock.words)]
    lead = max(leading, key=lambda clock: clock.step)
    begin = max(clock.time[0] for clock in clocks)
    end = min(clock.time[-1] for clock in clocks)
    if len(clocks) > 1:
        _check_span(path, clocks, (begin, end))
    slack = 1e-6 * (lead.step if np.isfinite(lead.step) else 0.0)
    inside = (lead.time >= begin - slack) & (lead.time <= end + slack)
    time = lead.time[inside]
    values: dict[str, FloatArray] = {}
    for clock in clocks:
        if clock is lead:
            columns = lead.samples[inside]
        else:
            _say_rate(path, clock, lead)
            columns = resampled(clock.time, clock.samples, time, lead.step)
        values |= dict(zip(clock.words, columns.T, strict=True))
    result = Synchronous(path, time, {word: values[word] for word in signals}, tuple(findings))
    _say_gaps(result, {finding.channel for finding in findings})
    return result


def _examined(
    path: Path, clock: _Clock, uses: Mapping[str, Use], findings: list[Finding]
) -> _Clock:
    """Return channels in SI without the samples that the checks of their health leave out.

    Raises:
        InputError: a check finds what cannot be left out.
    """
    channels = [
        Channel(word, uses[word].kind, clock.time, column, uses[word].factor)
        for word, column in zip(clock.words, clock.samples.T, strict=True)
    ]
    of_clock = [*clock_jumps(channels)]
    columns = []
    for channel in channels:
        values, of_channel = examined(channel)
        columns.append(values * channel.factor)
        of_clock += of_channel
    for finding in of_clock:
        if not finding.is_bridged:
            raise input_error(str(finding), where=str(path), key=finding.channel)
        notice(path, str(finding), finding.channel)
    findings += of_clock
    return replace(clock, samples=np.column_stack(columns))


def _clocks(path: Path, signals: Mapping[str, Signal]) -> list[_Clock]:
    """Return the channels by their time stamps, which rise, from the first start on."""
    starts = {signal.start for signal in signals.values()}
    known = [start for start in starts if start is not None]
    if known and None in starts:
        lone = [word for word, signal in signals.items() if signal.start is None]
        notice(
            path,
            f"{', '.join(lone)}: has no start time; it is taken to begin with the other channels",
        )
    first = min(known, default=0)
    grouped: list[tuple[int, FloatArray, list[str], Signal]] = []
    for word, signal in signals.items():
        time = signal.time(path)
        signal.usable(path)
        if len(time) != len(signal.values):
            raise input_error(
                f"has {len(signal.values)} samples, its time has {len(time)}",
                where=str(path),
                key=signal.name,
            )
        start = first if signal.start is None else signal.start
        for other, stamps, words, _ in grouped:
            if other == start and np.array_equal(stamps, time, equal_nan=True):
                words.append(word)
                break
        else:
            grouped.append((start, time, [word], signal))
    clocks = []
    for start, time, words, signal in grouped:
        columns = [signals[word].values for word in words]
        kept = np.isfinite(time)
        if not kept.all():
            notice(path, f"{np.sum(~kept)} samples have no time; they are left out")
        check_rising(path, time, kept, signal)
        table = np.column_stack(
            [time[kept] + 1e-9 * (start - first), *(one[kept] for one in columns)]
        )
        table[~np.isfinite(table)] = np.nan
        table, remark = with_ticks_spread(path, table)
        if remark:
            notice(path, remark)
        if len(table) < 2:
            raise input_error(
                f"has {len(table)} samples; at least two are needed",
                where=str(path),
                key=signal.name,
            )
        clocks.append(_Clock(words, table[:, 0], table[:, 1:]))
    return clocks


def check_rising(path: Path, time: FloatArray, kept: np.ndarray, signal: Signal) -> None:
    """Check that the time of a channel does not fall, of the samples that are kept.

    Raises:
        InputError: it does.
    """
    places = np.flatnonzero(kept)
    falls = np.flatnonzero(np.diff(time[kept]) < 0.0)
    if len(falls):
        before, at = places[falls[0]], places[falls[0] + 1]
        axis = signal.abscissa
        assert axis.values is not None
        line = f":{signal.lines[at]}" if signal.lines is not None else ""
        place = "" if line else f" at sample {at + 1}"
        raise input_error(
            f"time falls{place}: {axis.values[at]:g} after {axis.values[before]:g}",
            where=f"{path}{line}",
            key=axis.name or signal.name,
        )


def _check_span(path: Path, clocks: Sequence[_Clock], span: tuple[float, float]) -> None:
    """Check that the clocks have time in common, and say what is left out."""
    begin, end = span
    named = "; ".join(f"{c.name} {c.time[0]:.6g} to {c.time[-1]:.6g} s" for c in clocks[:4])
    if not end > begin:
        raise input_error(f"its channels have no time in common: {named}", where=str(path))
    if any(c.time[0] < begin - 1.5 * c.step or c.time[-1] > end + 1.5 * c.step for c in clocks):
        notice(
            path,
            f"its channels do not cover the same time ({named}); used is what all have: "
            f"{begin:.6g} to {end:.6g} s",
        )


def _say_rate(path: Path, clock: _Clock, lead: _Clock) -> None:
    if lead.step > SAME_RATE * clock.step:
        notice(
            path,
            f"{clock.name}: its rate is reduced from {1.0 / clock.step:.5g} to "
            f"{1.0 / lead.step:.5g} Hz, the rate of {lead.name}; frequencies above "
            f"{0.5 * PASSED / lead.step:.4g} Hz are filtered out",
        )
    elif clock.step > SAME_RATE * lead.step:
        notice(
            path,
            f"{clock.name}: its samples, {1.0 / clock.step:.5g} Hz, are interpolated to the clock "
            f"of {lead.name}, {1.0 / lead.step:.5g} Hz",
        )


def _say_gaps(channels: Synchronous, said: Collection[str]) -> None:
    """Say how many samples of which channel are left out, but of those of which it is said."""
    step = float(np.median(np.diff(channels.time))) if len(channels.time) > 1 else 0.0
    for word, column in channels.values.items():
        missing = ~np.isfinite(column)
        if missing.any() and word not in said:
            spans = int(np.sum(np.diff(np.concatenate([[False], missing]).astype(int)) == 1))
            notice(
                channels.path,
                f"{missing.sum()} of {len(column)} samples are missing or invalid "
                f"({missing.sum() * step:.3g} s in {spans} gap{'s' if spans > 1 else ''}); they "
                "are left out",
                word,
            )


def resampled(time: FloatArray, samples: FloatArray, at: FloatArray, step: float) -> FloatArray:
    """Return channels at other times, without aliases; NaN in a gap and beyond the samples.

    Each piece without a gap is interpolated by a cubic spline. If `step` is larger than the step of
    the samples, a Butterworth filter takes out what it could not resolve.

    Args:
        time: Strictly rising (n,). [s]
        samples: (n, k); NaN where a channel has none.
        at: New times (m,). [s]
        step: Step of the new times. [s]

    Returns:
        (m, k)
    """
    from scipy.interpolate import make_interp_spline  # slow to import

    values = np.full((len(at), samples.shape[1]), np.nan)
    usual = float(np.median(np.diff(time)))
    for column in range(samples.shape[1]):
        valid = np.flatnonzero(np.isfinite(samples[:, column]))
        ends = np.flatnonzero((np.diff(valid) > 1) | (np.diff(time[valid]) > HOLE * usual))
        for piece in np.split(valid, ends + 1):
            if not len(piece):
                continue
            stamps, part = time[piece], samples[piece, column]
            slack = 1e-6 * max(usual, step)
            inside = (at >= stamps[0] - slack) & (at <= stamps[-1] + slack)
            if step > SAME_RATE * usual and len(piece) > 3:
                stamps, part = _filtered(stamps, part, step)
            if len(stamps) == 1:
                values[inside, column] = part[0]
                continue
            spline = make_interp_spline(stamps, part, k=min(3, len(stamps) - 1))
            values[inside, column] = spline(np.clip(at[inside], stamps[0], stamps[-1]))
    return values


def _filtered(time: FloatArray, part: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return a piece, equally spaced, without frequencies that a step cannot resolve."""
    from scipy.interpolate import make_interp_spline  # slow to import
    from scipy.signal import butter, sosfiltfilt  # slow to import

    steps = np.diff(time)
    if np.ptp(steps) > UNEVEN * np.mean(steps):
        even = np.linspace(time[0], time[-1], 1 + round(np.ptp(time) / float(np.median(steps))))
        part = make_interp_spline(time, part, k=3)(even)
        time = even
    passed = PASSED * float(np.mean(np.diff(time))) / step
    sections = butter(FILTER_ORDER, min(passed, 0.99), output="sos")
    length = round(3.0 * FILTER_ORDER / passed)
    return time, sosfiltfilt(sections, part, padlen=min(length, len(part) - 1))


def evenly(channels: Synchronous) -> Synchronous:
    """Return channels on an equally spaced clock; where samples were not recorded, they are NaN.

    Time stamps that scatter, as those of a phone do, are interpolated to an even clock.

    Raises:
        InputError: there are fewer than three samples, or the steps of time differ too much.
    """
    time = channels.time
    if len(time) < 3:
        raise input_error("needs at least three samples in rising time", where=str(channels.path))
    steps = np.diff(time)
    step = float(np.median(steps))
    if np.ptp(steps) <= UNEVEN * np.mean(steps):
        return channels
    counts = np.rint(steps / step)
    if (
        counts.min() >= 1.0
        and np.max(np.abs(steps - counts * step)) <= UNEVEN * step * np.max(counts)
        and counts.sum() <= MOST_FILLED * len(time)
    ):
        return _with_places(channels, counts)
    if steps.min() >= step / SCATTER and steps.max() <= step * SCATTER:
        return _interpolated(channels)
    raise input_error(
        f"the steps of time differ, from {steps.min():.4g} to {steps.max():.4g} s: allowed are "
        f"{1.0 / SCATTER:g} to {SCATTER:g} of their median, {step:.4g} s, or whole multiples of "
        "it; resample it",
        where=str(channels.path),
    )


def _with_places(channels: Synchronous, counts: FloatArray) -> Synchronous:
    """Return channels with places for samples that were not recorded.

    Args:
        counts: Number of even steps in each step of time (n - 1,).
    """
    places = np.concatenate([[0], np.cumsum(counts)]).astype(int)
    grid = np.interp(np.arange(places[-1] + 1), places, channels.time)
    gaps = int(np.sum(counts > 1.0))
    notice(
        channels.path,
        f"{len(grid) - len(places)} samples of {len(grid)} were not recorded ({gaps} "
        f"gap{'s' if gaps > 1 else ''} in time); they are left out",
    )
    values = {word: np.full(len(grid), np.nan) for word in channels.values}
    for word, column in channels.values.items():
        values[word][places] = column
    return replace(channels, time=grid, values=values)


def _interpolated(channels: Synchronous) -> Synchronous:
    """Return channels at even times, by cubic splines."""
    time = channels.time
    even = np.linspace(time[0], time[-1], len(time))
    steps = np.diff(time)
    notice(
        channels.path,
        f"its steps of time scatter from {steps.min():.4g} to {steps.max():.4g} s; the channels "
        f"are interpolated to {1.0 / np.mean(steps):.5g} Hz",
    )
    columns = resampled(time, np.stack(list(channels.values.values()), axis=1), even, 0.0)
    return replace(channels, time=even, values=dict(zip(channels.values, columns.T, strict=True)))
