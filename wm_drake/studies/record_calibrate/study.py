"""Fit numbers of a machine to what its sensors recorded.

The data are amplitudes of the signals as they were recorded, and the model predicts these signals.
Each amplitude is divided by its standard deviation: that of the mean of the repeats, and at least
that of the gain of a sensor. Clocks are those of the comparison at the start of the search: an
amplitude over the drum speed hardly depends on them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.mount_forces import speed_ranges
from wm_drake.simulation.records import Record, profile_of
from wm_drake.studies.compare.pairs import Pair, predicted_signals
from wm_drake.studies.compare.study import (
    LEAST_TOLERANCE,
    SINGLE_TOLERANCE,
    band_passed,
    envelope_sizes,
    order_one_sizes,
    places_of,
    rms_of,
)
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import FitProblem, Measurement, Progress
from wm_drake.studies.spin_identify.study import Sought, at_point

EDGE = 2.0
"""Time at both ends of a recording that is left out: filters have not settled there. [s]"""

SENSOR_SD = 0.015
"""Deviation of all amplitudes of a sensor, by gain and tilt: an assumption.

A gain is known to about 1 %; a tilt of 2 degrees mixes in up to 3.5 % of another axis.
"""

JACOBIAN_STEP = 1e-3
"""Step of finite differences, by the value."""

Z = 1.96
"""Half width of a 95 % interval, in standard deviations."""

MISFIT = Quantity("misfit in standard deviations", decimals=2)

RunRecords = Callable[[Sequence[Case]], Sequence[Record]]
"""Function that runs cases and returns their records."""


@dataclass(frozen=True, eq=False)
class RecordModel:
    """Amplitudes of the sensors of recordings as a function of the unknowns.

    Attributes:
        parameters: The machine at the start.
        case: The test.
        pairs: Recordings at the start of the search.
        sensors, points: Sensors by name, and their positions in T. [m]
        sought: The unknowns.
        by: What is fitted: envelope, order or rms.
        run: Runs cases.
    """

    parameters: MachineParameters
    case: Case
    pairs: tuple[Pair, ...]
    sensors: Mapping[str, RecordedSensor]
    points: Mapping[str, FloatArray]
    sought: tuple[Sought, ...]
    by: str
    run: RunRecords

    def measured(self) -> FloatArray:
        """Return the amplitudes of the recordings (repeat, place, sensor). [SI]"""
        return np.stack([self._amplitudes(pair, slice(0, 1)) for pair in self.pairs])

    def computed(self, machines: Sequence[MachineParameters]) -> FloatArray:
        """Return the amplitudes that machines predict (machine, place, sensor). [SI]"""
        profiles = [profile_of(pair.run) for pair in self.pairs]
        same = all(profile == profiles[0] for profile in profiles)
        used = self.pairs[:1] if same else self.pairs
        cases = [
            replace(
                self.case,
                name=f"{m} {k}",
                load=load_of(self.case, self.parameters, one),
                profile=profile_of(pair.run),
                parameters=one,
            )
            for m, one in enumerate(machines)
            for k, pair in enumerate(used)
        ]
        records = self.run(cases)
        rows: list[FloatArray | None] = []
        for m in range(len(machines)):
            runs = records[m * len(used) : (m + 1) * len(used)]
            if any(run.attrs["diverged"] for run in runs):
                rows.append(None)
                continue
            predicted = [predicted_signals(run, self.sensors, self.points) for run in runs]
            each = [
                self._amplitudes(
                    replace(pair, predicted=predicted[k if len(used) > 1 else 0]), slice(1, 2)
                )
                for k, pair in enumerate(self.pairs)
            ]
            rows.append(mean_of(np.stack(each)))
        failed = np.full((len(self.labels()), len(self.sensors)), np.nan)
        return np.stack([failed if row is None else row for row in rows])

    def _amplitudes(self, pair: Pair, side: slice) -> FloatArray:
        """Return measured or predicted amplitudes of a recording. (place, sensor) [SI]

        Args:
            side: The first one, measured, or the second one.
        """
        places = places_of([one.run for one in self.pairs])
        if self.by == "order":
            return order_one_sizes(pair, places)[side][0]
        passed = band_passed(pair, side)
        if self.by == "envelope":
            return envelope_sizes(passed, pair.run, places)[0]
        masks = [part.samples for part in speed_ranges(pair.run, profile_of(pair.run))]
        return rms_of(passed, masks)[0]

    def labels(self) -> list[str]:
        """Return the names of the places."""
        if self.by == "rms":
            run = self.pairs[0].run
            return [part.name for part in speed_ranges(run, profile_of(run))]
        places = places_of([one.run for one in self.pairs])
        quantity: Quantity = places.attrs["quantity"]
        return [quantity.text(value) for value in places.values]


def without_edges(pair: Pair) -> Pair:
    """Return a recording without its first and last two seconds."""
    time = pair.run.time.values
    known = np.isfinite(pair.measured)
    inside = np.flatnonzero(known.any(axis=1))
    if not len(inside):
        return pair
    begin, end = time[inside[0]] + EDGE, time[inside[-1]] - EDGE
    kept = (time >= begin) & (time <= end)
    return replace(pair, measured=np.where(kept[:, None], pair.measured, np.nan))


def mean_of(values: FloatArray) -> FloatArray:
    """Return the mean over the first axis of those that are finite; NaN where none is."""
    valid = np.isfinite(values)
    count = valid.sum(axis=0)
    sums = np.where(valid, values, 0.0).sum(axis=0)
    return np.where(count > 0, sums / np.maximum(count, 1), np.nan)


def deviations_of(measured: FloatArray) -> FloatArray:
    """Return the standard deviations of the means of repeats (place, sensor). [SI]

    Args:
        measured: (repeat, place, sensor) [SI]
    """
    mean, count = mean_of(measured), len(measured)
    scatter = 0.5 * SINGLE_TOLERANCE * mean
    if count > 1:
        scatter = np.sqrt(mean_of((measured - mean) ** 2) / (count - 1.0))
    least = LEAST_TOLERANCE * np.nanmax(mean, axis=0)
    return np.asarray(np.hypot(scatter, least))


def calibrated(
    model: RecordModel,
    seed: int,
    progress: Progress = lambda fraction, least: None,
) -> tuple[Fit, xr.Dataset]:
    """Fit the unknowns of a model to its recordings.

    Args:
        progress: Called with the fraction done and the least misfit so far.

    Returns:
        The fit; and over place and sensor, in SI: `measured`, mean of the repeats, its `deviation`,
        `before` and `after` the search, and the residual `misfit` after it, in deviations. Over
        sensor: `error_before` and `error_after`, RMS of the difference by that of the amplitudes.

    Raises:
        InputError: no sensor has an amplitude.
    """
    measured = model.measured()
    mean, deviation = mean_of(measured), deviations_of(measured)
    start = np.array([one.guess for one in model.sought])
    before = model.computed([at_point(model.parameters, model.sought, start)])[0]
    valid = np.isfinite(mean) & np.isfinite(before) & (deviation > 0.0)
    names = list(model.sensors)
    used = [k for k in range(len(names)) if valid[:, k].any()]
    if not used:
        raise input_error("no sensor has an amplitude to fit; the records are too short")
    tests = tuple(
        Measurement(
            names[k], mean[valid[:, k], k] / deviation[valid[:, k], k], correlated=model.by != "rms"
        )
        for k in used
    )

    def evaluate(points: FloatArray) -> FloatArray:
        values = model.computed([at_point(model.parameters, model.sought, p) for p in points])
        scaled = values / np.where(valid, deviation, 1.0)
        return np.concatenate([scaled[:, valid[:, k], k] for k in used], axis=1)

    problem = FitProblem(tuple(one.unknown for one in model.sought), tests, evaluate)
    fit = identify(problem, seed=seed, starts=2, screened=8, progress=progress)
    fit = with_sensor_errors(fit, problem)
    after = model.computed([at_point(model.parameters, model.sought, fit.values)])[0]
    dims = ("place", "sensor")
    masked = np.where(valid, 1.0, np.nan)
    data = {
        "measured": (dims, mean * masked),
        "deviation": (dims, deviation * masked),
        "before": (dims, before * masked),
        "after": (dims, after * masked),
        "misfit": MISFIT.variable(dims, (after - mean) / deviation * masked),
    }
    for name, values in {"before": before, "after": after}.items():
        missed = np.nansum((masked * (values - mean)) ** 2, axis=0)
        size = np.nansum((masked * mean) ** 2, axis=0)
        data[f"error_{name}"] = ("sensor", np.sqrt(missed / np.where(size > 0.0, size, np.nan)))
    return fit, xr.Dataset(data, {"place": model.labels(), "sensor": names})


def with_sensor_errors(fit: Fit, problem: FitProblem) -> Fit:
    """Return a fit whose intervals include errors of whole sensors, which no residual shows.

    A sensor that shows all amplitudes larger by a part e changes the estimates by
    e (J' J)^-1 J_s' y_s, with the Jacobian J and the data y_s of the sensor. Its deviation is
    `SENSOR_SD`, independent of that of other sensors.
    """
    values = fit.values
    steps = JACOBIAN_STEP * np.maximum(np.abs(values), 1e-9)
    computed = problem.evaluate(np.vstack([values, values + np.diag(steps)]))
    jacobian = (computed[1:] - computed[0]).T / steps
    if not np.isfinite(jacobian).all():
        return fit
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    turns = [
        inverse @ jacobian[part].T @ test.values
        for part, test in zip(problem.slices, problem.measurements, strict=True)
    ]
    added = SENSOR_SD**2 * np.einsum("si,sj->ij", turns, turns)
    widened = []
    for k, estimate in enumerate(fit.estimates):
        lower, upper = (
            estimate.value + sign * np.hypot(end - estimate.value, Z * np.sqrt(added[k, k]))
            for sign, end in ((-1.0, estimate.lower), (1.0, estimate.upper))
        )
        widened.append(replace(estimate, lower=float(lower), upper=float(upper)))
    return replace(fit, estimates=tuple(widened), covariance=fit.covariance + added)


def calibrated_machine(
    parameters: MachineParameters, sought: Sequence[Sought], fit: Fit, files: str
) -> MachineParameters:
    """Return the machine with the values found and their source; undetermined ones stay.

    Args:
        files: Names of the records.
    """
    values: dict[str, float] = {}
    sources: dict[str, str] = {}
    for one, estimate in zip(sought, fit.estimates, strict=True):
        if not estimate.determined:
            continue
        text = f"calibrated to {files}"
        if estimate.at_bound:
            text += f"; at the {estimate.at_bound} bound of the search"
        elif np.isfinite(estimate.lower):
            unit = one.unknown.unit
            low, high = (unit.reading(value, 4) for value in (estimate.lower, estimate.upper))
            text += f"; 95 % interval {low} to {high}"
        values |= dict.fromkeys(one.keys, estimate.value)
        sources |= dict.fromkeys(one.keys, text)
    changed = with_values(parameters, values)
    return changed.model_copy(
        update={
            "name": f"{parameters.name}_calibrated",
            "sources": {**changed.sources, **sources},
        }
    )
