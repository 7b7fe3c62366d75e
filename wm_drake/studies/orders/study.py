"""Orders of a record or of a measurement: signals with the angle of the drum."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from wm_drake.errors import input_error
from wm_drake.parameters.recorded import (
    ACCELERATION,
    ChannelNames,
    ChannelUse,
    Recording,
    Signal,
    Synchronous,
    evenly,
    read_recording,
)
from wm_drake.parameters.recorded import SPEED as DRUM_SPEED
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, factor_of, plain_unit
from wm_drake.report.quantity import SPEED, TIME, Quantity, quantity_of
from wm_drake.simulation.orders import REVOLUTIONS, frequency_map, order_map
from wm_drake.simulation.records import read_measured

SHOWN_ORDERS = (0.5, 1.0, 2.0, 3.0)
"""Orders of the tables and of the CSV files."""


ORDER = Quantity("order", form="{:g}".format)
FREQUENCY = Quantity("frequency", Unit("Hz", "Hz"))


def read_signals(path: Path, names: ChannelNames | None = None, unit: str = "") -> xr.Dataset:
    """Read signals from a record (netCDF) or from a recorded file of any format.

    Args:
        path: Record of the command spin, with the displacements at the sensors; or recorded file
            with time, a channel speed or speed_rpm, and one for each signal.
        names: Name in the file of ``time``, ``speed`` or a signal, whose word is free; without a
            named signal all others are signals. Units of channels whose file has none.
        unit: Unit of signals whose file has none; "" for m/s^2.

    Returns:
        Over `time` [s] and `signal`: `value`, in the unit of the first signal of a recorded file,
        which may be any text; and `drum_angle` [rad]. Attributes `source`, name of the file, and
        `findings` of the checks of a recorded file.
    """
    names = names or ChannelNames()
    if path.suffix.lower() == ".nc" and not names.channels:
        return _of_record(path)
    recording = read_recording(path, names)
    speed, used = _speed_and_signals(recording)
    shown, factor, measured = _common_unit(recording, used, unit or ACCELERATION.si)
    uses = {
        word: ChannelUse(each, measured, unit or ACCELERATION.si, kind="vibration")
        for word, each in used.items()
    }
    channels = evenly(
        recording.synchronous(
            {**uses, "speed": ChannelUse(speed, DRUM_SPEED, "rpm", is_main=False, kind="speed")}
        )
    )
    angle, turning = _angle(channels.values["speed"], channels.time, path)
    values = {word: np.where(turning, channels.values[word] / factor, np.nan) for word in used}
    unit_read = Unit(shown.replace(" ", "*"), shown.replace(" ", "*"))
    signals = _signals(unit_read, channels.time, angle, values)
    return signals.assign_attrs(findings=channels.findings)


def _signals(
    unit: Unit, time: FloatArray, angle: FloatArray, values: Mapping[str, FloatArray]
) -> xr.Dataset:
    """Return the dataset of `read_signals`; `values` has the signals by name."""
    columns = np.stack(list(values.values()), axis=1)
    return xr.Dataset(
        {
            "value": Quantity("amplitude", unit, 2).variable(("time", "signal"), columns),
            "drum_angle": Quantity("angle of the drum", Unit("rad", "deg")).variable("time", angle),
        },
        {"time": TIME.variable("time", time), "signal": list(values)},
    )


def _of_record(path: Path) -> xr.Dataset:
    """Return the displacements at the sensors of a record."""
    dimensions = {"time": ("time",), "displacement": ("time", "sensor"), "drum_angle": ("time",)}
    record = read_measured(path, dimensions)
    names = [str(name) for name in record.sensor.values]
    columns = dict(zip(names, record.displacement.values.T, strict=True))
    channels = Synchronous(path, record.time.values, {**columns, "": record.drum_angle.values})
    if not np.all(np.diff(channels.time) > 0.0):
        raise input_error("needs at least three samples in rising time", where=str(path))
    even = evenly(channels)
    if len(even.time) != len(channels.time):
        raise input_error("its time has gaps", where=str(path))
    values = {name: even.values[name] for name in names}
    return _signals(Unit("m", "mm"), even.time, even.values[""], values)


def _speed_and_signals(recording: Recording) -> tuple[Signal, dict[str, Signal]]:
    """Return the channel of the speed, and the signals by name.

    Raises:
        InputError: there is not one speed, or no signal.
    """
    named = set(recording.names.channels) - {"time", "speed"}
    speed, others = recording.word("speed"), recording.others()
    if speed is None:
        speeds = recording.worded(("speed",))
        if len(speeds) != 1:
            raise input_error(
                f"needs one channel of the drum speed, named speed or speed_rpm, and has "
                f"{len(speeds)}; its channels are {recording.listed()}; choose one: --channels "
                "speed=NAME",
                where=str(recording.path),
            )
        address, speed = speeds.popitem()
        del others[address]
    used = {word: recording.chosen(recording.names.channels[word]) for word in named} or others
    if not used:
        raise input_error(
            "needs a channel for each signal beside those of time and speed",
            where=str(recording.path),
        )
    return speed, dict(sorted(used.items())) if named else used


_QUANTITIES = (
    ACCELERATION,
    *(Unit(si, si) for si in ("m", "m/s", "N", "N*m", "V", "Pa", "A", "rad", "rad/s")),
)
"""Quantities of which signals in different units are converted to that of the first."""


def _common_unit(
    recording: Recording, used: Mapping[str, Signal], default: str
) -> tuple[str, float, Unit | None]:
    """Return the unit of all signals, its factor, and the unit to which they are converted first.

    Raises:
        InputError: the signals are of different quantities.
    """
    units = {word: recording.unit_of(word, each) or default for word, each in used.items()}
    shown = next(iter(units.values()))
    if len({plain_unit(text) for text in units.values()}) == 1:
        return shown.strip("[] "), 1.0, None
    for quantity in _QUANTITIES:
        try:
            factors = [factor_of(text, quantity) for text in units.values()]
        except ValueError:
            continue
        return shown.strip("[] "), factors[0], quantity
    named = ", ".join(f"{word} [{text}]" for word, text in list(units.items())[:4])
    raise input_error(
        f"its signals have different units: {named}; choose some: --channels WORD=NAME",
        where=str(recording.path),
    )


def _angle(speed: FloatArray, time: FloatArray, path: Path) -> tuple[FloatArray, np.ndarray]:
    """Return the angle of the drum [rad], and at which samples its speed is known.

    The angle runs on where the speed is not known; no window of the maps includes such samples.
    """
    known = np.isfinite(speed)
    if not known.any():
        raise input_error("has no sample of the drum speed", where=str(path))
    filled = np.interp(time, time[known], speed[known])
    return cumulative_trapezoid(filled, time, initial=0.0), known


def orders_of(signals: xr.Dataset, highest: float, source: str) -> xr.Dataset:
    """Return order map and frequency map of signals.

    Args:
        signals: As of `read_signals`.
        source: Name of the file, for messages.

    Returns:
        Over `time` [s], `order` and `signal`: `amplitude`, with the drum speed of each time as the
        coordinate `speed` [rad/s]. Over `spectrum_time` [s], `frequency` [Hz] and `signal`:
        `spectrum`, with `spectrum_speed` [rad/s]. Amplitudes are in the unit of the signals.

    Raises:
        InputError: the record has fewer revolutions than a window, or no window without a gap, or
            its samples resolve no order.
    """
    time, angle = signals.time.values, signals.drum_angle.values
    amplitude = quantity_of(signals.value)
    orders = order_map(signals.value.values, angle, time, highest=highest)
    if not orders.sizes["time"]:
        turns = abs(angle[-1] - angle[0]) / (2.0 * np.pi)
        raise input_error(
            f"has {turns:.1f} drum revolutions; a window needs {REVOLUTIONS}", where=source
        )
    if not np.isfinite(orders.values).any():
        raise input_error(_why_empty(signals), where=source)
    spectra = frequency_map(signals.value.values, time)
    speed = np.interp(spectra.time.values, time, np.gradient(angle, time))
    over = ("spectrum_time", "frequency", "signal")
    return xr.Dataset(
        {
            "amplitude": amplitude.variable(("time", "order", "signal"), orders.values),
            "spectrum": amplitude.variable(over, spectra.values),
        },
        {
            "time": TIME.variable("time", orders.time.values),
            "order": ORDER.variable("order", orders.order.values),
            "signal": signals.signal.values,
            "speed": SPEED.variable("time", orders.speed.values),
            "spectrum_time": TIME.variable("spectrum_time", spectra.time.values),
            "frequency": FREQUENCY.variable("frequency", spectra.frequency.values),
            "spectrum_speed": SPEED.variable("spectrum_time", speed),
        },
    )


def at_orders_shown(maps: xr.Dataset) -> xr.Dataset:
    """Return amplitudes of some orders that the map has, over time, order and signal."""
    highest = maps.order.values[-1]
    at = [order for order in SHOWN_ORDERS if order <= highest]
    amplitude = maps[["amplitude"]].sel(order=at, method="nearest")
    return amplitude.assign_coords(order=ORDER.variable("order", at))


def largest_of_orders(maps: xr.Dataset) -> xr.Dataset:
    """Return the largest amplitude of some orders, and the drum speed there.

    Each place has an order and a signal; amplitude and speed are NaN where the samples do not
    resolve the order.
    """
    data = at_orders_shown(maps)
    amplitude = data.amplitude.stack(place=("order", "signal")).transpose("time", "place")
    filled = amplitude.fillna(-1.0)
    speed = data.speed.values[filled.argmax("time").values]
    is_resolved = amplitude.notnull().any("time").values
    quantity = quantity_of(maps.amplitude).named("largest amplitude")
    return xr.Dataset(
        {
            "order": ORDER.variable("place", amplitude.order.values),
            "signal": ("place", amplitude.signal.values),
            "amplitude": quantity.variable("place", amplitude.max("time").values),
            "speed": SPEED.named("at").variable("place", np.where(is_resolved, speed, np.nan)),
        }
    )


def _why_empty(signals: xr.Dataset) -> str:
    """Return why no window of an order map has a value."""
    step = float(np.diff(signals.time.values[:2])[0])
    turn = float(np.median(np.abs(np.diff(signals.drum_angle.values)))) / (2.0 * np.pi)
    if turn > 0.25:
        return (
            f"its samples resolve no order: the drum turns {turn:.3g} revolutions in a step of "
            f"{step:.4g} s; if the time has another unit, name it: --unit time=ms"
        )
    return f"has no {REVOLUTIONS} drum revolutions without a gap"
