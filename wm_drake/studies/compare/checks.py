"""Check that recordings show the drum, and are like what their sensors should record."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import beta

from wm_drake.errors import input_error
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SHARE
from wm_drake.simulation.band import HIGHEST_PART
from wm_drake.simulation.orders import REVOLUTIONS, order_vectors
from wm_drake.studies.compare.pairs import QUANTITIES, Pair, order_one

FALSE_ALARM = 1e-4
"""Probability that a record of noise alone passes; about twice that if its signals align its clock,
which finds the place where noise is most like the prediction (120 drawn records)."""

NEIGHBOURS = (1.0 - 3.0 / REVOLUTIONS, 1.0 + 3.0 / REVOLUTIONS)
"""Orders on both sides of 1 that a Blackman window of `REVOLUTIONS` just separates from it."""


REVERSED = -0.5
"""Correlation of order 1 below which a sensor is taken to have the other sign."""

LEAST_CORRELATION = 0.2
"""Largest correlation of signals that have nothing in common: an assumption."""


def check_pair(pair: Pair, sensors: Mapping[str, RecordedSensor]) -> None:
    """Check that a recording shows the turning drum, and is like its prediction.

    Raises:
        InputError: its signals are noise, a sensor has the other sign, or none is like its
            prediction.
    """
    _check_order_one(pair)
    _check_signs(pair, sensors)


def _check_order_one(pair: Pair) -> None:
    """Check that order 1 of a sensor stands out of the noise.

    Raises:
        InputError: noise alone would have as much of it, or the drum does not turn often enough.
    """
    shares, counts = shares_of_order_one(pair)
    if not counts.any():
        raise input_error(
            f"has no {REVOLUTIONS} revolutions of the drum without a gap; at least that many are "
            "needed to tell a vibration from noise",
            where=str(pair.recording.path),
        )
    limits = largest_share_of_noise(counts, FALSE_ALARM / len(counts))
    if (shares > limits).any():
        return
    best = int(np.argmax(shares - limits))
    orders = ", ".join(f"{order:.3g}" for order in NEIGHBOURS)
    raise input_error(
        f"no sensor shows the turning drum above noise: order 1 has {SHARE.text(shares[best])} of "
        f"the power of orders 1, {orders} in {list(pair.recording.channels.values)[best]}, and "
        f"noise up to {SHARE.text(limits[best])}; a sensor needs more. Are channels, profile and "
        "load those of the test?",
        where=str(pair.recording.path),
    )


def shares_of_order_one(pair: Pair) -> tuple[FloatArray, np.ndarray]:
    """Return how far order 1 of each sensor stands out of the noise beside it.

    In a window of `REVOLUTIONS`, E is the power of order 1 and E- and E+ that of the nearest orders
    that do not leak into it, `NEIGHBOURS`. The share of order 1 is E / (E- + E + E+): near 1 for an
    unbalance, 1/3 in the mean for noise of any size whose spectrum is straight over these orders.

    Returns:
        Means of the shares over windows that do not overlap by much, 0 without one, and the
        numbers of these windows, (sensors,) each. Windows with a gap are left out, and those in
        which a sample of the recording is too coarse for the orders.
    """
    run = pair.run
    angle, time = np.abs(run.drum_angle.values), run.time.values
    vectors = order_vectors(pair.measured, angle, time, np.array([1.0, *NEIGHBOURS]))
    step = float(np.median(np.diff(pair.recording.channels.time)))
    is_fine = vectors.speed.values * NEIGHBOURS[-1] * step <= 2.0 * np.pi * HIGHEST_PART
    turned = np.interp(vectors.time, time, angle)
    _, first = np.unique(turned // (2.0 * np.pi * REVOLUTIONS), return_index=True)
    power = np.abs(vectors.values[first[is_fine[first]]]) ** 2  # window, order, sensor
    total = power.sum(axis=1)
    known = total > 0.0
    shares = np.where(known, power[:, 0] / np.where(known, total, 1.0), 0.0)
    counts = known.sum(axis=0)
    return shares.sum(axis=0) / np.maximum(counts, 1), counts


def largest_share_of_noise(count: np.ndarray, probability: float) -> FloatArray:
    """Return the share of order 1 that noise exceeds with a probability.

    The complex amplitudes of noise at three orders are independent and Gaussian with one variance,
    so their powers are exponential and a share has the distribution Beta(1, 2), of the mean 1/3 and
    the variance 1/18. The mean of n shares has the variance 1 / (18 n); its distribution is taken
    to be the Beta distribution with this mean and variance, Beta(nu / 3, 2 nu / 3) with
    nu = 4 n - 1, which is exact for n = 1.

    Args:
        count: Number of windows n, (k,).
        probability: Probability that noise exceeds the share.
    """
    size = 4.0 * np.maximum(count, 1) - 1.0
    return np.asarray(beta.isf(probability, size / 3.0, 2.0 * size / 3.0))


def _check_signs(pair: Pair, sensors: Mapping[str, RecordedSensor]) -> None:
    """Check that no sensor has the other sign, and that the signals have something in common.

    Signs are told by the correlations of order 1, or by gravity. The angle of the drum at the start
    is unknown, so a single sensor without gravity can have either sign.

    Raises:
        InputError: a sensor has the other sign, or no signal is like its prediction.
    """
    path = str(pair.recording.path)
    correlations = order_one(pair).correlation
    for name, sensor in sensors.items():
        k = list(sensors).index(name)
        if _has_opposite_gravity(pair, sensor, k):
            raise _reversed(path, name, "its mean has the other sign than gravity")
        value = float(correlations.sel(sensor=name))
        if value < REVERSED:
            text = f"its order 1 has the correlation {value:.2f} with the prediction"
            raise _reversed(path, name, text)
    if len(sensors) and float(np.abs(correlations).max()) < LEAST_CORRELATION:
        raise input_error(
            f"no signal is like its prediction: the largest correlation of order 1 is "
            f"{float(np.abs(correlations).max()):.2f}; is it the load, the profile and the machine "
            "of the test? A channel of the drum speed would align it",
            where=path,
        )


LEAST_GRAVITY = 3.0
"""Smallest mean of an accelerometer that tells its sign. [m/s^2]"""


def _has_opposite_gravity(pair: Pair, sensor: RecordedSensor, k: int) -> bool:
    if not sensor.shows_gravity:
        return False
    measured, predicted = (float(np.nanmean(signal[:, k])) for signal in pair.both)
    return measured * predicted < 0.0 and min(abs(measured), abs(predicted)) > LEAST_GRAVITY


def _reversed(path: str, name: str, why: str) -> Exception:
    return input_error(
        f"has the other sign than its sensor is declared with: {why}; turn its axis, or set "
        "polarity (negative for a signal of the other sign)",
        where=path,
        key=name,
    )


def gravity_warnings(pairs: Sequence[Pair], sensors: Mapping[str, RecordedSensor]) -> list[str]:
    """Return a warning of each accelerometer that does not show the gravity that it should."""
    warnings = []
    for k, (name, sensor) in enumerate(sensors.items()):
        if not sensor.shows_gravity:
            continue
        measured, predicted = (
            float(np.mean([np.nanmean(pair.both[side][:, k]) for pair in pairs])) for side in (0, 1)
        )
        unit = QUANTITIES["acceleration"]
        if abs(measured - predicted) > 1.0:
            warnings.append(
                f"{name}: its mean is {unit.text(measured)}, with gravity it would be "
                f"{unit.text(predicted)}. If it is AC-coupled or without gravity, say so: "
                "ac_coupling, or gravity: removed."
            )
    return warnings
