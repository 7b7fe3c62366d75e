"""Measured amplitudes -> what a calibration aims at; points of a search -> amplitudes."""

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
    """Measured amplitudes.

    Attributes:
        loads: Name of the load and whether the gasket is in, for each measured case.
        amplitude: (case, sensor) as measured. [m]
        weight: (case, sensor) of the squared log ratio; 0 leaves it out.
    """

    loads: tuple[tuple[str, bool], ...]
    sensors: tuple[str, ...]
    amplitude: FloatArray
    weight: FloatArray

    def of(self, *loads: str) -> np.ndarray:
        """Which cases are of these loads. (case)"""
        return np.array([name in loads for name, _ in self.loads])

    def without(self, *loads: str) -> "Targets":
        """The same, with weight on the other loads only."""
        return replace(self, weight=np.where(self.of(*loads)[:, None], 0.0, self.weight))

    def weighted(self, weights: Mapping[str, float]) -> "Targets":
        """The same with weights multiplied: by load (``middle``), by sensor (``Xf``), or both (``middle:Xf``).

        Raises:
            InputError: a name that is none of these, or a weight below 0.
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
            if not factor >= 0.0:
                raise input_error(f"{factor:g} is below 0", key=f"weight of '{key}'")
            weight[np.ix_(loads, sensors)] *= factor
        return replace(self, weight=weight)

    def gasket_effects(self, amplitude: FloatArray) -> dict[str, FloatArray]:
        """What putting in the gasket does to amplitudes (case, sensor): change as part of the amplitude without. (sensor)

        Of each load that was measured without and with it.
        """
        place = {case: index for index, case in enumerate(self.loads)}
        return {
            name: amplitude[place[name, True]] / amplitude[place[name, False]] - 1.0
            for name, gasket in self.loads
            if not gasket and (name, True) in place
        }


def targets_of(parameters: MachineParameters, table: pd.DataFrame, where: str = "") -> Targets:
    """Targets from a table of measured amplitudes [mm], as `measured_amplitudes` gives it; rows of source "experiment" count.

    Raises:
        InputError: a load the machine does not have, a case measured twice, an amplitude that is not above 0, no row at all.
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
        Problem(where, "", f"load '{n}' is there twice with the same gasket")
        for n, g in set(loads)
        if loads.count((n, g)) > 1
    ]
    amplitude = rows[list(sensors)].to_numpy(dtype=float)
    if not loads:
        problems.append(Problem(where, "", f"has no row of source '{EXPERIMENT}'"))
    elif not (amplitude > 0.0).all():
        problems.append(
            Problem(
                where,
                "",
                "an amplitude is not above 0: its ratio to the computed one has no logarithm",
            )
        )
    if problems:
        raise InputError(problems)
    return Targets(
        tuple(loads), sensors, amplitude / MILLIMETRE.from_si(1.0), np.ones(amplitude.shape)
    )


EXPERIMENT = "experiment"
"""Source of the rows that are measured; others, of other models, are for comparison only."""


def amplitudes_at(
    machine: Machine,
    turning: ParameterMap,
    loads: Sequence[tuple[str, bool]],
    points: FloatArray,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> FloatArray:
    """Amplitudes and their smooth stand-ins at points (point, quantity); NaN where there is no machine, or its run diverged.

    Returns:
        (2, point, case, sensor): amplitudes, then power means (`wm_drake.simulation.measures.power_means`). [m]
    """
    made = _machines(machine, turning, points)
    cases = (
        Case(name, parameters.loads[name], parameters.profile, gasket, parameters=parameters)
        for parameters in made.values()
        for name, gasket in loads
    )
    table = simulate_many(
        machine, cases, measures=("amplitudes", "power means"), workers=workers, progress=progress
    )
    result = np.full((2, len(points), len(loads), len(machine.parameters.sensors)), np.nan)
    ended = (table.diverged == "").values[:, None]
    for kind, values in enumerate((table.amplitude.values, table.power_mean.values)):
        result[kind, list(made)] = np.where(ended, values, np.nan).reshape(
            len(made), *result.shape[2:]
        )
    return result


def preload_residuals(machine: Machine, turning: ParameterMap, points: FloatArray) -> FloatArray:
    """(preload - expected) / deviation at points (point, spring); no springs if nothing is expected, NaN without a machine."""
    if turning.preload is None:
        return np.empty((len(points), 0))
    expected, deviation = turning.preload
    result = np.full((len(points), len(machine.springs)), np.nan)
    for index, setup in _set_up(machine, turning, points):
        result[index] = [
            (spring.preload - expected) / deviation for spring in setup.springs.values()
        ]
    return result


def _machines(
    machine: Machine, turning: ParameterMap, points: FloatArray
) -> dict[int, MachineParameters]:
    """The machines at points, by number of the point; without those that cannot be or cannot stand."""
    return {index: setup.parameters for index, setup in _set_up(machine, turning, points)}


def _set_up(
    machine: Machine, turning: ParameterMap, points: FloatArray
) -> Iterator[tuple[int, Setup]]:
    """Set-ups at points, one after the other in the same Context; without those that cannot be or cannot stand."""
    context = None
    for index, point in enumerate(points):
        try:
            setup = machine.set_up(parameters=turning.parameters_at(point), context=context)
        except InputError:
            continue
        context = setup.context
        yield index, setup
