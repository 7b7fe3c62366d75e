"""Signals over time from files of laboratories: records of a machine and of accelerometers."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.lab_files import Channel, chosen, csv_channels, is_lab_file, read_channels
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, factor_of

TIME_NAMES = ("time", "time_s", "t")
"""Names of a channel of time, for files without a time of their own. [s]"""

ACCELERATION, SPEED = Unit("m/s^2", "m/s^2"), Unit("rad/s", "rpm")


def available_channels(path: Path, channels: Mapping[str, str]) -> list[Channel]:
    """Return the channels of a file; those that the user names have the words of this package.

    Args:
        path: CSV file, or file of a format of `wm_drake.parameters.lab_files`.
        channels: Name in the file of a word such as ``time`` or ``S1_x``.

    Raises:
        InputError: the file cannot be read, or a channel is missing or there twice.
    """
    available = read_channels(path) if is_lab_file(path) else csv_channels(path)
    named = {
        word: replace(chosen(available, name, path), name=word) for word, name in channels.items()
    }
    used = set(channels.values())
    others = [c for c in available if c.name not in used and c.name not in named]
    if "time" in named:
        others = [c for c in others if c.name.lower() not in TIME_NAMES]
    return [*named.values(), *others]


def lab_signals(
    path: Path, units: Mapping[str, Unit], default: str, channels: Mapping[str, str] | None = None
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return time [s] and channels of a file, in SI, all at the time of the first channel.

    A channel with other times is interpolated.

    Args:
        path: CSV file, or file of a format of `wm_drake.parameters.lab_files`.
        units: Names of the wanted channels, with the unit each is converted to.
        default: Unit of a channel whose file has none.
        channels: As for `available_channels`.

    Raises:
        InputError: the file cannot be read, a channel is missing or there twice, its unit does not
            fit, or it has a value that is not a finite number.
    """
    available = available_channels(path, channels or {})
    signals = {name: chosen(available, name, path) for name in units}
    time = clock_of(available, list(signals.values()), path)
    return time, {
        name: on_clock(channel, time, units[name], default, path)
        for name, channel in signals.items()
    }


def clock_of(available: list[Channel], used: list[Channel], path: Path) -> FloatArray:
    """Return the time of the first channel that has one, else the channel of time. [s]

    Raises:
        InputError: there is no time, or not one channel of it.
    """
    clock = next((channel.time for channel in used if channel.time is not None), None)
    if clock is not None:
        return clock
    named = [channel for channel in available if channel.name.lower() in TIME_NAMES]
    if len(named) != 1:
        raise input_error(
            f"has {len(named)} channels of time; one is needed, named {' or '.join(TIME_NAMES)}",
            where=str(path),
        )
    return named[0].values * _factor(named[0], Unit("s", "s"), "s", path)


def on_clock(
    channel: Channel, time: FloatArray, unit: Unit, default: str, path: Path
) -> FloatArray:
    """Return a channel in SI at times; arguments as for `lab_signals`.

    Raises:
        InputError: it has another number of samples, or a value that is not a finite number.
    """
    values = channel.values * _factor(channel, unit, default, path)
    if channel.time is not None and not np.array_equal(channel.time, time):
        values = np.asarray(np.interp(time, channel.time, values))
    if len(values) != len(time):
        raise input_error(
            f"channel '{channel.name}' has {len(values)} samples, the time has {len(time)}",
            where=str(path),
        )
    if not np.isfinite(values).all():
        raise input_error(
            f"channel '{channel.name}' has a value that is not a finite number", where=str(path)
        )
    return values


def _factor(channel: Channel, unit: Unit, default: str, path: Path) -> float:
    try:
        return factor_of(channel.unit or default, unit)
    except ValueError as error:
        raise input_error(str(error), where=str(path), key=channel.name) from None
