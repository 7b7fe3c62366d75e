"""Orders of a record or of a measurement: signals with the angle of the drum."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from wm_drake.errors import input_error
from wm_drake.parameters.csv_files import finite_numbers, read_csv, read_header
from wm_drake.parameters.lab_files import is_lab_file
from wm_drake.parameters.lab_signals import SPEED as DRUM_SPEED
from wm_drake.parameters.lab_signals import TIME_NAMES, available_channels, clock_of, on_clock
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.orders import REVOLUTIONS, frequency_map, order_map
from wm_drake.simulation.records import read_measured

RAD_S_PER_RPM = np.pi / 30.0

SHOWN_ORDERS = (0.5, 1.0, 2.0, 3.0)
"""Orders of the table and of the CSV file."""

TIME, SPEED = "time_s", "speed_rpm"
"""Columns of a file of measurements, beside those of the signals."""

SPACING = 1e-3
"""Largest relative difference of two steps of time in a record that is equally sampled."""


@dataclass(frozen=True)
class Signals:
    """Signals with the angle of the drum.

    Attributes:
        source: Name of the file.
        unit: Their unit, for reading.
        time: (n,) [s]
        angle: (n,) Angle of the drum. [rad]
        values: (n, k) in `unit`.
    """

    source: str
    names: list[str]
    unit: str
    time: FloatArray
    angle: FloatArray
    values: FloatArray


@dataclass(frozen=True)
class Orders:
    """Order map and frequency map of signals, as `wm_drake.simulation.orders` returns them."""

    signals: Signals
    orders: xr.DataArray
    frequencies: xr.DataArray

    def shown_orders(self) -> list[float]:
        """Return the orders of the table and of the CSV file that the map has."""
        highest = float(self.orders.order.values[-1])
        return [order for order in SHOWN_ORDERS if order <= highest]

    def at_order(self, order: float) -> FloatArray:
        """Return the amplitude of the nearest order of the map. (times, signals)"""
        return np.asarray(self.orders.sel(order=order, method="nearest").values)


def read_signals(path: Path, unit: str, channels: Mapping[str, str] | None = None) -> Signals:
    """Read signals from a record (netCDF), a CSV or a file of a laboratory.

    Args:
        path: Record of the command spin, with the displacements at the sensors; or CSV with the
            columns time_s, speed_rpm and a column for each signal; or MDF4, TDMS, UFF 58 or MAT
            with a channel speed_rpm or speed and one for each signal, in units of its own.
        unit: Unit of signals whose file has none, for reading.
        channels: Name in the file of ``time``, ``speed`` or a signal, whose word is free; without a
            named signal all others are signals. Not of a netCDF record.
    """
    if is_lab_file(path) or (channels and path.suffix.lower() == ".csv"):
        return _read_lab(path, unit, channels or {})
    if path.suffix.lower() == ".csv":
        return _read_csv(path, unit)
    if channels:
        raise input_error("a netCDF record has no channels to choose", where="--channels")
    dimensions = {"time": ("time",), "displacement": ("time", "sensor"), "drum_angle": ("time",)}
    record = read_measured(path, dimensions)
    time, angle = record.time.values, record.drum_angle.values
    values = 1e3 * record.displacement.values
    names = [str(name) for name in record.sensor.values]
    return _checked(Signals(path.name, names, "mm", time, angle, values), path)


def _read_csv(path: Path, unit: str) -> Signals:
    header = read_header(path)
    names = [name for name in header if name not in (TIME, SPEED)]
    if TIME not in header or SPEED not in header or not names:
        raise input_error(
            f"needs the columns {TIME}, {SPEED} and one for each signal", where=str(path)
        )
    numbers = finite_numbers(read_csv(path, [TIME, SPEED, *names]), path)
    time = numbers[:, 0]
    angle = cumulative_trapezoid(RAD_S_PER_RPM * numbers[:, 1], time, initial=0.0)
    return _checked(Signals(path.name, names, unit, time, angle, numbers[:, 2:]), path)


def _read_lab(path: Path, unit: str, channels: Mapping[str, str]) -> Signals:
    """Return the signals of a file with named channels: that of the speed, and all others."""
    available = available_channels(path, channels)
    words = (SPEED, "speed") if "speed" not in channels else ("speed",)
    speeds = [channel for channel in available if channel.name in words]
    chosen = set(channels) - {"time", "speed"}
    used = [
        channel
        for channel in available
        if channel not in speeds
        and channel.name.lower() not in TIME_NAMES
        and (not chosen or channel.name in chosen)
    ]
    if len(speeds) != 1 or not used:
        raise input_error(
            f"needs one channel {SPEED} or speed and one for each signal", where=str(path)
        )
    time = clock_of(available, used, path)
    speed = on_clock(speeds[0], time, DRUM_SPEED, "rpm", path)
    units = {channel.unit for channel in used}
    if len(units) > 1:
        named = ", ".join(f"{channel.name} [{channel.unit}]" for channel in used[:4])
        raise input_error(f"its signals have different units: {named}", where=str(path))
    shown = units.pop() or unit
    values = [np.interp(time, c.time, c.values) if c.time is not None else c.values for c in used]
    if len({len(one) for one in (time, *values)}) > 1:
        raise input_error("its channels have different numbers of samples", where=str(path))
    angle = cumulative_trapezoid(speed, time, initial=0.0)
    names = [channel.name for channel in used]
    return _checked(Signals(path.name, names, shown, time, angle, np.stack(values, axis=1)), path)


def _checked(signals: Signals, path: Path) -> Signals:
    steps = np.diff(signals.time)
    if len(steps) < 2 or not np.all(np.isfinite(signals.time)) or np.any(steps <= 0.0):
        raise input_error("needs at least three samples in rising time", where=str(path))
    if np.ptp(steps) > SPACING * np.mean(steps):
        raise input_error(
            f"the steps of time differ by more than {100 * SPACING:g} %; resample it",
            where=str(path),
        )
    return signals


def orders_of(signals: Signals, highest: float) -> Orders:
    """Return order map and frequency map of signals.

    Raises:
        InputError: the record has fewer revolutions than a window.
    """
    orders = order_map(signals.values, signals.angle, signals.time, highest=highest)
    if not orders.sizes["time"]:
        turns = abs(signals.angle[-1] - signals.angle[0]) / (2.0 * np.pi)
        raise input_error(
            f"has {turns:.1f} drum revolutions; a window needs {REVOLUTIONS}", where=signals.source
        )
    return Orders(signals, orders, frequency_map(signals.values, signals.time))
