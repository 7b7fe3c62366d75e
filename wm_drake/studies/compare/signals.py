"""A recorded machine beside its model: envelopes, orders, RMS by region, and their differences.

Measured and predicted signals pass the same filters, with the same gaps. Nothing measured is
corrected: the prediction has gravity, the axes of the sensors, and what the recorder does.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.sparse import csr_array
from scipy.stats import t as student

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit
from wm_drake.report.quantity import SPEED, TIME, Quantity
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.displacements import analytic_sizes, filtered, peak_line
from wm_drake.simulation.mount_forces import speed_ranges
from wm_drake.simulation.orders import order_vectors
from wm_drake.simulation.records import Record, profile_of, sample_period
from wm_drake.simulation.vibration import integrated_twice, relative_error
from wm_drake.studies.compare.pairs import OFFSET, PHASE, QUANTITIES, Pair, order_one
from wm_drake.studies.orders.study import ORDER, SHOWN_ORDERS

PLACES = 80
"""Number of drum speeds, or of times of a profile that does not only rise, that are compared."""

LEAST_TOLERANCE = 0.01
"""Smallest difference that counts, by the largest amplitude of the sensor.

An assumption: the gain of an accelerometer is known to about 1 %.
"""

SINGLE_TOLERANCE = 0.05
"""Smallest difference that counts, by the measured amplitude, without repeats: an assumption."""

CONFIDENCE = 0.95
"""Share of further repeats of the test that lie within the scatter."""

LEAST_COVERED = 0.5
"""Smallest part of a region that a recording must have."""

LEAST_PIECE = 32
"""Smallest number of samples of a piece without a gap."""

FALLS = 0.05
"""Largest fall of a drum speed, by the highest one, that counts as rising."""

DIFFERENCE = Quantity("difference", Share(), 1)
ERROR = Quantity("error, [A] Eq. (9)", Share(), 2)
DISTANCE = Quantity("distance, [B] Eq. (2)", Share(), 1)
OFFSET_SD = Quantity("±", Unit("s", "ms"), 2)
RATE = Quantity("clock slow by", Unit("", "ppm"), 0)
INTEGRATED = Quantity("RMS displacement by integration", Unit("m", "mm"), 3)

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


def envelopes_of(signals: FloatArray, time: FloatArray) -> FloatArray:
    """Return the upper and the lower envelope of signals (n, k): lines from peak to peak. (2, n, k)

    Args:
        time: Evenly spaced (n,). [s]
    """
    step = float(time[1] - time[0])

    def upper(part: FloatArray) -> FloatArray:
        at = np.asarray(step * np.arange(len(part), dtype=float))
        return np.stack([peak_line(at, np.ascontiguousarray(signal)) for signal in part.T], axis=1)

    def lower(part: FloatArray) -> FloatArray:
        return -upper(-part)

    return np.stack([in_pieces(signals, upper), in_pieces(signals, lower)])


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
    is_speed = places.attrs["quantity"] is SPEED
    values = np.abs(run.drum_speed.values) if is_speed else run.time.values
    middles = places.values
    width = middles[1] - middles[0]
    numbers = np.rint((values - middles[0]) / width).astype(int)
    return np.clip(numbers, 0, len(middles) - 1)


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
        Over `source` (measured, computed), and SI: `envelope` (place, sensor, side), means of the
        envelopes within the pass band; `rms` (region, sensor) of the signals within the band;
        `order_one` (place, sensor), size of order 1; `orders` (order, sensor), largest sizes of
        orders; `integrated` (region, sensor), RMS of the signals integrated twice. Without
        `source`: `phase` (place, sensor), by which the prediction lags behind, as a complex number
        of size 1; `correlation` (sensor); `distance` (sensor), [B] Eq. (2) by the size of the
        measured envelopes.
    """
    run, period = pair.run, sample_period(pair.run)
    time, count = run.time.values, places.size
    passed = np.stack([band_passed(signals, run) for signals in pair.both])
    envelopes = np.stack([envelopes_of(signals, time) for signals in passed])  # source, side
    numbers = _place_numbers(run, places)
    at_places = means_at(envelopes, numbers, count)
    ranges = speed_ranges(run, profile_of(run))
    masks = [part.samples for part in ranges]
    integrated = [
        in_pieces(s, lambda part: integrated_twice(part - part.mean(axis=0), period))
        for s in pair.both
    ]
    twice = np.stack([band_passed(signals, run) for signals in integrated])
    one = order_one(pair)
    turned = one.measured.values * np.conj(one.predicted.values) * np.exp(-1j * one.start.item())
    window = np.searchsorted(time, one.time.values).clip(0, len(time) - 1)
    at_window = numbers[window]
    sizes = np.stack([np.abs(one.measured.values), np.abs(one.predicted.values)])
    phase = means_at(turned.real, at_window, count) + 1j * means_at(turned.imag, at_window, count)
    difference = np.sum((envelopes[1] - envelopes[0]) ** 2, axis=0)
    size = np.sum(envelopes[0] ** 2, axis=0)
    orders = np.stack([_largest_orders(signals, run) for signals in pair.both])
    dims = "source", "side", "place", "sensor"
    return xr.Dataset(
        {
            "envelope": (dims, at_places),
            "rms": (("source", "region", "sensor"), rms_of(passed, masks)),
            "integrated": (("source", "region", "sensor"), rms_of(twice, masks)),
            "order_one": (("source", "place", "sensor"), means_at(sizes, at_window, count)),
            "orders": (("source", "order", "sensor"), orders),
            "phase": (("place", "sensor"), phase),
            "correlation": one.correlation,
            "distance": ("sensor", np.sqrt(np.nansum(difference, 0) / np.nansum(size, 0))),
        },
        {
            "source": ["measured", "computed"],
            "side": ["upper", "lower"],
            "region": [part.name for part in ranges],
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
    """Return the amplitudes of signals (n, k) at places, those of their smooth envelopes.

    They are smooth functions of all parameters, and noise hardly changes them. (places, k)
    """
    period = sample_period(run)
    band = pass_band(profile_of(run), period)
    sizes = in_pieces(
        signals, lambda part: analytic_sizes(filtered(part, period, band), period, band)
    )
    return means_at(sizes, _place_numbers(run, places), places.size)


def order_one_sizes(signals: FloatArray, run: Record, places: xr.DataArray) -> FloatArray:
    """Return the sizes of order 1 of signals (n, k) at places. (places, k)"""
    angle, time = run.drum_angle.values, run.time.values
    vectors = order_vectors(signals, angle, time, np.array([1.0])).isel(order=0)
    window = np.searchsorted(time, vectors.time.values).clip(0, len(time) - 1)
    return means_at(np.abs(vectors.values), _place_numbers(run, places)[window], places.size)


def repeats_of(pairs: Sequence[Pair], places: xr.DataArray) -> xr.Dataset:
    """Return what is compared of all recordings, over `repeat`; see `signals_of`."""
    each = [signals_of(pair, places) for pair in pairs]
    joined = xr.concat(each, "repeat", join="outer", coords="minimal", compat="override")
    return joined.assign_coords(
        place=places.variable, repeat=[pair.recording.path.name for pair in pairs]
    )


def amplitudes_of(
    repeats: xr.Dataset, sensors: Mapping[str, RecordedSensor], quantity: str
) -> xr.Dataset:
    """Return measured and computed amplitudes of the sensors of a quantity.

    An amplitude is half the distance between the envelopes.

    Returns:
        Over place and sensor: `measured`, mean of the repeats; `computed`; `tolerance`, half of the
        range in which a further repeat lies; `difference`, computed less measured by the largest
        measured amplitude of the sensor; whether it `agrees`. Over place, sensor and side:
        `envelope_least` and `envelope_most` of the repeats, `envelope_computed`.
    """
    names = [name for name, sensor in sensors.items() if sensor.quantity == quantity]
    envelope = repeats.envelope.sel(sensor=names)
    sizes = 0.5 * (envelope.sel(side="upper") - envelope.sel(side="lower"))
    measured = sizes.sel(source="measured", drop=True)
    mean, computed = measured.mean("repeat"), sizes.sel(source="computed", drop=True).mean("repeat")
    largest = mean.max("place")
    tolerance = np.maximum(_scatter(measured), LEAST_TOLERANCE * largest)
    difference = computed - mean
    unit = QUANTITIES[quantity]
    shown: dict[str, Any] = {
        "measured": unit.named("measured amplitude"),
        "computed": unit.named("computed amplitude"),
        "tolerance": unit.named("tolerance ±"),
    }
    values = {"measured": mean, "computed": computed, "tolerance": tolerance}
    data = {
        name: quantity_.variable(("place", "sensor"), values[name].transpose("place", "sensor"))
        for name, quantity_ in shown.items()
    }
    sides = ("place", "sensor", "side")
    of_computed = envelope.sel(source="computed", drop=True).mean("repeat")
    of_measured = envelope.sel(source="measured", drop=True)
    for name, values_ in {
        "least": of_measured.min("repeat"),
        "most": of_measured.max("repeat"),
        "computed": of_computed,
    }.items():
        words = f"{name} of the envelopes"
        data[f"envelope_{name}"] = unit.named(words).variable(sides, values_.transpose(*sides))
    share = (difference / largest).transpose("place", "sensor")
    data["difference"] = DIFFERENCE.named("difference by the largest amplitude").variable(
        ("place", "sensor"), share
    )
    agrees = (np.abs(difference) <= tolerance).where(difference.notnull(), False)
    data["agrees"] = xr.Variable(("place", "sensor"), agrees.transpose("place", "sensor"))
    coords = {"place": repeats.place.variable, "sensor": names, "side": ["upper", "lower"]}
    return xr.Dataset(data, coords)


def _scatter(measured: xr.DataArray) -> xr.DataArray:
    """Return half of the range in which a further repeat lies, of those that reach a place."""
    mean, count = measured.mean("repeat"), measured.notnull().sum("repeat")
    several = count > 1
    safe = count.where(several, 2)
    factor = student.ppf(0.5 + 0.5 * CONFIDENCE, safe - 1) * np.sqrt(1.0 + 1.0 / safe)
    deviation = np.sqrt(((measured - mean) ** 2).sum("repeat") / (safe - 1))
    return (factor * deviation).where(several, SINGLE_TOLERANCE * mean)


def sensors_of(repeats: xr.Dataset, amplitudes: xr.Dataset, quantity: str) -> xr.Dataset:
    """Return how each sensor of a quantity agrees.

    Args:
        amplitudes: As of `amplitudes_of`.

    Returns:
        Over sensor: largest `measured` and `computed` amplitudes and the `place` of the measured
        one; their `difference`, [B] Eq. (1); `distance`, [B] Eq. (2) by the size of the measured
        envelopes; `correlation` of order 1; `within`, share of places that agree.
    """
    unit, names = QUANTITIES[quantity], amplitudes.sensor.values.tolist()
    measured, computed = amplitudes.measured.max("place"), amplitudes.computed.max("place")
    at = amplitudes.measured.fillna(-1.0).argmax("place")
    known = amplitudes.measured.notnull()
    within = (amplitudes.agrees & known).sum("place") / known.sum("place")
    place: Quantity = repeats.place.attrs["quantity"]
    means = repeats[["distance", "correlation"]].sel(sensor=names).mean("repeat")
    numbers = {
        "measured": (unit.named("largest, measured"), measured),
        "computed": (unit.named("computed"), computed),
        "difference": (DIFFERENCE, computed / measured - 1.0),
        "at": (place.named("measured at"), repeats.place.values[at.values]),
        "distance": (DISTANCE, means.distance),
        "correlation": (Quantity("correlation of order 1", decimals=3), means.correlation),
        "within": (Quantity("within tolerance", Share(), 0), within),
    }
    return xr.Dataset(
        {name: unit_.variable("sensor", values) for name, (unit_, values) in numbers.items()},
        {"sensor": names},
    )


def regions_of(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> xr.Dataset:
    """Return the RMS of sensors of a quantity in the regions of the profile, and its errors.

    Returns:
        Over region and sensor: `measured`, mean of the repeats, and `computed` RMS within the pass
        band. Over region: `error`, [A] Eq. (9), with norms over the sensors.
    """
    rms = repeats.rms.sel(sensor=list(names)).mean("repeat")
    measured, computed = (
        rms.sel(source=source, drop=True).transpose("region", "sensor")
        for source in rms.source.values
    )
    unit = QUANTITIES[quantity]
    return xr.Dataset(
        {
            "measured": unit.named("measured").variable(("region", "sensor"), measured),
            "computed": unit.named("computed").variable(("region", "sensor"), computed),
            "error": ERROR.variable("region", relative_error(computed.values, measured.values)),
        },
        {"region": rms.region.values, "sensor": list(names)},
    )


def integrated_of(
    repeats: xr.Dataset, sensors: Mapping[str, RecordedSensor], pairs: Sequence[Pair]
) -> xr.Dataset:
    """Return the RMS displacements of accelerometers by integration: a view, no correction.

    Gravity along an axis that tilts is integrated too, in the prediction as in the measurement.

    Returns:
        Over region and sensor: `measured` and `computed`. Over sensor: `deviation`, the RMS that
        the noise of the sensor alone would have,

            s^2 = S (f1^-3 - f2^-3) / (3 (2 pi)^4),   S = 2 noise^2 / sampling rate

        in the pass band f1 to f2: the power of noise grows with 1/f^4.
    """
    names = [name for name, sensor in sensors.items() if sensor.quantity == "acceleration"]
    rms = repeats.integrated.sel(sensor=names).mean("repeat")
    first = pairs[0]
    low, high = pass_band(profile_of(first.run), sample_period(first.run))
    step = float(np.median(np.diff(first.recording.channels.time)))
    noise = np.array([sensors[name].noise for name in names])
    power = 2.0 * noise**2 * step
    deviation = np.sqrt(power * (low**-3 - high**-3) / (3.0 * (2.0 * np.pi) ** 4))
    data = {
        source: INTEGRATED.named(str(source)).variable(
            ("region", "sensor"), rms.sel(source=source).transpose("region", "sensor")
        )
        for source in rms.source.values
    }
    data["deviation"] = INTEGRATED.named("of the noise alone").variable("sensor", deviation)
    return xr.Dataset(data, {"region": rms.region.values, "sensor": names})


def orders_of(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> xr.Dataset:
    """Return the largest sizes of orders over order and sensor: `measured` and `computed`."""
    sizes = repeats.orders.sel(sensor=list(names)).mean("repeat")
    unit = QUANTITIES[quantity]
    dims = ("order", "sensor")
    data = {
        source: unit.named(str(source)).variable(dims, sizes.sel(source=source).transpose(*dims))
        for source in sizes.source.values
    }
    return xr.Dataset(data, {"order": ORDER.variable("order", sizes.order), "sensor": list(names)})


def order_one_of(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> xr.Dataset:
    """Return order 1 over place and sensor: `measured`, `computed`, and how much later it comes.

    `phase` is the lag of the prediction behind the measurement; the angle of the drum at the start,
    the same for all sensors, is taken out. [rad]
    """
    sizes = repeats.order_one.sel(sensor=list(names)).mean("repeat")
    dims, unit = ("place", "sensor"), QUANTITIES[quantity]
    data = {
        source: unit.named(f"{source}, order 1").variable(
            dims, sizes.sel(source=source).transpose(*dims)
        )
        for source in sizes.source.values
    }
    phase = repeats.phase.sel(sensor=list(names)).mean("repeat").transpose(*dims)
    data["phase"] = PHASE.variable(dims, np.angle(phase))
    return xr.Dataset(data, {"place": repeats.place.variable, "sensor": list(names)})


def clocks_of(pairs: Sequence[Pair]) -> xr.Dataset:
    """Return the clock of each recording: source, offset, rate, and what the phases are worth."""
    clocks = [pair.alignment for pair in pairs]
    highest = max(profile_of(pair.run).highest_speed for pair in pairs)
    numbers = {
        "offset": (OFFSET, [clock.offset for clock in clocks]),
        "offset_deviation": (OFFSET_SD, [clock.offset_sd for clock in clocks]),
        "rate": (RATE, [clock.rate for clock in clocks]),
        "rate_deviation": (RATE.named("±"), [clock.rate_sd for clock in clocks]),
        "phase_deviation": (
            PHASE.named("phase at the highest speed ±"),
            [highest * clock.offset_sd for clock in clocks],
        ),
        "samples": (
            Quantity("samples", decimals=0),
            [len(pair.recording.channels.time) for pair in pairs],
        ),
    }
    return xr.Dataset(
        {"by": ("record", [SOURCES[clock.source] for clock in clocks])}
        | {name: unit.variable("record", values) for name, (unit, values) in numbers.items()},
        {"record": [pair.recording.path.name for pair in pairs]},
    )


SOURCES = {
    "speed": "recorded drum speed",
    "pulses": "pulses of the tacho",
    "signals": "spectra and order 1",
    "start": "the speed itself",
}
"""What aligned a clock, in words."""


def agreement_of(amplitudes: Sequence[xr.Dataset], place: xr.DataArray) -> xr.Dataset:
    """Return the longest range of places in which all sensors agree, and what differs elsewhere.

    A single place that differs between places that agree, two on each side, counts as agreeing.

    Args:
        amplitudes: As of `amplitudes_of`, of each quantity.

    Returns:
        `from_place` and `to_place`, NaN if there is no range of `LEAST_RANGE` of the places;
        `first_place` and `last_place` of all. Of the largest difference outside of the range, by
        the largest amplitude of its sensor: the `sensor`, `at`, the `difference` by the amplitude
        measured there, and whether that is a maximum over the places (`is_peak`); NaN and "" if
        all agree. Amplitudes below `LEAST_SHOWN` of the largest one of the sensor are left out.
    """
    agrees, known, difference, measured, computed = (
        np.hstack([values.values for values in part])
        for part in zip(
            *(
                (a.agrees, a.measured.notnull(), a.difference, a.measured, a.computed)
                for a in amplitudes
            ),
            strict=True,
        )
    )
    names = [name for a in amplitudes for name in a.sensor.values.tolist()]
    rows = np.flatnonzero(known.any(axis=1))
    begin, end = _longest(np.all(agrees | ~known, axis=1)[rows])
    has_range = end - begin >= LEAST_RANGE * len(rows)
    inside = rows[begin:end] if has_range else rows[:0]
    is_large = measured >= LEAST_SHOWN * np.nanmax(measured, axis=0)
    outside = np.where(known & ~agrees & is_large, np.abs(difference), -1.0)
    outside[inside] = -1.0
    at, k = np.unravel_index(np.argmax(outside), outside.shape)
    differs = bool(outside[at, k] > 0.0)
    near = measured[max(0, at - 2) : at + 3, k]
    quantity: Quantity = place.attrs["quantity"]
    values = place.values
    places = {
        "from_place": values[inside[0]] if has_range else np.nan,
        "to_place": values[inside[-1]] if has_range else np.nan,
        "first_place": values[rows[0]],
        "last_place": values[rows[-1]],
        "at": values[at] if differs else np.nan,
    }
    part = computed[at, k] / measured[at, k] - 1.0 if differs else np.nan
    is_peak = differs and bool(measured[at, k] == np.nanmax(near)) and 0 < at < len(measured) - 1
    return xr.Dataset(
        {name: quantity.variable((), value) for name, value in places.items()}
        | {
            "difference": DIFFERENCE.variable((), part),
            "sensor": ((), names[k] if differs else ""),
            "is_peak": ((), is_peak),
        }
    )


def _longest(agrees: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the longest row of places that agree, single others among them."""
    padded = np.concatenate([[False] * 2, agrees, [False] * 2])
    filled = padded.copy()
    filled[2:-2] |= padded[:-4] & padded[1:-3] & padded[3:-1] & padded[4:]
    changes = np.flatnonzero(np.diff(filled[1:-1].astype(int)))
    if not len(changes):
        return 0, 0
    begins, ends = changes[::2], changes[1::2]
    best = int(np.argmax(ends - begins))
    return int(begins[best]), int(ends[best])


LEAST_SHOWN = 0.1
"""Smallest amplitude, by the largest one of the sensor, whose difference is named in percent."""

LEAST_RANGE = 0.1
"""Smallest part of the places that is called a range in which all sensors agree."""
