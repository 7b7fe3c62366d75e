"""Signals that a controller may use, their errors, and the features of an estimate.

The runs have exact signals. What a real sensor adds is added after them, so that another sensor
needs no new runs: of n samples in the window, each with white noise of deviation s and rounded to a
step q (a uniform error of deviation q / sqrt 12), cosine and sine part of an order have errors of
deviation

    sqrt(2 / n (s^2 + q^2 / 12))

each (docs/theory/detect.md), drawn from the seed by the name of the signal, so that all estimates
of a study have the same luck.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import check_known, input_error
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity
from wm_drake.studies.detect.holds import Hold
from wm_drake.studies.detect.measures import ORDERS

SAMPLE = Unit("s", "ms")


@dataclass(frozen=True)
class SignalKind:
    """What signals of one kind are, and the errors of a usual sensor.

    Attributes:
        quantity: Amplitude of order one, with words in which {} is the name of the sensor.
        noise, resolution, sample: Of a sensor for which the user gives none. [SI]
    """

    quantity: Quantity
    noise: float
    resolution: float
    sample: float = 0.01


KINDS = {
    # assumption: 1 % of the largest torque of the machine 'motor' at the drum, from its current
    "torque": SignalKind(Quantity("torque ripple", Unit("N*m", "N*m"), 2), 0.2, 0.05),
    # assumption: a tacho of some ten pulses a turn of a motor that turns ten times as fast
    "speed": SignalKind(Quantity("speed ripple", Unit("rad/s", "rpm"), 2), 0.02, 0.01),
    # assumption: a magnet and a Hall sensor over 30 mm, 12 bit with noise
    "displacement": SignalKind(Quantity("amplitude at {}", Unit("m", "mm"), 2), 2e-4, 5e-5),
    # assumption: a MEMS sensor of 2 g, 12 bit, 5 mg of noise
    "acceleration": SignalKind(
        Quantity("acceleration at {}", Unit("m/s^2", "m/s^2"), 3), 0.05, 0.01
    ),
}
"""Kinds of signals by the names of their measures."""


@dataclass(frozen=True)
class ControllerSignal:
    """A signal with its errors.

    Attributes:
        name: `torque`, `speed`, a sensor, or accelerometer and axis, such as `S1.x`.
        place: Number of the sensor, and of its axis; () for torque and speed.
        noise: Standard deviation of the noise of a sample. [SI]
        resolution: Step of its numbers. [SI]
        sample: Time between samples. [s]
    """

    name: str
    kind: str
    place: tuple[int, ...]
    noise: float
    resolution: float
    sample: float

    @property
    def quantity(self) -> Quantity:
        """Return words and unit of its amplitude."""
        quantity = KINDS[self.kind].quantity
        return quantity.named(quantity.words.format(self.name), decimals=quantity.decimals)

    def deviation(self, duration: float) -> float:
        """Return the deviation of cosine and sine part of an order in a window. [SI]"""
        variance = self.noise**2 + self.resolution**2 / 12.0
        return float(np.sqrt(2.0 * self.sample / duration * variance))

    def amplitudes(self, hold: Hold, data: xr.Dataset, turns: int, seed: int) -> FloatArray:
        """Return the complex amplitudes of each order that the controller sees. (draws, orders)

        Args:
            data: Measures of the draws in the hold.
            turns: Length of the window.
        """
        parts = np.stack([data[f"window_{self.kind}_{order}"].values for order in ORDERS], axis=2)
        at_sensor = np.moveaxis(parts, -1, 3)[(slice(None),) * 4 + self.place]
        exact = at_sensor @ np.array([1.0, -1.0j])
        weights = hold.weights(turns)
        mean = np.tensordot(weights, exact, (0, 1))
        rng = np.random.default_rng([seed, turns, *self.name.encode()])
        errors = rng.standard_normal((*mean.shape, 2)) @ np.array([1.0, 1.0j])
        return np.asarray(mean + self.deviation(turns * hold.turn) * errors)


def known_signals(parameters: MachineParameters) -> dict[str, ControllerSignal]:
    """Return the signals of a machine by name, with the errors of usual sensors."""
    places: dict[str, tuple[str, tuple[int, ...]]] = {}
    if motor_of(parameters.drive) is not None:
        places |= {"torque": ("torque", ()), "speed": ("speed", ())}
    places |= {name: ("displacement", (k,)) for k, name in enumerate(parameters.sensors)}
    places |= {
        f"{name}.{axis}": ("acceleration", (k, a))
        for k, name in enumerate(parameters.accelerometer_frames())
        for a, axis in enumerate("xyz")
    }
    return {
        name: ControllerSignal(
            name, kind, place, KINDS[kind].noise, KINDS[kind].resolution, KINDS[kind].sample
        )
        for name, (kind, place) in places.items()
    }


def chosen_signals(
    parameters: MachineParameters, texts: Sequence[str]
) -> tuple[ControllerSignal, ...]:
    """Return the signals of `--signal`; by default torque and speed, or the first sensor.

    Args:
        texts: Such as "Xr" or "torque, noise=0.1 N*m, resolution=0.01 N*m, sample=5 ms". A text
            without a name, such as "sample=5 ms", goes on with the signal before: forms split texts
            at commas.

    Raises:
        InputError: a signal is unknown or its numbers are wrong, or the machine has no signal.
    """
    known = known_signals(parameters)
    if not known:
        message = (
            "has neither a motor nor a sensor, so its controller sees nothing; add sensors, or "
            "drive: {kind: motor, ...} as in the shipped machine 'motor'"
        )
        raise input_error(message, key="sensors")
    if not texts:
        return tuple(known[name] for name in known if name in ("torque", "speed")) or (
            next(iter(known.values())),
        )
    entries = list[str]()
    for text in texts:
        if entries and "=" in text.partition(",")[0]:
            entries[-1] += f", {text}"
        else:
            entries.append(text)
    return tuple(_signal(entry, known) for entry in entries)


def _signal(text: str, known: Mapping[str, ControllerSignal]) -> ControllerSignal:
    name, *settings = (part.strip() for part in text.split(","))
    check_known(name, known, f"no signal '{name}' in this machine", where="--signal")
    signal, changes = known[name], dict[str, Any]()
    unit = KINDS[signal.kind].quantity.unit
    units = {"noise": unit, "resolution": unit, "sample": SAMPLE}
    for setting in settings:
        field, _, number = setting.partition("=")
        check_known(field, units, f"'{setting}' is no setting of a signal", where="--signal")
        try:
            changes[field] = units[field].number(number)
        except ValueError as error:
            raise input_error(f"{setting}: {error}", where="--signal") from None
        if changes[field] < 0.0 or (field == "sample" and not changes[field]):
            raise input_error(f"'{setting}' is not above 0", where="--signal")
    return replace(signal, **changes)


AMPLITUDE, PHASE, SECOND, PRODUCTS = "amplitude", "phase", "order2", "products"
FEATURES = (AMPLITUDE, PHASE, SECOND, PRODUCTS)
"""Families of features: amplitudes of order one; parts of the other signals in phase with the first
one and a quarter of a turn before it; amplitudes of order two; squares and products of all these.
"""


def features_of(
    signals: Sequence[ControllerSignal], families: Sequence[str], amplitudes: Sequence[FloatArray]
) -> xr.DataArray:
    """Return the features of draws over `draw` and `feature`. [SI]

    The phase is that against the first signal, so that the drum needs no mark: the mass turns both.

    Args:
        amplitudes: As of `ControllerSignal.amplitudes`, of each signal.
    """
    first = amplitudes[0][:, 0]
    turned = np.conj(first) / np.abs(first)
    columns = dict[str, FloatArray]()
    for number, (signal, values) in enumerate(zip(signals, amplitudes, strict=True)):
        if AMPLITUDE in families:
            columns[signal.name] = np.abs(values[:, 0])
        if PHASE in families and number:
            relative = values[:, 0] * turned
            columns[f"{signal.name} in phase"] = relative.real
            columns[f"{signal.name} before"] = relative.imag
        if SECOND in families:
            columns[f"{signal.name} order 2"] = np.abs(values[:, 1])
    if PRODUCTS in families:
        pairs = itertools.combinations_with_replacement(list(columns), 2)
        columns |= {f"{a} × {b}": columns[a] * columns[b] for a, b in pairs}
    return xr.DataArray(
        np.column_stack(list(columns.values())), {"feature": list(columns)}, ("draw", "feature")
    )
