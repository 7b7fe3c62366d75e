"""A recorded machine beside its model: amplitudes, orders, RMS by region, and their differences."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from scipy.stats import t as student

from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.units import Share, Unit
from wm_drake.report.quantity import Quantity, quantity_of
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.records import profile_of, sample_period
from wm_drake.simulation.vibration import relative_error
from wm_drake.studies.compare.pairs import OFFSET, PHASE, QUANTITIES, Pair
from wm_drake.studies.orders.study import ORDER

LEAST_TOLERANCE = 0.01
"""Smallest difference that counts, by the largest amplitude of the sensor.

An assumption: the gain of an accelerometer is known to about 1 %.
"""

SINGLE_TOLERANCE = 0.05
"""Smallest difference that counts, by the measured amplitude, without repeats: an assumption."""

CONFIDENCE = 0.95
"""Share of further repeats of the test that lie within the scatter."""

DIFFERENCE = Quantity("difference", Share(), 1)
ERROR = Quantity("error, [A] Eq. (9)", Share(), 2)
DISTANCE = Quantity("distance, [B] Eq. (2)", Share(), 1)
OFFSET_SD = Quantity("±", Unit("s", "ms"), 2)
RATE = Quantity("clock slow by", Unit("", "ppm"), 0)
INTEGRATED = Quantity("RMS displacement by integration", Unit("m", "mm"), 3)


def amplitudes_of(
    repeats: xr.Dataset, sensors: Mapping[str, RecordedSensor], quantity: str
) -> xr.Dataset:
    """Return measured and computed amplitudes of the sensors of a quantity.

    Returns:
        Over place and sensor: `measured`, mean of the repeats, with `measured_least` and
        `measured_most` of them; `computed`; `tolerance`, half of the range in which a further
        repeat lies; `difference`, computed less measured by the largest measured amplitude of the
        sensor; whether it `agrees`.
    """
    dims, unit = ("place", "sensor"), QUANTITIES[quantity]
    names = [name for name, sensor in sensors.items() if sensor.quantity == quantity]
    sizes = repeats.amplitude.sel(sensor=names).transpose("repeat", "source", *dims)
    each = sizes.sel(source="measured", drop=True)
    measured, computed = each.mean("repeat"), sizes.sel(source="computed", drop=True).mean("repeat")
    largest = measured.max("place")
    tolerance = np.maximum(_scatter(each), LEAST_TOLERANCE * largest)
    difference = computed - measured
    agrees = (np.abs(difference) <= tolerance).where(difference.notnull(), False)
    share = DIFFERENCE.named("difference by the largest amplitude")
    return xr.Dataset(
        {
            "measured": unit.named("measured amplitude").variable(dims, measured),
            "measured_least": unit.named("least of the repeats").variable(dims, each.min("repeat")),
            "measured_most": unit.named("most of the repeats").variable(dims, each.max("repeat")),
            "computed": unit.named("computed amplitude").variable(dims, computed),
            "tolerance": unit.named("tolerance ±").variable(dims, tolerance),
            "difference": share.variable(dims, difference / largest),
            "agrees": (dims, agrees.data),
        },
        {"place": repeats.place.variable, "sensor": names},
    )


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
    place = quantity_of(repeats.place)
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
    data = _by_source(rms, QUANTITIES[quantity], ("region", "sensor"))
    error = relative_error(data["computed"].values, data["measured"].values)
    return xr.Dataset(
        {**data, "error": ERROR.variable("region", error)},
        {"region": rms.region.values, "sensor": list(names)},
    )


def _by_source(
    values: xr.DataArray, quantity: Quantity, dims: tuple[str, str], more: str = ""
) -> dict[str, xr.Variable]:
    """Return values that were measured and computed.

    Args:
        values: Over `source` and the dimensions of the result.
        more: Words behind those of the source.
    """
    return {
        source: quantity.named(f"{source}{more}").variable(
            dims, values.sel(source=source).transpose(*dims)
        )
        for source in values.source.values.tolist()
    }


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
    data = _by_source(rms, INTEGRATED, ("region", "sensor"))
    data["deviation"] = INTEGRATED.named("of the noise alone").variable("sensor", deviation)
    return xr.Dataset(data, {"region": rms.region.values, "sensor": names})


def orders_of(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> xr.Dataset:
    """Return the largest sizes of orders over order and sensor: `measured` and `computed`."""
    sizes = repeats.orders.sel(sensor=list(names)).mean("repeat")
    data = _by_source(sizes, QUANTITIES[quantity], ("order", "sensor"))
    return xr.Dataset(data, {"order": ORDER.variable("order", sizes.order), "sensor": list(names)})


def order_one_of(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> xr.Dataset:
    """Return order 1 over place and sensor: `measured`, `computed`, and how much later it comes.

    `phase` is the lag of the prediction behind the measurement; the angle of the drum at the start,
    the same for all sensors, is taken out. [rad]
    """
    sizes = repeats.order_one.sel(sensor=list(names)).mean("repeat")
    dims = ("place", "sensor")
    data = _by_source(sizes, QUANTITIES[quantity], dims, ", order 1")
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
