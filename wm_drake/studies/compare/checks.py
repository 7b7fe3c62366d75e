"""Check that recordings show the drum, and are like what their sensors should record."""

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.stats import beta

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SHARE, SPEED
from wm_drake.simulation.band import HIGHEST_PART
from wm_drake.simulation.orders import REVOLUTIONS, order_vectors
from wm_drake.simulation.records import profile_of
from wm_drake.studies.compare.diagnosis import Diagnosis
from wm_drake.studies.compare.pairs import OFFSET, Pair, order_one
from wm_drake.studies.compare.recordings import TestRecording

FALSE_ALARM = 1e-4
"""Probability that a record of noise alone passes; about twice that if its signals align its clock,
which finds the place where noise is most like the prediction (120 drawn records)."""

NEIGHBOURS = (1.0 - 3.0 / REVOLUTIONS, 1.0 + 3.0 / REVOLUTIONS)
"""Orders on both sides of 1 that a Blackman window of `REVOLUTIONS` just separates from it."""


CONTRADICTION = 0.05
"""Largest misfit of a recorded drum speed, by the highest speed of the profile."""

RATIOS = (1.0, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 2, 2.0, 3.0, 4.0)
"""Ratios of the true drum speed to the recorded one that are tried."""

SCANNED, WINDOWS = 0.04, 20
"""Relative step of the ratios that are searched where none of these fits, and number of windows."""

UNITS = {"Hz": 60.0, "rad/s": 30.0 / np.pi}
"""Units of a speed, by rpm."""

UPSIDE_DOWN = 1.5
"""Difference of a mean, by gravity, above which gravity has the other sign: 2, not 1 or 0."""

LARGER = 2.0
"""Smallest ratio of the amplitude of another order to that of order 1 that tells another ratio."""

LEAST_CORRELATION = 0.2
"""Largest correlation of signals that have nothing in common: an assumption."""


def check_pair(pair: Pair) -> None:
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
        f"noise up to {SHARE.text(limits[best])}; a sensor needs more",
        where=str(pair.recording.path),
    )


def check_orders(recording: TestRecording) -> None:
    """Check that the sensors vibrate with the recorded drum speed, not with a multiple of it.

    The amplitudes of other orders of the recorded speed are compared with those of order 1.

    Raises:
        InputError: most sensors have one other order that is far larger.
    """
    speed, time = recording.speed, recording.channels.time
    if speed is None or recording.about is None or not np.isfinite(speed).any():
        return
    known = np.isfinite(speed)
    angle = cumulative_trapezoid(np.interp(time, time[known], np.abs(speed[known])), time)
    angle = np.append(0.0, angle)
    values = np.stack([*recording.channels.values.values()], axis=1)
    values = np.where(known[:, None], values, np.nan)
    powers = _powers(values, angle, time, np.array([*RATIOS, *NEIGHBOURS]))
    if powers.any() and np.mean(np.argmax(powers, axis=0) == 0) >= 0.5:
        return
    ratio = _true_ratio(values, angle, time)
    if ratio and abs(np.log(ratio)) > 2.0 * SCANNED:
        about = recording.about
        units = [unit for unit, size in UNITS.items() if abs(np.log(ratio / size)) < SCANNED]
        more = f"; or its unit is {units[0]}, not rpm" if units and about.kind == "speed" else ""
        raise input_error(
            f"the sensors vibrate with {ratio:.3g} times the recorded drum speed, in which "
            f"order 1 is smaller by a factor of {LARGER:g} or more: the tacho has another ratio; "
            f"with ratio: {about.ratio / ratio:.3g} both agree{more}",
            where=str(recording.path),
            key=about.channel,
        )


def _powers(
    values: FloatArray, angle: FloatArray, time: FloatArray, orders: FloatArray
) -> FloatArray:
    """Return the mean squares of orders of signals (n, k) over time (orders, k); 0 if unknown."""
    windows = REVOLUTIONS, float(np.ptp(time)) / WINDOWS
    vectors = order_vectors(values, angle, time, orders, windows)
    squares = np.abs(vectors.values) ** 2
    known = np.isfinite(squares)
    return np.asarray(np.where(known, squares, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def _true_ratio(values: FloatArray, angle: FloatArray, time: FloatArray) -> float:
    """Return the ratio of the drum speed to the recorded one that sensors vibrate with; 0 if none.

    It is that whose order 1 is the largest, in windows of its own revolutions; a ratio of small
    numbers nearby is taken for it.
    """
    one = np.array([1.0])
    scale = np.maximum(np.nanvar(values, axis=0), 1e-300)

    def best_of(ratios: FloatArray) -> tuple[float, float]:
        sizes = [float((_powers(values, r * angle, time, one)[0] / scale).sum()) for r in ratios]
        best = int(np.argmax(sizes))
        return float(ratios[best]), sizes[best]

    coarse, size = best_of(np.exp(np.arange(np.log(1.0 / 20.0), np.log(70.0), SCANNED)))
    if size <= LARGER**2 * best_of(one)[1]:
        return 0.0
    fine, _ = best_of(coarse * np.exp(SCANNED * np.linspace(-1.0, 1.0, 17)))
    powers = _powers(values, fine * angle, time, np.array([1.0, *NEIGHBOURS])) / scale
    if powers[0].sum() <= LARGER**2 * powers[1:].sum(axis=1).max():
        return 0.0  # noise has as much of any order
    near = min(RATIOS, key=lambda ratio: abs(np.log(fine / ratio)))
    return near if abs(np.log(fine / near)) < 0.5 * SCANNED else fine


def check_speed(pair: Pair) -> None:
    """Check that a recorded speed is that of the run.

    Raises:
        InputError: it is not; the message says whether the sensors turn with it.
    """
    speed, run = pair.speed, pair.run
    if speed is None:
        return
    at = pair.alignment.of_run(pair.recording.channels.time)
    inside = np.isfinite(speed) & (at >= 0.0) & (at <= float(run.time[-1]))
    profile = profile_of(run)
    misfit = profile.highest_speed
    if inside.any():
        of_run = np.interp(at[inside], run.time.values, np.abs(run.drum_speed.values))
        misfit = float(np.sqrt(np.mean((np.abs(speed[inside]) - of_run) ** 2)))
    if misfit > CONTRADICTION * profile.highest_speed:
        raise input_error(
            f"the recorded drum speed contradicts the profile: at the best offset of the clock, "
            f"{OFFSET.text(pair.alignment.offset)}, they differ by {SPEED.text(misfit)} (RMS). The "
            "sensors vibrate with the recorded speed, so the profile is that of another run: name "
            "the right one (--profile), or drive the model with the recorded speed (--speed "
            "measured)",
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


def judged(diagnosis: Diagnosis, pair: Pair) -> str:
    """Return a sentence on a recording that is not like its prediction; "" if it is.

    Raises:
        InputError: its vibrations are not, and a cause explains it; or no sensor is like its
            prediction at all.
    """
    path = pair.recording.path
    is_upside_down = max(diagnosis.means.values(), default=0.0) > UPSIDE_DOWN
    if (diagnosis.doubtful or is_upside_down) and diagnosis.explanations:
        raise input_error(diagnosis.text, where=str(path))
    if not (diagnosis.unlike or diagnosis.shifted):
        return ""
    if float(np.abs(order_one(pair).correlation.values).max(initial=0.0)) < LEAST_CORRELATION:
        raise input_error(f"no signal is like its prediction; it {diagnosis.text}", where=str(path))
    return f"{path.name} {diagnosis.text}."
