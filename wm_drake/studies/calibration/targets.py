"""Targets of a calibration from measured amplitudes, and the computed amplitudes at points."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.model.machine import Machine, Setup
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibration.parameter_map import ParameterMap

MILLIMETRE = Unit("m", "mm")


@dataclass(frozen=True)
class Targets:
    """Measured amplitudes that a calibration fits.

    Attributes:
        loads: For each measured case, name of the load and whether the machine has its gasket.
        sensors: Names of the sensors.
        amplitude: (case, sensor) measured amplitudes. [m]
        weight: (case, sensor) weights of the squared log ratios; 0 for values that are not used.
    """

    loads: tuple[tuple[str, bool], ...]
    sensors: tuple[str, ...]
    amplitude: FloatArray
    weight: FloatArray

    def of(self, *loads: str) -> np.ndarray:
        """Return for each case whether its load is one of these. (case)"""
        return np.array([name in loads for name, _ in self.loads])

    def without(self, *loads: str) -> "Targets":
        """Return the targets with the weights of these loads set to 0."""
        return replace(self, weight=np.where(self.of(*loads)[:, None], 0.0, self.weight))

    def weighted(self, weights: Mapping[str, float]) -> "Targets":
        """Return the targets with weights multiplied by factors.

        Args:
            weights: Factors by name: of a load (``middle``), of a sensor (``Xf``), or of both
                (``middle:Xf``).

        Raises:
            InputError: a name is none of these, or a factor is below 0.
        """
        weight = self.weight.copy()
        known = [*dict.fromkeys(name for name, _ in self.loads), *self.sensors]
        for key, factor in weights.items():
            load, _, sensor = key.rpartition(":")
            loads = (
                self.of(load or key)
                if load or key not in self.sensors
                else np.ones(len(self.loads), dtype=bool)
            )
            sensors = np.array(
                [name == sensor or (not load and key not in self.sensors) for name in self.sensors]
            )
            if not (loads.any() and sensors.any()):
                raise input_error(
                    f"'{key}' is no load, sensor, or LOAD:SENSOR{nearest_names(key, known)}",
                    key="weight",
                )
            if not 0.0 <= factor < np.inf:
                raise input_error(
                    f"{factor:g} is not allowed; must be >= 0 and finite", key=f"weight of '{key}'"
                )
            weight[np.ix_(loads, sensors)] *= factor
        return replace(self, weight=weight)

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


def targets_of(parameters: MachineParameters, table: pd.DataFrame, where: str = "") -> Targets:
    """Return the targets in a table of measured amplitudes.

    Args:
        parameters: The machine.
        table: Table from `measured_amplitudes`, in mm. Only rows of source "experiment" are used.
        where: Names of the files, for messages.

    Raises:
        InputError: the machine does not have a load, a case occurs twice, an amplitude is not above
            0, or there is no row of the experiment.
    """
    rows = table[table["source"] == EXPERIMENT]
    sensors = tuple(parameters.sensors)
    loads = [
        (str(name), bool(gasket == "yes"))
        for name, gasket in zip(rows["load"], rows["gasket"], strict=True)
    ]
    problems = [
        Problem(
            where, "", f"no load '{name}' in the machine{nearest_names(name, parameters.loads)}"
        )
        for name, _ in loads
        if name not in parameters.loads
    ]
    problems += [
        Problem(
            where, "", f"load '{n}' occurs twice with the same gasket; each case may occur once"
        )
        for n, g in set(loads)
        if loads.count((n, g)) > 1
    ]
    amplitude = rows[list(sensors)].to_numpy(dtype=float)
    if not loads:
        problems.append(
            Problem(where, "", f"has no row of source '{EXPERIMENT}'; at least one is needed")
        )
    elif not (amplitude > 0.0).all():
        problems.append(
            Problem(
                where,
                "",
                "an amplitude is not above 0; the logarithm of its ratio to the computed one must "
                "exist",
            )
        )
    if problems:
        raise InputError(problems)
    return Targets(
        tuple(loads), sensors, amplitude / MILLIMETRE.from_si(1.0), np.ones(amplitude.shape)
    )


EXPERIMENT = "experiment"
"""Source of rows with measured values. Rows with another source are used for comparison only."""


def amplitudes_at(
    machine: Machine,
    parameter_map: ParameterMap,
    loads: Sequence[tuple[str, bool]],
    points: FloatArray,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> FloatArray:
    """Return amplitudes and their smooth substitutes at points.

    Args:
        machine: A built machine.
        parameter_map: Map from points to machines.
        loads: Cases: name of the load and whether the machine has its gasket.
        points: (point, quantity) in SI units.
        workers: Number of threads; None for the number of cores.
        progress: Called with the number of finished runs.

    Returns:
        (2, point, case, sensor): amplitudes, then power means
        (`wm_drake.simulation.measures.power_means`). NaN if no machine exists at a point or its run
        diverged. [m]
    """
    machines = _machines(machine, parameter_map, points)
    cases = (
        Case(name, parameters.loads[name], parameters.profile, gasket, parameters=parameters)
        for parameters in machines.values()
        for name, gasket in loads
    )
    table = simulate_many(
        machine, cases, measures=("amplitudes", "power means"), workers=workers, progress=progress
    )
    result = np.full((2, len(points), len(loads), len(machine.parameters.sensors)), np.nan)
    ended = (table.diverged == "").values[:, None]
    for kind, values in enumerate((table.amplitude.values, table.power_mean.values)):
        result[kind, list(machines)] = np.where(ended, values, np.nan).reshape(
            len(machines), *result.shape[2:]
        )
    return result


def preload_residuals(
    machine: Machine, parameter_map: ParameterMap, points: FloatArray
) -> FloatArray:
    """Return the residuals (preload - expected) / deviation of the springs at points.

    Args:
        machine: A built machine.
        parameter_map: Map from points to machines, with the prior of the preloads.
        points: (point, quantity) in SI units.

    Returns:
        (point, spring); (point, 0) without a prior of the preloads. NaN if no machine exists at a
        point.
    """
    if parameter_map.preload is None:
        return np.empty((len(points), 0))
    expected, deviation = parameter_map.preload
    result = np.full((len(points), len(machine.springs)), np.nan)
    for index, setup in _set_up(machine, parameter_map, points):
        result[index] = [
            (spring.preload - expected) / deviation for spring in setup.springs.values()
        ]
    return result


def _machines(
    machine: Machine, parameter_map: ParameterMap, points: FloatArray
) -> dict[int, MachineParameters]:
    """Return the machines at points, by index of the point.

    Points with values that are not allowed or without static equilibrium are omitted.
    """
    return {index: setup.parameters for index, setup in _set_up(machine, parameter_map, points)}


def _set_up(
    machine: Machine, parameter_map: ParameterMap, points: FloatArray
) -> Iterator[tuple[int, Setup]]:
    """Yield the index of each point and the machine set up there, always in the same Context.

    Points with values that are not allowed or without static equilibrium are omitted.
    """
    context = None
    for index, point in enumerate(points):
        try:
            setup = machine.set_up(parameters=parameter_map.parameters_at(point), context=context)
        except InputError:
            continue
        context = setup.context
        yield index, setup
