"""Targets of a calibration: measured amplitudes and other responses."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import InputError, Problem, check_known, input_error, nearest_names
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.measured import EXPERIMENT, NamedValue
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity
from wm_drake.studies.calibrate.response_targets import ResponseTarget, response_targets_of

MEASURED = Quantity("amplitude", Unit("m", "mm"), 1)

AMPLITUDE = "amplitudes"
"""Name of all amplitudes, for limits."""

GASKET = ("no", "yes")
"""Labels of a case without and with gasket."""


@dataclass(frozen=True)
class Targets:
    """Measured amplitudes and other responses that a calibration fits.

    Attributes:
        loads: For each measured case, name of the load and whether the machine has its gasket.
        sensors: Names of the sensors.
        amplitude: (case, sensor) measured amplitudes. [m]
        weight: (case, sensor) weights of the squared log ratios; 0 for values that are not used.
        responses: Targets that are no amplitudes of sensors.
        limits: Largest accepted relative differences, by names as in `limited`.
    """

    loads: tuple[tuple[str, bool], ...]
    sensors: tuple[str, ...]
    amplitude: FloatArray
    weight: FloatArray
    responses: tuple[ResponseTarget, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of values that are used."""
        used = sum(target.weight > 0.0 for target in self.responses)
        return int(np.count_nonzero(self.weight)) + used

    @property
    def names(self) -> list[tuple[str, ...]]:
        """Names by which limits and weights are given, from one value to many, of each value.

        Amplitudes come first, then the other responses.
        """
        amplitudes = [
            (f"{load}:{sensor}", sensor, load, AMPLITUDE)
            for load, _ in self.loads
            for sensor in self.sensors
        ]
        return [*amplitudes, *(target.names for target in self.responses)]

    @property
    def response_weight(self) -> FloatArray:
        """Weights of the other responses. (response)"""
        return np.array([target.weight for target in self.responses])

    def errors(self, amplitude: FloatArray) -> FloatArray:
        """Return (computed - measured) / measured (case, sensor); NaN where the weight is 0."""
        return np.where(self.weight > 0.0, amplitude / self.amplitude - 1.0, np.nan)

    def response_errors(self, responses: FloatArray) -> FloatArray:
        """Return (computed - target) / target (response); NaN where the weight is 0."""
        errors = [t.errors(responses[..., k]) for k, t in enumerate(self.responses)]
        return np.where(self._used, _stacked(errors, responses), np.nan)

    def residuals(
        self, amplitude: FloatArray, responses: FloatArray, spread: FloatArray
    ) -> FloatArray:
        """Return the weighted logarithms of the ratios of computed to wanted values.

        Linear responses, which may be 0 or below, enter with their differences.

        Args:
            amplitude: (..., case, sensor) computed amplitudes. [m]
            responses: (..., response) computed responses. [unit for reading]
            spread: (case, sensor) standard deviations of the logarithms of the amplitudes.

        Returns:
            (..., n) residuals of the values that are used, in standard deviations.
        """
        weights = np.concatenate([self.weight[self.weight > 0.0], self.response_weight[self._used]])
        return self._misfits(amplitude, responses) * np.sqrt(weights) / self._deviations(spread)

    def excesses(
        self, amplitude: FloatArray, responses: FloatArray, spread: FloatArray
    ) -> FloatArray:
        """Return how far logarithms lie beyond their limits, in standard deviations.

        Arguments as in `residuals`.

        Returns:
            (..., k) excesses of the used values that have a limit; 0 within the limits.
        """
        limit = self.limit_of_each()
        limited = np.isfinite(limit)
        misfits, limit = self._misfits(amplitude, responses)[..., limited], limit[limited]
        responses = np.array([target.is_linear for target in self.responses], dtype=bool)
        amplitudes = np.zeros(np.count_nonzero(self.weight > 0.0), dtype=bool)
        is_linear = np.concatenate([amplitudes, responses[self._used]])[limited]
        with np.errstate(divide="ignore"):  # no value is 100 % too small
            above = np.where(is_linear, limit, np.log1p(limit))
            below = np.where(is_linear, -limit, np.log1p(-np.minimum(limit, 1.0)))
        beyond = np.maximum(misfits - above, 0.0) + np.minimum(misfits - below, 0.0)
        return np.asarray(beyond / self._deviations(spread)[limited])

    @property
    def _used(self) -> np.ndarray:
        """Whether each of the other responses is used. (response)"""
        return self.response_weight > 0.0

    def _misfits(self, amplitude: FloatArray, responses: FloatArray) -> FloatArray:
        """Return the logarithms of the ratios of amplitudes, then `ResponseTarget.misfits`."""
        ratios = (amplitude / self.amplitude)[..., self.weight > 0.0]
        misfits = [t.misfits(responses[..., k]) for k, t in enumerate(self.responses)]
        others = _stacked(misfits, responses)[..., self._used]
        return np.concatenate([np.log(ratios), others], axis=-1)

    def _deviations(self, spread: FloatArray) -> FloatArray:
        """Return the standard deviations of the logarithms of the values that are used. (n)"""
        others = np.array([target.deviation for target in self.responses])
        return np.concatenate([spread[self.weight > 0.0], others[self._used]])

    def limit_of_each(self) -> FloatArray:
        """Return the limits of the values that are used, infinite where there is none. (n)

        Of several limits that fit a value, the one that fits the fewest counts.
        """
        limit = np.array(
            [
                next((self.limits[name] for name in fitting if name in self.limits), np.inf)
                for fitting in self.names
            ]
        )
        return limit[np.concatenate([self.weight.ravel() > 0.0, self._used])]

    def of(self, *loads: str) -> np.ndarray:
        """Return for each case whether its load is one of these. (case)"""
        return np.array([name in loads for name, _ in self.loads])

    def without(self, *loads: str) -> "Targets":
        """Return the targets of the other loads."""
        kept = ~self.of(*loads)
        return replace(
            self,
            loads=tuple(case for case in self.loads if case[0] not in loads),
            amplitude=self.amplitude[kept],
            weight=self.weight[kept],
            responses=tuple(target for target in self.responses if target.load not in loads),
        )

    def limited(self, limits: Mapping[str, float]) -> "Targets":
        """Return the targets with limits of the relative differences.

        A calibration gives values beyond their limits a much higher cost.

        Args:
            limits: Limits by name: `AMPLITUDE` for all amplitudes, or a name as in `weighted`. They
                are fractions of the wanted value.

        Raises:
            InputError: a name is none of these, or a limit is not above 0.
        """
        known = {name for names in self.names for name in names}
        for name, limit in limits.items():
            message = f"'{name}' is no load, sensor, response or LOAD:NAME"
            check_known(name, known, message, key="limit")
            if not 0.0 < limit < np.inf:
                raise input_error(
                    f"{limit:g} is not allowed; must be > 0 and finite", key=f"limit of '{name}'"
                )
        return replace(self, limits=dict(limits))

    def weighted(self, weights: Mapping[str, float]) -> "Targets":
        """Return the targets with weights multiplied by factors.

        Args:
            weights: Factors by name: of a load (``middle``), of a sensor or response (``Xf``,
                ``Fx``), of both (``middle:Xf``), or of a kind of response (``force``).

        Raises:
            InputError: a name is none of these, or a factor is below 0.
        """
        known = {name for names in self.names for name in names} - {AMPLITUDE}
        for key, factor in weights.items():
            if not 0.0 <= factor < np.inf:
                raise input_error(
                    f"{factor:g} is not allowed; must be >= 0 and finite", key=f"weight of '{key}'"
                )
            if key not in known:
                hint = nearest_names(key, [name for name in known if ":" not in name])
                message = f"'{key}' is no load, sensor, response or LOAD:SENSOR{hint}"
                raise input_error(message, key="weight")
        factors = [
            float(np.prod([weights[name] for name in names if name in weights]))
            for names in self.names
        ]
        of_amplitudes = np.reshape(factors[: self.weight.size], self.weight.shape)
        pairs = zip(self.responses, factors[self.weight.size :], strict=True)
        responses = tuple(replace(t, weight=t.weight * factor) for t, factor in pairs)
        return replace(self, weight=self.weight * of_amplitudes, responses=responses)

    def gasket_effects(self, amplitude: FloatArray) -> dict[str, FloatArray]:
        """Return the relative change of amplitudes that the gasket causes.

        Args:
            amplitude: (case, sensor) amplitudes. [m]

        Returns:
            For each load with cases without and with gasket: (sensor) change as a fraction of the
            amplitude without gasket.
        """
        row = {case: index for index, case in enumerate(self.loads)}
        return {
            name: amplitude[row[name, True]] / amplitude[row[name, False]] - 1.0
            for name, gasket in self.loads
            if not gasket and (name, True) in row
        }

    def labelled(self, by_source: Mapping[str, FloatArray], quantity: Quantity) -> xr.DataArray:
        """Return values (case, sensor) of sources over load, gasket (no, yes), source and sensor.

        They are NaN for what was not measured.
        """
        loads = list(dict.fromkeys(load for load, _ in self.loads))
        labels = {
            "load": loads,
            "gasket": list(GASKET),
            "source": list(by_source),
            "sensor": list(self.sensors),
        }
        values = np.full([len(of_dim) for of_dim in labels.values()], np.nan)
        for case, (load, gasket) in enumerate(self.loads):
            values[loads.index(load), int(gasket)] = [of[case] for of in by_source.values()]
        return xr.DataArray(quantity.variable(list(labels), values), labels)


def case_title(load: str, gasket: bool) -> str:
    """Return a measured case in words."""
    return f"{load} ({'with' if gasket else 'without'} gasket)"


def _stacked(columns: list[FloatArray], like: FloatArray) -> FloatArray:
    """Return columns (...) as an array (..., column), which may be empty."""
    return np.stack(columns, axis=-1) if columns else np.empty((*like.shape[:-1], 0))


def targets_of(
    parameters: MachineParameters,
    table: pd.DataFrame,
    where: str = "",
    responses: Iterable[NamedValue] = (),
) -> Targets:
    """Return the targets in a table of measured amplitudes, and those that are no amplitudes.

    Args:
        table: Table from `measured_amplitudes`, in mm. Only rows of source "experiment" are used.
        where: Names of the files, for messages.
        responses: Values from `measured_responses`, of any source.

    Raises:
        InputError: the machine does not have a load or a response, a case occurs twice, a value is
            not above 0, or there is no row of the experiment.
    """
    rows = table[table["source"] == EXPERIMENT]
    sensors = tuple(parameters.sensors)
    loads = [
        (str(name), bool(gasket == "yes"))
        for name, gasket in zip(rows["load"], rows["gasket"], strict=True)
    ]
    known = parameters.loads
    messages = [
        f"no load '{name}' in the machine{nearest_names(name, known)}"
        for name, _ in loads
        if name not in known
    ]
    messages += [
        f"load '{name}' occurs twice with the same gasket; each case may occur once"
        for name, gasket in set(loads)
        if loads.count((name, gasket)) > 1
    ]
    amplitude = rows[list(sensors)].to_numpy(dtype=float)
    if not loads:
        messages.append(f"has no row of source '{EXPERIMENT}'; at least one is needed")
    elif not (amplitude > 0.0).all():
        messages.append(
            "an amplitude is not above 0; the logarithm of its ratio to the computed one must exist"
        )
    if messages:
        raise InputError(Problem(where, "", message) for message in messages)
    return Targets(
        tuple(loads),
        sensors,
        MEASURED.unit.to_si(amplitude),
        np.ones(amplitude.shape),
        response_targets_of(parameters, responses),
    )
