"""Spectra of signals of a run: amplitude over drum speed and order, or over time and frequency.

An order is a frequency in multiples of the drum's frequency: an unbalance acts with order 1. The
drum angle is known exactly, so a component of fixed order stays sharp while the drum speeds up.
"""

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from wm_drake.parameters.types import FloatArray

REVOLUTIONS = 8
"""Length of the window of an order map, in drum revolutions.

Orders that are 3/8 or more apart do not leak into each other. A longer window separates orders
better, a shorter one separates drum speeds better.
"""

HIGHEST_ORDER = 6.0
"""Highest order of an order map, if no other is given."""

ORDER_STEP = 1.0 / (2 * REVOLUTIONS)
"""Step between the orders of an order map. A component between two of them reads at most 3 % low.

The error is that of a Blackman window a quarter of a bin beside its centre: bins are 1/8 apart.
"""

PERIOD = 0.25
"""Time between the windows of a map. [s]"""

WINDOW = 4.0
"""Length of the window of a frequency map. [s] Its resolution is 1/4 Hz, in steps of 1/8 Hz."""


def order_map(
    signal: FloatArray,
    angle: FloatArray,
    time: FloatArray,
    *,
    revolutions: int = REVOLUTIONS,
    highest: float = HIGHEST_ORDER,
    step: float = ORDER_STEP,
    period: float = PERIOD,
) -> xr.DataArray:
    """Return the amplitudes of the orders of signals over time.

    They are the sizes of `order_vectors`.

    Args:
        signal: (n,) or (n, k), one column per signal.
        angle: (n,) drum angle. [rad]
        time: (n,) rising. [s]
        revolutions: Length of the window.
        step: Step between the orders; the first order is one step.
        period: Time between the centres of the windows. [s]

    Returns:
        As `order_vectors`, real.
    """
    orders: FloatArray = step * np.arange(1, round(highest / step) + 1, dtype=float)
    sizes: xr.DataArray = abs(order_vectors(signal, angle, time, orders, (revolutions, period)))
    return sizes


def order_vectors(
    signal: FloatArray,
    angle: FloatArray,
    time: FloatArray,
    orders: FloatArray,
    windows: tuple[int, float] = (REVOLUTIONS, PERIOD),
) -> xr.DataArray:
    """Return the complex amplitudes of orders of signals over time.

    The signal in each window of drum angle is integrated against the rotation of each order:

        A(o) = 2 sum w_i x_i exp(-j o phi_i) dphi_i / sum w_i dphi_i

    with a Blackman window w over a number of revolutions, and dphi_i by the trapezoidal rule, so
    that the samples need not be equally spaced in angle (time-variant discrete Fourier transform;
    Blough, Brown and Vold, SAE paper 972006, 1997). A component x = a cos(o phi + b) gives
    A(o) = a exp(j b). The mean of each window is removed first, since it is no vibration.

    Args:
        signal: (n,) or (n, k), one column per signal.
        angle: (n,) drum angle. [rad]
        time: (n,) rising. [s]
        orders: Orders, > 0.
        windows: Length of a window in revolutions, and time between their centres. [s]

    Returns:
        (time, order) or (time, order, signal) in the unit of the signal, with the drum speed of
        each centre as the coordinate `speed` [rad/s]. Only windows within the record are used, so
        it begins after half a window. NaN where the samples are too coarse for the order (at most
        half a turn of the order from sample to sample). Without a full window it has no times.
    """
    columns = np.atleast_2d(np.asarray(signal, dtype=float).T).T
    revolutions, period = windows
    turned = (
        np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))]) if len(time) else np.empty(0)
    )
    half = np.pi * revolutions
    centres, speed, places = _windows(time, angle, turned, half, period)
    values = np.full((len(centres), len(orders), columns.shape[1]), np.nan, dtype=complex)
    rotation = np.exp(-1j * np.outer(angle, orders))
    with threadpool_limits(1, "blas"):  # these products are too small for several threads
        for index, place in enumerate(places):
            inside = slice(*np.searchsorted(turned, (place - half, place + half)))
            near, part = turned[inside], columns[inside]
            if len(near) < 2:
                continue
            fine = orders * np.diff(near).max() <= np.pi
            share = np.gradient(near) * _blackman((near - place) / half)
            share /= share.sum()
            part = share[:, None] * (part - share @ part)
            values[index, fine] = 2.0 * rotation[inside][:, fine].T @ part
    result = xr.DataArray(
        values,
        {"time": centres, "order": orders, "speed": ("time", speed, {"units": "rad/s"})},
        ["time", "order", "signal"],
    )
    result["time"].attrs["units"] = "s"
    return result if np.ndim(signal) > 1 else result.isel(signal=0)


def _blackman(place: FloatArray) -> FloatArray:
    """Return the Blackman window at places between -1 and 1; its side lobes are below 0.2 %."""
    turn = np.pi * place
    return np.asarray(0.42 + 0.5 * np.cos(turn) + 0.08 * np.cos(2.0 * turn))


def _windows(
    time: FloatArray, angle: FloatArray, turned: FloatArray, half: float, period: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, drum speed and turned angle at the centres of windows within the record.

    Centres at which the drum rests are left out.
    """
    if len(time) < 2:
        return (np.empty(0),) * 3
    centres = np.arange(time[0], time[-1] + 0.5 * period, period)
    places = np.interp(centres, time, turned)
    speed = np.interp(centres, time, np.gradient(angle, time))
    inside = (places >= half) & (places <= turned[-1] - half) & (speed != 0.0)
    return centres[inside], speed[inside], places[inside]


def frequency_map(
    signal: FloatArray, time: FloatArray, *, window: float = WINDOW, period: float = PERIOD
) -> xr.DataArray:
    """Return the amplitudes of the frequencies of signals over time.

    It is a short-time Fourier transform with a Hann window, scaled so that a steady component
    x = a cos(2 pi f t + b) gives the amplitude a at frequency f. The mean of each window is removed
    first.

    Args:
        signal: (n,) or (n, k), one column per signal.
        time: (n,) rising in equal steps. [s]
        window: Length of the window. [s]
        period: Time between the centres of the windows. [s]

    Returns:
        (time, frequency) or (time, frequency, signal) in the unit of the signal, up to half the
        sampling rate. [Hz] Only windows within the record are used; without one it has no times.
    """
    columns = np.atleast_2d(np.asarray(signal, dtype=float).T).T
    spacing = float(time[1] - time[0]) if len(time) > 1 else 1.0
    length, hop = max(2, round(window / spacing)), max(1, round(period / spacing))
    lines = 2 * length
    values, centres = np.empty((0, length + 1, columns.shape[1])), np.empty(0)
    if len(columns) >= length:
        # windows around each hop-th sample, as many as there are within the record
        first = -(-(length // 2) // hop)
        begin = first * hop - length // 2
        parts = np.lib.stride_tricks.sliding_window_view(columns, length, axis=0)[begin::hop]
        centres = time[0] + spacing * hop * (first + np.arange(len(parts)))
        share = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)  # Hann window
        free_of_mean = parts - parts.mean(axis=-1, keepdims=True)
        spectra = np.fft.rfft(free_of_mean * (share / share.sum()), lines, axis=-1)
        spectra[..., 1:-1] *= 2.0  # each line stands for its negative frequency too
        values = np.moveaxis(np.abs(spectra), -1, 1)
    result = xr.DataArray(
        values,
        {
            "time": ("time", centres, {"units": "s"}),
            "frequency": ("frequency", np.fft.rfftfreq(lines, spacing), {"units": "Hz"}),
        },
        ["time", "frequency", "signal"],
    )
    return result if np.ndim(signal) > 1 else result.isel(signal=0)
