"""Identification of the gasket damping C_L and C_T from measured envelopes, [B] section 3.1.2."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.batch import RunResult, simulate_many
from wm_drake.errors import input_error
from wm_drake.model.build import build_machine
from wm_drake.model.machine import OUTPUT_PERIOD, Machine
from wm_drake.parameters import (
    GASKET_FACTORS,
    MachineParameters,
    SpinProfile,
    load_factors,
    with_values,
)
from wm_drake.parameters.time_stamps import with_distinct_times
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import smooth_envelope
from wm_drake.simulation.records import Record
from wm_drake.simulation.runs import simulate
from wm_drake.studies.gasket_damping.grid_search import Search, bounded_search, grid_search
from wm_drake.studies.gasket_damping.uncertainty import (
    Interval,
    curves_of,
    difference_points,
    jackknife_interval,
)

UNKNOWNS = ("C_L", "C_T")

LOWER = np.array([0.0, 0.0])
UPPER = np.array([50.0, 0.2 * 180.0 / np.pi])
"""Upper bounds of [B]: 0.05 N s/mm for C_L and 200 N mm s/deg for C_T. [N s/m, N m s/rad]"""

STOP = 0.02
"""Gain of the objective below which the bounded search ends ([B] section 3.1.2). [mm]"""

MESH = 1e-3
"""Default spacing of the finest grid, as a part of the region."""

AGREEMENT = 0.01
"""Largest difference of the two optima in each unknown, as a part of the region, if they agree."""

WINDOW = (10.0, 50.0)
"""Time interval that is compared ([B] section 3.1.2). [s]"""

AFTER = 5.0
"""Time that runs continue after the window, so that end effects of the filter stay outside. [s]"""

LOADS = ("middle", "counter")

NOISE = 1e-4
"""Standard deviation of the noise at each sample of a virtual experiment; an assumption. [m]"""

MM_PER_M = 1e3

Measured: TypeAlias = Mapping[str, xr.DataArray]
"""Displacements (time, sensor), sampled every 5 ms, by load. [m]"""


@dataclass(frozen=True)
class Damping:
    """Result of an identification of C_L and C_T.

    Attributes:
        grid: Optimum of the grid search. [N s/m, N m s/rad]
        scipy: Optimum of the bounded search of scipy. [N s/m, N m s/rad]
        truth: True values of a virtual experiment; None for a measurement. [N s/m, N m s/rad]
        at_best: Computed record at the better optimum, by load.
        measured: The measured displacements.
        interval: Confidence interval of the better of the two optima; None if there are too few
            curves. [N s/m, N m s/rad]
    """

    grid: Search
    scipy: Search
    truth: FloatArray | None
    at_best: dict[str, Record]
    measured: Measured
    interval: Interval | None = None

    @property
    def better(self) -> Search:
        """The search that found the smaller distance; the grid search if both found the same."""
        return min((self.grid, self.scipy), key=lambda search: search.value)

    @property
    def searches_agree(self) -> bool:
        """Whether the optima of both searches differ by at most `AGREEMENT`."""
        difference = np.abs(self.grid.best - self.scipy.best) / (UPPER - LOWER)
        return bool(np.all(difference <= AGREEMENT))


def identify_damping(
    parameters: MachineParameters,
    measured: Measured,
    truth: FloatArray | None = None,
    mesh: float = MESH,
) -> Damping:
    """Identify C_L and C_T from measured displacements.

    Args:
        parameters: The machine.
        measured: Displacements of its sensors, by load.
        truth: True values if `measured` is from `virtual_experiment`. [N s/m, N m s/rad]
        mesh: Spacing at which the grid search ends, as a part of the region.

    Raises:
        InputError: the machine has no gasket, or its profile ends before the window.
    """
    objective = EnvelopeDistance(parameters, measured)
    grid = grid_search(objective, LOWER, UPPER, mesh)
    scipy = bounded_search(objective, LOWER, UPPER, STOP)
    found = Damping(grid, scipy, truth, {}, measured)
    best = found.better.best
    at_best = {case.name: simulate(objective.machine, case) for case in objective.cases(best)}
    return replace(found, at_best=at_best, interval=objective.interval(best))


def virtual_experiment(
    parameters: MachineParameters, truth: FloatArray, seed: int
) -> dict[str, xr.DataArray]:
    """Simulate an experiment and return its displacements (time, sensor), by load. [m]

    The Drake engine runs the machine with the true damping, and noise is added.

    Args:
        parameters: The machine.
        truth: True values of C_L and C_T. [N s/m, N m s/rad]
        seed: Seed of the noise.
    """
    rng = np.random.default_rng(seed)
    true_parameters = with_damping(parameters, truth)
    machine = build_machine(true_parameters)
    records = {}
    for load in LOADS:
        case = Case(load, true_parameters.loads[load], _run_up(true_parameters.profile))
        displacement = simulate(machine, case, "drake").displacement
        records[load] = displacement + rng.normal(scale=NOISE, size=displacement.shape)
    return records


def with_damping(parameters: MachineParameters, damping: FloatArray) -> MachineParameters:
    """Return the machine with C_L and C_T on every axis of its gasket. [N s/m, N m s/rad]"""
    factors = load_factors(GASKET_FACTORS)
    numbers = zip(UNKNOWNS, damping, strict=True)
    return with_values(
        parameters, {key: float(value) for name, value in numbers for key in factors[name].keys}
    )


class EnvelopeDistance:
    """Objective [B] Eq. (2), (3): sum over the loads of the 2-norm of envelope differences. [mm]

    The norm includes the upper and lower envelopes of all sensors at all samples in the window.
    They are those of the analytic signal (`smooth_envelope`).
    """

    def __init__(self, parameters: MachineParameters, measured: Measured) -> None:
        """Build the machine and compute the measured envelopes.

        Args:
            parameters: The machine.
            measured: Displacements of its sensors, by load.

        Raises:
            InputError: the machine has no gasket, or its profile ends before the window.
        """
        if parameters.gasket is None:
            raise input_error(
                f"machine '{parameters.name}' has no gasket; this study needs one", key="gasket"
            )
        self.parameters, self.measured = parameters, measured
        self.machine: Machine = build_machine(parameters)
        self.profile = _run_up(parameters.profile)
        self._targets = {load: _envelopes(displacement) for load, displacement in measured.items()}

    def cases(self, damping: FloatArray) -> list[Case]:
        """Return one case for each load, with a damping C_L, C_T. [N s/m, N m s/rad]"""
        changed = with_damping(self.parameters, damping)
        return [
            Case(load, changed.loads[load], self.profile, parameters=changed)
            for load in self.measured
        ]

    def __call__(self, points: Sequence[FloatArray]) -> list[float]:
        """Return the values at several points (C_L, C_T); infinite where a run diverges. [mm]"""
        values = np.zeros(len(points))

        def add(point: int, load: str, record: Record | None) -> None:
            values[point] += np.inf if record is None else self._distance(load, record)

        self._run(points, add)
        return [float(value) for value in values]

    def interval(self, best: FloatArray) -> Interval | None:
        """Return the confidence interval of an optimum (C_L, C_T). [N s/m, N m s/rad]

        It is None if there are too few curves, or if a run diverges.
        """
        points = difference_points(best, LOWER, UPPER)
        found: list[dict[str, FloatArray]] = [{} for _ in points]

        def add(point: int, load: str, record: Record | None) -> None:
            if record is not None:
                found[point][load] = self._curves(load, record)

        self._run(points, add)
        if any(len(differences) < len(self.measured) for differences in found):
            return None
        loads = list(self.measured)  # threads end in any order
        ordered = [{load: differences[load] for load in loads} for differences in found]
        return jackknife_interval(best, LOWER, UPPER, curves_of(ordered, points, UPPER - LOWER))

    def _run(
        self, points: Sequence[FloatArray], add: Callable[[int, str, Record | None], None]
    ) -> None:
        """Run all loads at several points and pass each record, or None if the run diverged."""
        cases = [case for damping in points for case in self.cases(damping)]

        def pass_on(run: RunResult) -> None:
            record = None if run.diverged else run.record
            add(run.number // len(self.measured), run.case.name, record)

        simulate_many(self.machine, cases, measures=("extremes",), histories=True, finished=pass_on)

    def _curves(self, load: str, record: Record) -> FloatArray:
        """Return the differences (sensor, n) of both envelopes in the window. [mm]"""
        differences = _envelopes(record.displacement) - self._targets[load]
        return MM_PER_M * np.moveaxis(differences, 2, 0).reshape(differences.shape[2], -1)

    def _distance(self, load: str, record: Record) -> float:
        return float(np.linalg.norm(self._curves(load, record)))


def _envelopes(displacement: xr.DataArray) -> FloatArray:
    """Return the upper and lower smooth envelopes (2, time, sensor) in the window. [m]"""
    whole = smooth_envelope(xr.Dataset({"displacement": displacement}))
    upper = whole.sel(time=slice(WINDOW[0] - 1e-9, WINDOW[1] + 1e-9)).values
    return np.stack([upper, -upper])


def _run_up(profile: SpinProfile) -> SpinProfile:
    """Return the profile, cut after the window and the time that the filter needs.

    Raises:
        InputError: the profile ends before the window does.
    """
    end = WINDOW[1] + AFTER
    if profile.duration < WINDOW[1]:
        raise input_error(
            f"ends at {profile.duration:g} s; it must last at least {WINDOW[1]:g} s, because "
            f"records are compared from {WINDOW[0]:g} to {WINDOW[1]:g} s",
            key="profile",
        )
    if profile.duration <= end:
        return profile
    time = [t for t in profile.time if t < end]
    return SpinProfile(
        time=(*time, end), speed=(*profile.speed[: len(time)], float(profile.speed_at(end)))
    )


def as_measured(table: xr.DataArray, sensors: list[str], where: str) -> xr.DataArray:
    """Return a measured record with the sensors of the machine, interpolated to samples every 5 ms.

    Args:
        table: Measured displacements (time, sensor). [m]
        sensors: Names of the sensors, in the order of the machine.
        where: Name of the file, for messages.

    Raises:
        InputError: a sensor is missing, a value is not finite, times do not rise, or the record
            does not cover the window.
    """
    missing = [name for name in sensors if name not in table.sensor.values]
    if missing:
        raise input_error(
            f"has no sensor {', '.join(missing)}; needs {', '.join(sensors)}", where=where
        )
    samples = np.column_stack([table.time.values, table.sel(sensor=sensors).values])
    samples = with_distinct_times(samples, where)
    time, values = samples[:, 0], samples[:, 1:]
    if len(time) < 2 or time[0] > WINDOW[0] or time[-1] < WINDOW[1]:
        raise input_error(f"must cover {WINDOW[0]:g} to {WINDOW[1]:g} s", where=where)
    if not np.all(np.diff(time) > 0.0):
        raise input_error("times must not fall from row to row", where=where)
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
