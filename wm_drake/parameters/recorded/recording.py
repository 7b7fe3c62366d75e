"""A recorded file: its channels, chosen by name, group or node, with units, on one clock."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from wm_drake.errors import InputError, input_error, nearest_names, shortened
from wm_drake.parameters.recorded.clock import (
    Synchronous,
    Use,
    check_rising,
    notice,
    synchronous,
)
from wm_drake.parameters.recorded.formats import read_signals
from wm_drake.parameters.recorded.health import Channel, Kind, examined
from wm_drake.parameters.recorded.pulses import LEAST_PULSES, counted, rises
from wm_drake.parameters.recorded.signal import SECOND, Abscissa, Signal, word_of
from wm_drake.parameters.recorded.stamps import clock_jumps, with_ticks_spread
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, factor_of, plain_unit

ACCELERATION, SPEED = Unit("m/s^2", "m/s^2"), Unit("rad/s", "rpm")

TIME_NAMES = (
    *("time", "t", "timestamp", "time stamp", "elapsed time", "datetime", "date time"),
    *("date/time", "zeit", "uhrzeit", "zeitstempel"),
)
"""Names of a channel of time, in small letters, for files without a time of their own."""

FEW_LEVELS = 8
"""Most values of a channel of pulses, where none says what a channel records."""

MOST_LISTED = 12
"""Most channels that a message lists."""

DAYS = (25569.0, 73050.0)
"""Dates of spreadsheets from 1970 to 2100, as they count days."""

LEAST_STEP = 2e-5
"""Step of time below which such a number is taken for a date: 50 kHz, or 1.7 s of a day. [s]"""

MOST_SECONDS = 1e11
"""Time above which seconds are not plausible: counts since 1970 in a smaller unit. [s]"""


LIKELY, LONGEST = 5.0, 50.0
"""Largest ratio of the durations of a record and its profile, without and with a unit of time."""

TIME_FACTORS = {"ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""Units of a time that is not in seconds. [s]"""


@dataclass(frozen=True)
class ChannelNames:
    """What the user calls the channels of a file.

    Attributes:
        channels: Name in the file of a word of this package, such as ``time`` or ``S1_x``.
        units: Unit of a channel whose file has none, by its word or its name.
        words: Words that may have a unit though a file has no such channel.
    """

    channels: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChannelUse:
    """A channel that a command uses.

    Attributes:
        signal: The channel.
        unit: Unit to which it is converted; None to leave it in its own.
        default: Unit of a channel without one; "" if there is none.
        is_main: Whether it may set the clock; others, such as a drum speed, follow.
        kind: What it records, for the checks of its health.
    """

    signal: Signal
    unit: Unit | None
    default: str = ""
    is_main: bool = True
    kind: Kind = "signal"


@dataclass(frozen=True, eq=False)
class Recording:
    """The channels of a file.

    Attributes:
        path: The file.
        signals: All channels, each with the time that belongs to it.
        names: What the user calls them.
    """

    path: Path
    signals: tuple[Signal, ...]
    names: ChannelNames = ChannelNames()

    @property
    def addresses(self) -> dict[str, Signal]:
        """Return the channels by their shortest name that no other channel has."""
        shared: dict[str, int] = {}
        for signal in self.signals:
            for name in set(signal.names):
                shared[name] = shared.get(name, 0) + 1
        addresses: dict[str, Signal] = {}
        for signal in self.signals:
            single = [name for name in signal.names if shared[name] == 1]
            addresses[single[0] if single else self._numbered(signal)] = signal
        return addresses

    def _numbered(self, signal: Signal) -> str:
        """Return the longest name of a channel with its number among those of this name."""
        name = _longest(signal)
        same = [other for other in self.signals if _longest(other) == name]
        return f"{name}#{1 + next(k for k, other in enumerate(same) if other is signal)}"

    def chosen(self, name: str) -> Signal:
        """Return the channel of a name: alone, with its group, its node or its unit.

        Raises:
            InputError: There is none, or more than one.
        """
        addresses = self.addresses
        if name in addresses:
            return addresses[name]
        fitting = {a: signal for a, signal in addresses.items() if name in signal.names}
        if len(fitting) == 1:
            return next(iter(fitting.values()))
        if fitting:
            raise input_error(
                f"has {len(fitting)} channels '{name}'; one is needed: choose among "
                f"{listed(fitting)}",
                where=str(self.path),
            )
        raise input_error(
            f"has no channel '{name}'; its channels are {self.listed()}", where=str(self.path)
        )

    def listed(self) -> str:
        """Return the names of the channels, for a message."""
        return listed(self.addresses)

    def word(self, word: str) -> Signal | None:
        """Return the channel that the user calls by a word; None if the user names none."""
        name = self.names.channels.get(word)
        return None if name is None else self.chosen(name)

    def worded(self, words: Iterable[str]) -> dict[str, Signal]:
        """Return the channels by address whose name is a word, with the unit that may follow it.

        Such a name is ``speed``, ``Speed [rpm]`` or ``speed_rpm``.
        """
        fitting = {}
        for address, signal in self.addresses.items():
            word, suffix = word_of(signal.name)
            if word in words:
                fitting[address] = replace(signal, unit=signal.unit or suffix)
        return fitting

    def others(self) -> dict[str, Signal]:
        """Return the channels by address without those of time and those that the user names."""
        used = [self.chosen(name) for name in self.names.channels.values()]
        return {
            address: signal
            for address, signal in self.addresses.items()
            if not is_time(signal) and not any(signal is other for other in used)
        }

    def described(self) -> list[dict[str, Any]]:
        """Return a row about each channel: name, labels, rate and span; None for what it lacks."""
        rows = []
        for address, signal in self.addresses.items():
            row: dict[str, Any] = {
                "name": address,
                "group": signal.group,
                "unit": self.unit_of(address, signal),
                "samples": len(signal.values),
                "missing": int(np.sum(~np.isfinite(signal.values))),
                **dict.fromkeys(("rate_hz", "begin_s", "end_s")),
                "abscissa": signal.abscissa.words if signal.abscissa.values is not None else "",
                "start": None if signal.start is None else str(np.datetime64(signal.start, "ns")),
                "remark": signal.fault,
            }
            try:
                time = signal.time(self.path)
                row |= _rate_and_span(time)
                row["remark"] = signal.fault or self._findings(address, signal, time)
            except InputError as error:
                row["remark"] = "time" if is_time(signal) else error.problems[0].message
            rows.append(row)
        return rows

    def _findings(self, address: str, signal: Signal, time: FloatArray) -> str:
        """Return what the checks of its health find in a channel, with the kind that it looks."""
        if is_time(signal) or len(time) != len(signal.values) or not np.isfinite(time).all():
            return ""
        check_rising(self.path, time, np.isfinite(time), signal)
        table, remark = with_ticks_spread(self.path, np.column_stack([time, signal.values]))
        time, values = table.T
        kind: Kind = "vibration"
        unit, factor = self.unit_of(address, signal), 1.0
        if not unit and word_of(signal.name)[0] in ("speed", "rpm"):
            unit = SPEED.shown
        if is_speed(unit):
            kind, factor = "speed", factor_of(unit, SPEED)
        elif len(np.unique(values)) <= FEW_LEVELS:
            kind = "pulses"
        channel = Channel(address, kind, time, values, factor)
        findings = [*clock_jumps([channel]), *examined(channel)[1]]
        pulses = rises(time, values) if kind == "pulses" else time[:0]
        if len(pulses) >= LEAST_PULSES:
            findings += counted(pulses, address, float(np.median(np.diff(time))))[1]
        return "; ".join(filter(None, [remark, *map(str, findings)]))

    def synchronous(
        self, uses: Mapping[str, ChannelUse], time_unit: str = "s", duration: float | None = None
    ) -> Synchronous:
        """Return channels in SI units on one clock; see `wm_drake.parameters.recorded.clock`.

        Args:
            uses: The channels by word.
            time_unit: Unit of a column of time without one; "" if there is none.
            duration: Duration of what was recorded, if it is known. [s]

        Raises:
            InputError: a channel cannot be used, its unit does not fit, or the times do not.
        """
        self._check_names(uses)
        assumed: dict[str, list[str]] = {}
        used, signals = {}, {}
        for word, each in uses.items():
            signals[word] = self._with_time_unit(each.signal, time_unit, assumed)
            text = self.unit_of(word, each.signal, each.unit)
            if not text and each.default:
                assumed.setdefault(each.default, []).append(word)
            if duration is not None:
                _check_duration(self.path, each.signal.abscissa, signals[word], duration)
            factor = self._factor(text or each.default, each)
            used[word] = Use(factor, each.kind, each.is_main)
        for unit, words in assumed.items():
            shown = shortened(", ".join(dict.fromkeys(words)), 80)
            notice(
                self.path,
                f"{shown}: the file has no unit; {unit} is assumed (--unit NAME=UNIT names one)",
            )
        return synchronous(self.path, signals, used)

    def unit_of(self, word: str, signal: Signal, unit: Unit | None = None) -> str:
        """Return the text of the unit of a channel: that of the file, or that which the user names.

        Args:
            unit: Unit to which it is converted; None if any unit will do.

        Raises:
            InputError: file and user name different units.
        """
        in_file = (plain_unit(signal.unit) and signal.unit) or _suffix(signal, unit)
        keys = [key for key in (word, *signal.names) if key in self.names.units]
        given = self.names.units[keys[0]] if keys else ""
        if not (in_file and given):
            return given or in_file
        try:
            measured = unit or Unit(plain_unit(in_file), plain_unit(in_file))
            same = factor_of(in_file, measured) == factor_of(given, measured)
        except ValueError:
            same = plain_unit(in_file) == plain_unit(given)
        if not same:
            raise input_error(
                f"is in {in_file} by the file, in {given} by the option; both must be the same",
                where=str(self.path),
                key=word,
            )
        return in_file

    def _factor(self, text: str, use: ChannelUse) -> float:
        if use.unit is None:
            return 1.0
        name = use.signal.title or use.signal.name
        if not text:
            raise input_error(
                f"has no unit; write '{name} [{use.unit.shown}]' in the header, or name it: "
                f"--unit '{name}={use.unit.shown}'",
                where=str(self.path),
                key=name,
            )
        try:
            return factor_of(text, use.unit)
        except ValueError as error:
            raise input_error(str(error), where=str(self.path), key=name) from None

    def _check_names(self, words: Iterable[str]) -> None:
        """Check that the option --unit names channels of the file."""
        known = {
            "time",
            *words,
            *self.names.words,
            *(name for signal in self.signals for name in signal.names),
        }
        for name in self.names.units:
            if name not in known:
                raise input_error(
                    f"{self.path} has no channel '{name}'{nearest_names(name, known)}",
                    where="--unit",
                )

    def _with_time_unit(
        self, signal: Signal, default: str, assumed: dict[str, list[str]]
    ) -> Signal:
        """Return a channel whose time, from a column without a unit, has the one assumed."""
        axis = signal.abscissa
        if axis.values is None or axis.kind or plain_unit(axis.unit):
            return signal
        if not default:
            raise input_error(
                "has no unit; write 'time [s]' in the header, or name it: --unit time=s",
                where=str(self.path),
                key=axis.name or "time",
            )
        _check_seconds(self.path, axis)
        assumed.setdefault(default, []).append(axis.name or "time")
        return replace(signal, abscissa=replace(axis, unit=default))


def read_recording(path: Path, names: ChannelNames | None = None) -> Recording:
    """Read the channels of a file in any format of `wm_drake.parameters.recorded.formats`.

    A file without a time of its own has it in a channel: the one that the user calls ``time``, or
    the one of `TIME_NAMES` in the same group and with as many samples. Of several in a table, a
    channel belongs to the nearest one to its left.

    Raises:
        InputError: the file is missing, damaged or of another format, or its package is not
            installed.
    """
    names = names or ChannelNames()
    recording = Recording(path, tuple(read_signals(path)), names)
    clock = recording.word("time")
    if clock is not None:
        axis = _axis(recording, clock)
        timed = tuple(_over(signal, clock, axis) for signal in recording.signals)
        return replace(recording, signals=timed)
    return replace(recording, signals=tuple(_with_times(recording)))


def _suffix(signal: Signal, unit: Unit | None) -> str:
    """Return the unit at the end of a name such as ``speed_rpm`` if it fits; "" otherwise."""
    suffix = word_of(signal.name)[1]
    if unit is None or not suffix:
        return ""
    try:
        factor_of(suffix, unit)
    except ValueError:
        return ""
    return suffix


def is_time(signal: Signal) -> bool:
    """Return whether a channel is one of time, by its name."""
    return bool({signal.name.lower(), word_of(signal.name)[0]} & set(TIME_NAMES))


def is_speed(unit: str) -> bool:
    """Return whether a unit is one of a drum speed, but not of a frequency."""
    try:
        factor_of(unit, SPEED)
    except ValueError:
        return False
    return plain_unit(unit) not in ("", "Hz")


def _over(signal: Signal, clock: Signal, axis: Abscissa) -> Signal:
    """Return a channel over the channel of time that the user names."""
    lengths = len(signal.values), len(clock.values)
    if signal is clock or (signal.abscissa.values is not None and lengths[0] != lengths[1]):
        return signal
    return replace(signal, abscissa=axis, start=clock.start)


def _with_times(recording: Recording) -> Iterator[Signal]:
    """Yield the channels, those without an abscissa over the channel of time that fits."""
    signals = recording.signals
    clocks = [(place, signal) for place, signal in enumerate(signals) if is_time(signal)]
    axes = {place: _axis(recording, signal) for place, signal in clocks}
    said = set[str]()
    for place, signal in enumerate(signals):
        if signal.abscissa.values is not None or place in axes or signal.abscissa.kind:
            yield signal
            continue
        fitting = _fitting(signal, clocks)
        if signal.lines is not None and len(fitting) > 1:
            left = [at for at in fitting if at < place]
            fitting = left[-1:] or fitting[:1]
            message = f"has {len(clocks)} columns of time; a channel belongs to the one to its left"
            if message not in said:
                said.add(message)
                notice(recording.path, message)
        if len(fitting) == 1:
            yield replace(signal, abscissa=axes[fitting[0]], start=signals[fitting[0]].start)
        elif fitting:
            names = ", ".join(_longest(signals[at]) for at in fitting)
            fault = f"has several channels of time ({names}); choose one: --channels time=NAME"
            yield replace(signal, abscissa=Abscissa(kind=fault))
        else:
            yield signal


def _fitting(signal: Signal, clocks: Sequence[tuple[int, Signal]]) -> list[int]:
    """Return the places of the channels of time of a channel: in its group, else above it."""
    group = signal.group
    while True:
        inside = [
            (place, clock)
            for place, clock in clocks
            if clock.group == group and len(clock.values) == len(signal.values)
        ]
        if inside or not group:
            break
        group = group.rpartition("/")[0]
    first = inside[:1]
    if first and all(np.array_equal(c.values, first[0][1].values) for _, c in inside):
        inside = first
    return [place for place, _ in inside]


def _axis(recording: Recording, clock: Signal) -> Abscissa:
    """Return a channel of time as an abscissa."""
    clock.usable(recording.path)
    word, suffix = word_of(clock.name)
    labelled = replace(clock, unit=clock.unit or (suffix if word in TIME_NAMES else ""))
    unit = recording.unit_of("time", labelled, SECOND)
    return Abscissa(clock.values, clock.title or clock.name, unit)


def _check_seconds(path: Path, axis: Abscissa) -> None:
    """Check that a time without a unit can be in seconds.

    Raises:
        InputError: it looks like dates of a spreadsheet, or like a count since 1970.
    """
    assert axis.values is not None
    values = axis.values[np.isfinite(axis.values)]
    if len(values) < 2:
        return
    step = float(np.median(np.abs(np.diff(values))))
    looks = ""
    if DAYS[0] <= values[0] <= DAYS[1] and step < LEAST_STEP:
        looks = "dates of a spreadsheet, in days: --unit time=d"
    elif values[0] > MOST_SECONDS:
        looks = "a count since 1970 in a unit such as ms, us or ns: --unit time=ms"
    if looks:
        raise input_error(
            f"has no unit, and its first value, {values[0]:.9g}, looks like {looks}; name its unit",
            where=str(path),
            key=axis.name,
        )


def _check_duration(path: Path, axis: Abscissa, signal: Signal, duration: float) -> None:
    """Check that a record lasts about as long as what was recorded.

    Raises:
        InputError: it does not; the message names the units of time that would fit.
    """
    time = signal.time(path)
    span = float(np.nanmax(time) - np.nanmin(time)) if np.isfinite(time).any() else 0.0
    has_unit = bool(axis.kind or plain_unit(axis.unit))
    most = LONGEST if has_unit else LIKELY
    if not span or 1.0 / most <= span / duration <= most:
        return
    assumed = "" if has_unit else "has no unit, and "
    fitting = [
        f"--unit time={unit}"
        for unit, factor in TIME_FACTORS.items()
        if 1.0 / LIKELY <= span * factor / duration <= LIKELY
    ]
    steps = np.diff(time)
    if not has_unit and np.all(steps == 1.0):
        rate = len(time) / duration
        fitting = [f"a time in place of numbers of samples (a rate of about {rate:.2g} Hz fits)"]
    hint = f"the unit may be another: {' or '.join(fitting)}" if fitting and not has_unit else ""
    raise input_error(
        f"{assumed}in seconds the record lasts {span:.6g} s, the profile {duration:.4g} s; "
        f"{hint or 'give the record and the profile of the same run'}",
        where=str(path),
        key=axis.name or "time",
    )


def listed(addresses: Iterable[str]) -> str:
    """Return names of channels for a message, the first ones of many."""
    names = list(addresses)
    text = ", ".join(names[:MOST_LISTED])
    if len(names) > MOST_LISTED:
        text += f" and {len(names) - MOST_LISTED} more (wm-drake record channels lists all)"
    return shortened(text, 300)


def _longest(signal: Signal) -> str:
    """Return the longest name of a channel, without its unit."""
    name = f"{signal.name}:{signal.node}" if signal.node else signal.name
    return f"{signal.group}/{name}" if signal.group else name


def _rate_and_span(time: FloatArray) -> dict[str, float]:
    """Return sampling rate and span of a time [s], those that it has."""
    inside = time[np.isfinite(time)]
    if len(inside) < 2:
        return {}
    step = float(np.median(np.diff(inside)))
    rate = {"rate_hz": 1.0 / step} if step > 0.0 else {}
    return {**rate, "begin_s": float(inside[0]), "end_s": float(inside[-1])}
