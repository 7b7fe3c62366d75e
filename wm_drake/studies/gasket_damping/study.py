"""Damping of the gasket from measured displacements, [B] section 3.1.2: which C_L and C_T bring the envelopes nearest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.batch import RunResult, simulate_many
from wm_drake.errors import input_error
from wm_drake.model.machine import OUTPUT_PERIOD, Machine, build_machine
from wm_drake.parameters import (
    GASKET_FACTORS,
    MachineParameters,
    SpinProfile,
    load_factors,
    with_values,
)
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import envelopes
from wm_drake.simulation.records import Record
from wm_drake.simulation.runs import simulate
from wm_drake.studies.gasket_damping.grid_search import Search, bounded_search, grid_search

UNKNOWNS = ("C_L", "C_T")

LOWER = np.array([0.0, 0.0])
UPPER = np.array([50.0, 0.2 * 180.0 / np.pi])
"""Region of [B]: C_L to 0.05 N s/mm, C_T to 200 N mm s/deg. [N s/m, N m s/rad]"""

STOP = 0.02
"""Gain of the objective below which the search ends ([B] section 3.1.2). [mm]"""

WINDOW = (10.0, 50.0)
"""Part of the run that is compared ([B] section 3.1.2). [s]"""

AFTER = 5.0
"""Runs go on for so long after the window, where the filter settles. [s]"""

LOADS = ("middle", "counter")

NOISE = 1e-4
"""Standard deviation of the noise of a virtual experiment, at each sample of each sensor. [m] An assumption."""

MM_PER_M = 1e3

Measured: TypeAlias = Mapping[str, xr.DataArray]
"""By load: displacement (time, sensor) every 5 ms. [m]"""


@dataclass(frozen=True)
class Damping:
    """What came of it.

    Attributes:
        grid, scipy: The optimum by grid search and by a bounded optimiser of scipy: C_L, C_T. [N s/m, N m s/rad]
        truth: The same of a virtual experiment; None if the records were measured.
        at_best: By load, the computed record at the optimum of the grid search.
        measured: The records that were compared with.
    """

    grid: Search
    scipy: Search
    truth: FloatArray | None
    at_best: dict[str, Record]
    measured: Measured


def identify_damping(
    parameters: MachineParameters, measured: Measured, truth: FloatArray | None = None
) -> Damping:
    """Finds C_L and C_T.

    Args:
        parameters: The machine; loads are those of `measured`.
        measured: Displacements of its sensors.
        truth: Where `measured` comes from `virtual_experiment`, the damping planted there.
    """
    objective = EnvelopeDistance(parameters, measured)
    grid = grid_search(objective, LOWER, UPPER, STOP)
    scipy = bounded_search(objective, LOWER, UPPER, STOP)
    at_best = {case.name: simulate(objective.machine, case) for case in objective.cases(grid.best)}
    return Damping(grid, scipy, truth, at_best, measured)


def virtual_experiment(
    parameters: MachineParameters, truth: FloatArray, seed: int
) -> dict[str, xr.DataArray]:
    """Records as an experiment would give them: run by the Drake engine with another damping, and noise added."""
    rng = np.random.default_rng(seed)
    planted = with_damping(parameters, truth)
    machine = build_machine(planted)
    records = {}
    for load in LOADS:
        case = Case(load, planted.loads[load], _run_up(planted.profile))
        displacement = simulate(machine, case, "drake").displacement
        records[load] = displacement + rng.normal(scale=NOISE, size=displacement.shape)
    return records


def with_damping(parameters: MachineParameters, damping: FloatArray) -> MachineParameters:
    """The machine with C_L and C_T on every axis of its gasket. [N s/m, N m s/rad]"""
    factors = load_factors(GASKET_FACTORS)
    numbers = zip(UNKNOWNS, damping, strict=True)
    return with_values(
        parameters, {key: float(value) for name, value in numbers for key in factors[name].keys}
    )


class EnvelopeDistance:
    """Eq. (2), (3) of [B]: sum over the loads of the 2-norm of the differences of the envelopes. [mm]

    Upper and lower envelope of every sensor, every 5 ms within the window.
    """

    def __init__(self, parameters: MachineParameters, measured: Measured) -> None:
        """For a machine and the records that it shall meet."""
        if parameters.gasket is None:
            raise input_error(f"machine '{parameters.name}' has no gasket", key="gasket")
        self.parameters, self.measured = parameters, measured
        self.machine: Machine = build_machine(parameters)
        self.profile = _run_up(parameters.profile)
        self._targets = {load: _envelopes(displacement) for load, displacement in measured.items()}

    def cases(self, damping: FloatArray) -> list[Case]:
        """A run for each load."""
        changed = with_damping(self.parameters, damping)
        return [
            Case(load, changed.loads[load], self.profile, parameters=changed)
            for load in self.measured
        ]

    def __call__(self, points: Sequence[FloatArray]) -> list[float]:
        """Values at several (C_L, C_T); infinite where a run diverges."""
        values = np.zeros(len(points))
        cases = [case for damping in points for case in self.cases(damping)]

        def add(run: RunResult) -> None:
            good = run.record is not None and not run.diverged
            values[run.number // len(self.measured)] += (
                self._distance(run.case.name, run.record) if good else np.inf
            )

        simulate_many(self.machine, cases, measures=("extremes",), histories=True, finished=add)
        return [float(value) for value in values]

    def _distance(self, load: str, record: Record | None) -> float:
        assert record is not None  # histories were asked for
        return MM_PER_M * float(
            np.linalg.norm(_envelopes(record.displacement) - self._targets[load])
        )


def _envelopes(displacement: xr.DataArray) -> FloatArray:
    """Both envelopes within the window, one after the other. [m]"""
    both = envelopes(xr.Dataset({"displacement": displacement}))
    shown = both.sel(time=slice(WINDOW[0] - 1e-9, WINDOW[1] + 1e-9))
    return np.stack([shown.upper.values, shown.lower.values])


def _run_up(profile: SpinProfile) -> SpinProfile:
    """The profile as far as it is needed."""
    end = WINDOW[1] + AFTER
    if profile.duration < WINDOW[1]:
        raise input_error(
            f"ends at {profile.duration:g} s; records are compared from {WINDOW[0]:g} to {WINDOW[1]:g} s",
            key="profile",
        )
    if profile.duration <= end:
        return profile
    time = [t for t in profile.time if t < end]
    return SpinProfile(
        time=(*time, end), speed=(*profile.speed[: len(time)], float(profile.speed_at(end)))
    )


def as_measured(table: xr.DataArray, sensors: list[str], where: str) -> xr.DataArray:
    """A record put on the sampling of ours, its sensors in our order.

    Raises:
        InputError: a sensor is missing, a value is not finite, or the window is not covered.
    """
    missing = [name for name in sensors if name not in table.sensor.values]
    if missing:
        raise input_error(f"has no sensor {', '.join(missing)}", where=where)
    time = table.time.values
    if len(time) < 2 or time[0] > WINDOW[0] or time[-1] < WINDOW[1]:
        raise input_error(f"must cover {WINDOW[0]:g} to {WINDOW[1]:g} s", where=where)
    if not np.all(np.diff(time) > 0.0):
        raise input_error("times must rise from row to row", where=where)
    values = table.sel(sensor=sensors).values
    if not np.isfinite(values).all():
        raise input_error("a displacement is not a finite number", where=where)
    grid = (
        np.arange(
            np.ceil(time[0] / OUTPUT_PERIOD - 1e-6), np.floor(time[-1] / OUTPUT_PERIOD + 1e-6) + 1
        )
        * OUTPUT_PERIOD
    )
    columns = [np.interp(grid, time, column) for column in values.T]
    return xr.DataArray(
        np.stack(columns, axis=1), {"time": grid, "sensor": sensors}, ["time", "sensor"]
    )
