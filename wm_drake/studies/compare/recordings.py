"""Recordings of a test: the channels of its sensors in SI on one clock, drum speed, pulses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.recorded import (
    SPEED,
    ChannelNames,
    ChannelUse,
    Recording,
    Signal,
    Synchronous,
    read_recording,
)
from wm_drake.parameters.recorded.clock import notice
from wm_drake.parameters.recorded.health import Finding
from wm_drake.parameters.recorded.pulses import LEAST_PULSES, Pulses, counted, rises
from wm_drake.parameters.recorded.stamps import HOLE
from wm_drake.parameters.recorded_sensors import RecordedSensor, RecordedTest, SpeedChannel
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, factor_of

LEAST_SAMPLES = 200
"""Smallest number of samples of a recording."""

MATCHED, SEARCHED, MOST_RATIO = 100, 1000, 50
"""Samples of a record that are looked for in another one, samples on each side that are compared
then, and largest ratio of two rates of a copy."""

LEAST_LEVELS, DISORDER, SCALED = 20, 5e-4, 2e-3
"""Smallest number of values of a signal that tell a copy from a repeat. Of a copy: largest part of
samples that are not in order; largest change of its gain, and of its mean by its deviation or a
digit."""

ROUNDED = 1.0
"""Largest distance of time stamps from a straight line, in steps, of a clock that rounds them."""


@dataclass(frozen=True, eq=False)
class TestRecording:
    """Channels of a recorded file that a test knows.

    Attributes:
        channels: Signals of the sensors by name, in SI units of what each measures.
        speed: Drum speed on the same clock (n,), NaN where there is none; None without one. [rad/s]
        pulses: Pulses of a tacho, on the same clock; None without one.
        about: What is known of the speed; None without one.
        findings: What the checks of their health found.
    """

    channels: Synchronous
    speed: FloatArray | None = None
    pulses: Pulses | None = None
    about: SpeedChannel | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def path(self) -> Path:
        """File of the recording."""
        return self.channels.path


def read_test(
    path: Path, test: RecordedTest, names: ChannelNames, unit: str, duration: float
) -> TestRecording:
    """Read the channels of the sensors of a test.

    Args:
        unit: Unit of channels without one, of sensors that it fits; "" for none.
        duration: Duration of the profile. [s]

    Raises:
        InputError: no sensor of the test has a channel, a channel has no value, or the file cannot
            be read.
    """
    recording = read_recording(path, names)
    used = _sensor_channels(recording, test)
    uses = {
        name: ChannelUse(
            signal,
            s.signal_unit,
            s.unit or (unit if fits(unit, s.signal_unit) else ""),
            kind="vibration",
        )
        for name, signal in used.items()
        for s in (test.sensors[name],)
    }
    about = test.speed or _named_speed(recording)
    shaft = None if about is None else recording.chosen(names.channels.get("speed", about.channel))
    if about is not None and shaft is not None and about.kind == "speed":
        uses["speed"] = ChannelUse(shaft, SPEED, about.unit, is_main=False, kind="speed")
    channels = _with_even_stamps(recording.synchronous(uses, duration=duration))
    values, findings = dict(channels.values), channels.findings
    speed = values.pop("speed", None)
    channels = replace(channels, values=values)
    _check_values(channels, used)
    if about is None or shaft is None:
        return TestRecording(channels, findings=findings)
    if about.kind == "speed":
        assert speed is not None
        return TestRecording(channels, speed / about.ratio, None, about, findings)
    pulses, irregular = _pulses(recording, shaft)
    pulses = replace(pulses, times=pulses.times + _later(shaft, [*used.values()]))
    speed = pulse_angle(about) * pulses.speed(channels.time)
    return TestRecording(channels, speed, pulses, about, (*findings, *irregular))


def fits(text: str, unit: Unit) -> bool:
    """Return whether a unit, as instruments write it, measures what another one does."""
    try:
        factor_of(text, unit)
    except ValueError:
        return False
    return bool(text)


def _sensor_channels(recording: Recording, test: RecordedTest) -> dict[str, Signal]:
    """Return the channels of the sensors that the file has."""
    known = {name for signal in recording.signals for name in signal.names}
    known |= set(recording.addresses)
    used, missing = {}, []
    for name, sensor in test.sensors.items():
        channel = recording.names.channels.get(name, sensor.channel or name)
        if channel in known or name in recording.names.channels:
            used[name] = recording.chosen(channel)
        elif sensor.channel:
            missing.append(f"{name} ({sensor.channel})")
    if not used:
        named = ", ".join(s.channel or n for n, s in list(test.sensors.items())[:12])
        raise input_error(
            f"has no channel of a sensor of the test, such as {named}; its channels are "
            f"{recording.listed()}; name them in the file of --test, or --channels SENSOR=NAME",
            where=str(recording.path),
        )
    if missing:
        notice(recording.path, f"has no channel of the sensors {', '.join(missing)}; left out")
    return used


def _named_speed(recording: Recording) -> SpeedChannel | None:
    """Return the channel of a drum speed by its name; None if there is not one."""
    if "speed" in recording.names.channels:
        return SpeedChannel(channel=recording.names.channels["speed"], unit="rpm")
    fitting = recording.worded(("speed", "rpm"))
    if len(fitting) != 1:
        return None
    return SpeedChannel(channel=next(iter(fitting)), unit="rpm")


def _check_values(channels: Synchronous, used: Mapping[str, Signal]) -> None:
    for name, values in channels.values.items():
        if not np.isfinite(values).any():
            raise input_error(
                "has no valid sample; leave the sensor out, or record it again",
                where=str(channels.path),
                key=used[name].title or used[name].name,
            )
    if len(channels.time) < LEAST_SAMPLES:
        raise input_error(
            f"has {len(channels.time)} samples; at least {LEAST_SAMPLES} are needed",
            where=str(channels.path),
        )


def _with_even_stamps(channels: Synchronous) -> Synchronous:
    """Return channels whose time stamps, if a clock has rounded them, are even again."""
    time = channels.time
    steps = np.diff(time)
    if len(time) < LEAST_SAMPLES or np.ptp(steps) <= 1e-6 * np.median(steps):
        return channels
    if steps.max() > HOLE * np.median(steps):
        return channels
    count = np.arange(len(time))
    step, begin = np.polyfit(count, time, 1)
    line = begin + step * count
    off = float(np.max(np.abs(time - line)))
    if off > ROUNDED * step or off <= 1e-6 * step:
        return channels
    notice(channels.path, f"its time stamps are rounded, to {off:.2g} s; taken is an even clock")
    return replace(channels, time=line)


def _pulses(recording: Recording, shaft: Signal) -> tuple[Pulses, tuple[Finding, ...]]:
    """Return the pulses of a tacho after its own start, and what is irregular in them."""
    channels = recording.synchronous({"pulses": ChannelUse(shaft, None, kind="pulses")})
    times = rises(channels.time, channels.values["pulses"])
    if len(times) < LEAST_PULSES:
        raise input_error(
            f"has {len(times)} pulses; at least {LEAST_PULSES} are needed for a speed",
            where=str(recording.path),
            key=shaft.name,
        )
    resolution = float(np.median(np.diff(channels.time)))
    pulses, findings = counted(times, shaft.name, resolution)
    for finding in findings:
        notice(recording.path, str(finding), finding.channel)
    return pulses, (*channels.findings, *findings)


def _later(shaft: Signal, others: Sequence[Signal]) -> float:
    """Return by how much a channel starts later than the first of others. [s]"""
    starts = [signal.start for signal in others if signal.start is not None]
    if shaft.start is None or not starts:
        return 0.0
    return 1e-9 * (shaft.start - min(starts))


def pulse_angle(about: SpeedChannel) -> float:
    """Return the angle of the drum between two pulses. [rad]"""
    return 2.0 * np.pi / (about.pulses_per_turn * about.ratio)


def check_distinct(records: Sequence[Synchronous]) -> None:
    """Check that no record is a copy of another one: with other stamps, digits, length or rate.

    Raises:
        InputError: two have the same samples.
    """
    for number, one in enumerate(records):
        for other in records[:number]:
            names = [name for name in one.values if name in other.values]
            if names and all(_is_copy(one, other, name) for name in names):
                raise input_error(
                    f"has the same samples as {other.path}; a copy is no repeat and no other case, "
                    "and tells nothing of the scatter: give it once",
                    where=str(one.path),
                )


def _is_copy(one: Synchronous, other: Synchronous, name: str) -> bool:
    """Return whether a signal of a record has the same samples as that of another one.

    What rounds keeps the order of samples by their values; the noise of a repeat does not.
    """
    slow, fast = sorted((one, other), key=lambda record: -_step(record))
    ratio = min(round(_step(slow) / _step(fast)), MOST_RATIO)
    means = np.convolve(fast.values[name], np.full(ratio, 1.0 / ratio), "valid")
    kept = [each[k::ratio] for each in (fast.values[name], means) for k in range(ratio)]
    _, a, b = min((_overlap(slow.values[name], each) for each in kept), key=lambda pair: pair[0])
    levels = len(np.unique(a)), len(np.unique(b))
    if min(levels, default=0) < LEAST_LEVELS:
        return False
    fine, coarse = (a, b) if levels[0] > levels[1] else (b, a)
    gain, offset = np.polyfit((fine - np.mean(fine)) / np.std(fine), coarse - fine, 1)
    limit, digit = SCALED * np.std(fine), np.median(np.diff(np.unique(coarse)))
    if abs(gain) > limit or abs(offset) > max(limit, digit):
        return False
    ordered = coarse[np.lexsort((coarse, fine))]
    return bool(np.mean(np.diff(ordered) < 0.0) <= DISORDER)


def _step(record: Synchronous) -> float:
    return float(np.median(np.diff(record.time)))


def _overlap(a: FloatArray, b: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Return parts of two signals of one rate where they are most alike, and how far apart.

    The loudest samples of the shorter one are looked for in the other one.
    """
    short, long = sorted((a, b), key=len)
    if len(short) < MATCHED or not np.isfinite(short).any():
        return np.inf, short[:0], short[:0]
    middle = np.nanmedian(short)
    begin = max(0, int(np.nanargmax(np.abs(short - middle))) - MATCHED // 2)
    block = short[begin : begin + MATCHED] - middle
    weight = np.isfinite(block).astype(float)
    block = np.nan_to_num(block)
    filled = np.nan_to_num(long - middle, nan=10.0 * np.ptp(block))
    apart = np.correlate(filled**2, weight, "valid") - 2.0 * np.correlate(filled, block, "valid")
    later = int(np.argmin(apart)) - begin
    first = max(0, -later, begin - SEARCHED)
    parts = short[first : begin + SEARCHED], long[first + later : begin + later + SEARCHED]
    size = min(map(len, parts))
    known = np.isfinite(parts[0][:size]) & np.isfinite(parts[1][:size])
    least = float(apart.min() / max(float(block @ block), 1e-300))
    return least, parts[0][:size][known], parts[1][:size][known]


def used_sensors(
    recordings: Sequence[TestRecording], test: RecordedTest
) -> dict[str, RecordedSensor]:
    """Return the sensors that all recordings of a test have.

    Raises:
        InputError: there is none.
    """
    common = [
        name
        for name in test.sensors
        if all(name in recording.channels.values for recording in recordings)
    ]
    if not common:
        listed = "; ".join(f"{r.path.name}: {', '.join(r.channels.values)}" for r in recordings)
        raise input_error(f"the records have no sensor in common: {listed}", where="RECORD")
    return {name: test.sensors[name] for name in common}
