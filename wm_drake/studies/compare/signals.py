"""What is compared of a recording: its signals in the pass band, their amplitudes and orders.

Measured and predicted signals pass the same filters, with the same gaps. Nothing measured is
corrected: the prediction has gravity, the axes of the sensors, and what the recorder does.

An amplitude, here and in fits to records, is the smooth envelope: the magnitude of the analytic
signal within the pass band. Noise of the standard deviation s in the band raises an amplitude A by
s^2 / (2 A) (Rice, for s << A). A line from peak to peak would lie far too low: noise has peaks on
every flank of a slow signal.
"""

from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr
from scipy.sparse import csr_array

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED, TIME, quantity_of
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.displacements import analytic_sizes, filtered
from wm_drake.simulation.mount_forces import speed_ranges
from wm_drake.simulation.orders import order_vectors
from wm_drake.simulation.records import Record, profile_of, sample_period
from wm_drake.simulation.vibration import integrated_twice
from wm_drake.studies.compare.pairs import Pair, order_one
from wm_drake.studies.orders.study import SHOWN_ORDERS

PLACES = 80
"""Number of drum speeds, or of times of a profile that does not only rise, that are compared."""

LEAST_COVERED = 0.5
"""Smallest part of a region that a recording must have."""

LEAST_PIECE = 32
"""Smallest number of samples of a piece without a gap."""

FALLS = 0.05
"""Largest fall of a drum speed, by the highest one, that counts as rising."""

Signals = Callable[[FloatArray], FloatArray]
"""Function of signals without gaps (n, k) that returns others (n, k)."""


def in_pieces(signals: FloatArray, change: Signals) -> FloatArray:
    """Return signals (n, k) whose pieces without gaps are changed by a function; NaN in gaps."""
    changed = np.full(signals.shape, np.nan)
    # signals with the same gaps go together: filters take several at once
    groups: dict[bytes, list[int]] = {}
    for k, mask in enumerate(np.isfinite(signals).T):
        groups.setdefault(mask.tobytes(), []).append(k)
    for columns in map(np.array, groups.values()):
        valid = np.flatnonzero(np.isfinite(signals[:, columns[0]]))
        for piece in np.split(valid, np.flatnonzero(np.diff(valid) > 1) + 1):
            if len(piece) >= LEAST_PIECE:
                changed[np.ix_(piece, columns)] = change(signals[np.ix_(piece, columns)])
    return changed


def band_passed(signals: FloatArray, run: Record) -> FloatArray:
    """Return signals (n, k) within the pass band of a run."""
    period = sample_period(run)
    band = pass_band(profile_of(run), period)
    return in_pieces(signals, lambda part: filtered(part, period, band))


def envelopes_of(passed: FloatArray, run: Record) -> FloatArray:
    """Return the smooth envelopes (n, k) of signals within the pass band of a run."""
    period = sample_period(run)
    band = pass_band(profile_of(run), period)
    return in_pieces(passed, lambda part: analytic_sizes(part, period, band))


def places_of(runs: Sequence[Record]) -> xr.DataArray:
    """Return the drum speeds at which runs are compared, or times if a profile does not only rise.

    Returns:
        Middles of equal ranges, over `place`, with their quantity. [rad/s or s]
    """
    profiles = [profile_of(run) for run in runs]
    if all(map(_rises, profiles)):
        low = min(min(profile.speed) for profile in profiles)
        high = max(profile.highest_speed for profile in profiles)
        quantity = SPEED
    else:
        low, high = 0.0, max(profile.duration for profile in profiles)
        quantity = TIME
    edges = np.linspace(low, high, PLACES + 1)
    return xr.DataArray(quantity.variable("place", 0.5 * (edges[1:] + edges[:-1])))


def _rises(profile: SpinProfile) -> bool:
    speed = np.asarray(profile.speed)
    return bool(np.all(np.maximum.accumulate(speed) - speed <= FALLS * profile.highest_speed))


def _place_numbers(run: Record, places: xr.DataArray) -> np.ndarray:
    """Return the number of the place of each sample of a run. (n,)"""
    is_speed = quantity_of(places) is SPEED
    values = np.abs(run.drum_speed.values) if is_speed else run.time.values
    middles = places.values
    width = middles[1] - middles[0]
    numbers = np.rint((values - middles[0]) / width).astype(int)
    return np.clip(numbers, 0, len(middles) - 1)


def _numbers_at(time: FloatArray, run: Record, places: xr.DataArray) -> np.ndarray:
    """Return the number of the place of a run at times. (n,)"""
    samples = np.searchsorted(run.time.values, time).clip(0, run.sizes["time"] - 1)
    return np.asarray(_place_numbers(run, places)[samples])


def means_at(values: FloatArray, numbers: np.ndarray, count: int) -> FloatArray:
    """Return the means of signals (..., n, k) at places (..., count, k), NaN where there are none.

    Args:
        numbers: Number of the place of each sample. (n,)
    """
    samples = np.arange(len(numbers))
    belongs = csr_array((np.ones(len(numbers)), (numbers, samples)), (count, len(numbers)))
    columns = np.moveaxis(values, -2, 0)
    flat = columns.reshape(len(numbers), -1)
    valid = np.isfinite(flat)
    totals, sums = belongs @ valid.astype(float), belongs @ np.where(valid, flat, 0.0)
    means = np.where(totals > 0.0, sums / np.maximum(totals, 1.0), np.nan)
    return np.moveaxis(means.reshape(count, *columns.shape[1:]), 0, -2)


def signals_of(pair: Pair, places: xr.DataArray) -> xr.Dataset:
    """Return what is compared of one recording.

    Returns:
        Over `source` (measured, computed), and SI: `amplitude` (place, sensor), means of the
        envelopes; `rms` (region, sensor) of the signals within the pass band; `order_one` (place,
        sensor), size of order 1; `orders` (order, sensor), largest sizes of orders; `integrated`
        (region, sensor), RMS of the signals integrated twice. Without `source`: `phase` (place,
        sensor), by which the prediction lags behind, as a complex number of size 1; `correlation`
        (sensor); `distance` (sensor) of the envelopes, [B] Eq. (2) by the size of the measured one.
    """
    run, period = pair.run, sample_period(pair.run)
    numbers, count = _place_numbers(run, places), places.size
    passed = np.stack([band_passed(signals, run) for signals in pair.both])
    envelopes = np.stack([envelopes_of(signals, run) for signals in passed])
    distance = np.nansum((envelopes[1] - envelopes[0]) ** 2, axis=0)
    regions = speed_ranges(run, profile_of(run))
    masks = [part.samples for part in regions]
    integrated = [
        in_pieces(s, lambda part: integrated_twice(part - part.mean(axis=0), period))
        for s in pair.both
    ]
    twice = np.stack([band_passed(signals, run) for signals in integrated])
    one = order_one(pair)
    turned = one.measured.values * np.conj(one.predicted.values) * np.exp(-1j * one.start.item())
    at = _numbers_at(one.time.values, run, places)
    sizes = np.stack([np.abs(one.measured.values), np.abs(one.predicted.values)])
    phase = means_at(turned.real, at, count) + 1j * means_at(turned.imag, at, count)
    orders = np.stack([_largest_orders(signals, run) for signals in pair.both])
    return xr.Dataset(
        {
            "amplitude": (("source", "place", "sensor"), means_at(envelopes, numbers, count)),
            "rms": (("source", "region", "sensor"), rms_of(passed, masks)),
            "integrated": (("source", "region", "sensor"), rms_of(twice, masks)),
            "order_one": (("source", "place", "sensor"), means_at(sizes, at, count)),
            "orders": (("source", "order", "sensor"), orders),
            "phase": (("place", "sensor"), phase),
            "correlation": one.correlation,
            "distance": ("sensor", np.sqrt(distance / np.nansum(envelopes[0] ** 2, axis=0))),
        },
        {
            "source": ["measured", "computed"],
            "region": [part.name for part in regions],
            "order": list(SHOWN_ORDERS),
            "sensor": one.sensor.values,
        },
    )


def rms_of(signals: FloatArray, masks: Sequence[np.ndarray]) -> FloatArray:
    """Return the RMS of signals (2, n, k) in regions; NaN if less than half is there. (2, r, k)"""
    rows = []
    for mask in masks:
        part = signals[:, mask]
        covered = np.mean(np.isfinite(part), axis=1) if part.shape[1] else np.zeros(1)
        with np.errstate(invalid="ignore", divide="ignore"):
            squares = np.nansum(part**2, axis=1) / np.sum(np.isfinite(part), axis=1)
        rows.append(np.where(covered >= LEAST_COVERED, np.sqrt(squares), np.nan))
    return np.stack(rows, axis=1)


def _largest_orders(signals: FloatArray, run: Record) -> FloatArray:
    """Return the largest sizes of orders of signals. (orders, k)"""
    vectors = order_vectors(signals, run.drum_angle.values, run.time.values, np.array(SHOWN_ORDERS))
    sizes = np.abs(vectors.values)
    if not len(sizes):
        return np.full(sizes.shape[1:], np.nan)
    largest = np.max(np.where(np.isfinite(sizes), sizes, -1.0), axis=0)
    return np.where(largest >= 0.0, largest, np.nan)


def envelope_sizes(signals: FloatArray, run: Record, places: xr.DataArray) -> FloatArray:
    """Return the amplitudes of signals (n, k) at places, means of their envelopes. (places, k)"""
    envelopes = envelopes_of(band_passed(signals, run), run)
    return means_at(envelopes, _place_numbers(run, places), places.size)


def order_one_sizes(signals: FloatArray, run: Record, places: xr.DataArray) -> FloatArray:
    """Return the sizes of order 1 of signals (n, k) at places. (places, k)"""
    angle, time = run.drum_angle.values, run.time.values
    vectors = order_vectors(signals, angle, time, np.array([1.0])).isel(order=0)
    at = _numbers_at(vectors.time.values, run, places)
    return means_at(np.abs(vectors.values), at, places.size)


def repeats_of(pairs: Sequence[Pair], places: xr.DataArray) -> xr.Dataset:
    """Return what is compared of all recordings, over `repeat`; see `signals_of`."""
    each = [signals_of(pair, places) for pair in pairs]
    joined = xr.concat(each, "repeat", join="outer", coords="minimal", compat="override")
    return joined.assign_coords(
        place=places.variable, repeat=[pair.recording.path.name for pair in pairs]
    )
