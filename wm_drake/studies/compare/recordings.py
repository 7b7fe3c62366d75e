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
from wm_drake.parameters.recorded.clock import HOLE, notice
from wm_drake.parameters.recorded_sensors import RecordedSensor, RecordedTest, SpeedChannel
from wm_drake.parameters.types import FloatArray

LEAST_SAMPLES = 200
"""Smallest number of samples of a recording."""

LEAST_PULSES = 20
"""Smallest number of pulses of a tacho that tell a speed."""

ROUNDED = 1.0
"""Largest distance of time stamps from a straight line, in steps, of a clock that rounds them."""


@dataclass(frozen=True, eq=False)
class TestRecording:
    """Channels of a recorded file that a test knows.

    Attributes:
        channels: Signals of the sensors by name, in SI units of what each measures.
        speed: Drum speed on the same clock (n,), NaN where there is none; None without one. [rad/s]
        pulses: Times of the pulses of a tacho (k,), on the same clock; None without one. [s]
    """

    channels: Synchronous
    speed: FloatArray | None = None
    pulses: FloatArray | None = None

    @property
    def path(self) -> Path:
        """File of the recording."""
        return self.channels.path


def read_test(path: Path, test: RecordedTest, names: ChannelNames) -> TestRecording:
    """Read the channels of the sensors of a test.

    Raises:
        InputError: no sensor of the test has a channel, a channel has no value, or the file cannot
            be read.
    """
    recording = read_recording(path, names)
    used = _sensor_channels(recording, test)
    uses = {
        name: ChannelUse(signal, test.sensors[name].signal_unit, test.sensors[name].unit)
        for name, signal in used.items()
    }
    about = test.speed or _named_speed(recording)
    shaft = None if about is None else recording.chosen(names.channels.get("speed", about.channel))
    if about is not None and shaft is not None and about.kind == "speed":
        uses["speed"] = ChannelUse(shaft, SPEED, about.unit, is_main=False)
    channels = _with_even_stamps(recording.synchronous(uses))
    values = dict(channels.values)
    speed = values.pop("speed", None)
    channels = replace(channels, values=values)
    _check_values(channels, used)
    pulses = None
    if about is not None and shaft is not None and about.kind == "pulses":
        pulses = _pulses(recording, shaft) + _later(shaft, [*used.values()])
    if speed is not None and about is not None:
        speed = speed / about.ratio
    return TestRecording(channels, speed, pulses)


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


def _pulses(recording: Recording, shaft: Signal) -> FloatArray:
    """Return the times of rises through the middle of a signal, after its own start. [s]"""
    path = recording.path
    uses = {"pulses": ChannelUse(shaft, None)}
    channels = recording.synchronous(uses)
    values, time = channels.values["pulses"], channels.time
    valid = np.isfinite(values)
    low, high = np.percentile(values[valid], (1.0, 99.0)) if valid.any() else (0.0, 0.0)
    if valid.any() and np.max(values[valid]) - low > 3.0 * (high - low):  # short pulses
        high = float(np.max(values[valid]))
    middle, quarter = 0.5 * (low + high), 0.25 * (high - low)
    states = np.where(values > middle + quarter, 1, np.where(values < middle - quarter, -1, 0))
    known = np.flatnonzero((states != 0) & valid)
    rises = known[1:][(states[known[1:]] > 0) & (states[known[:-1]] < 0)]
    before = known[:-1][(states[known[1:]] > 0) & (states[known[:-1]] < 0)]
    if len(rises) < LEAST_PULSES:
        raise input_error(
            f"has {len(rises)} pulses; at least {LEAST_PULSES} are needed for a speed",
            where=str(path),
            key=shaft.name,
        )
    part = (middle - values[before]) / (values[rises] - values[before])
    return np.asarray(time[before] + part * (time[rises] - time[before]))


def _later(shaft: Signal, others: Sequence[Signal]) -> float:
    """Return by how much a channel starts later than the first of others. [s]"""
    starts = [signal.start for signal in others if signal.start is not None]
    if shaft.start is None or not starts:
        return 0.0
    return 1e-9 * (shaft.start - min(starts))


def speed_of_pulses(recording: TestRecording, about: SpeedChannel) -> FloatArray:
    """Return the drum speed of the pulses at the samples of a recording. (n,) [rad/s]"""
    assert recording.pulses is not None
    times = recording.pulses
    between = 0.5 * (times[1:] + times[:-1])
    speed = pulse_angle(about) / np.diff(times)
    return np.interp(recording.channels.time, between, speed, left=np.nan, right=np.nan)


def pulse_angle(about: SpeedChannel) -> float:
    """Return the angle of the drum between two pulses. [rad]"""
    return 2.0 * np.pi / (about.pulses_per_turn * about.ratio)


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
