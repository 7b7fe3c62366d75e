"""Identification of the gasket damping C_L and C_T from measured envelopes, [B] section 3.1.2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.batch import RunResult, simulate_many
from wm_drake.errors import input_error
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import (
    GASKET_FACTORS,
    MachineParameters,
    SpinProfile,
    load_factors,
    with_values,
)
from wm_drake.parameters.csv_files import with_distinct_times
from wm_drake.parameters.machine import OUTPUT_PERIOD
from wm_drake.parameters.recorded import ChannelUse, read_recording, resampled
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.terminal import say
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import smooth_envelope
from wm_drake.simulation.records import Record, read_measured
from wm_drake.simulation.runs import simulate
from wm_drake.studies.fitting.grid import Round, grid_search, simplex_search
from wm_drake.studies.fitting.jackknife import Interval, jackknife_interval
from wm_drake.studies.fitting.problem import NormProblem, Unknown
from wm_drake.studies.fitting.search import Optimum
from wm_drake.studies.gasket_damping.options import GasketDampingOptions
from wm_drake.studies.inputs import existing_file
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Facts, Result, Task

if TYPE_CHECKING:
    from rich.table import Table

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
LENGTH = Unit("m", "mm")

UNITS = (Unit("N*s/m", "N*s/mm"), Unit("N*m*s/rad", "N*mm*s/deg"))
"""SI units and printed units of C_L and C_T."""

Measured: TypeAlias = Mapping[str, xr.DataArray]
"""Displacements (time, sensor), sampled every 5 ms, by load. [m]"""


@dataclass(frozen=True)
class Damping(Result):
    """Result of an identification of C_L and C_T.

    Attributes:
        parameters: Machine before the search.
        grid: Optimum of the grid search, its point in SI. [N s/m, N m s/rad]
        scipy: Optimum of the bounded search of scipy, its point in SI. [N s/m, N m s/rad]
        rounds: The grids of the grid search.
        truth: True values of a virtual experiment; None for a measurement. [N s/m, N m s/rad]
        at_best: Computed record at the better optimum, by load.
        interval: Confidence interval of the better of the two optima; None if there are too few
            curves. [N s/m, N m s/rad]
    """

    parameters: MachineParameters
    grid: Optimum
    scipy: Optimum
    measured: Measured
    rounds: tuple[Round, ...] = ()
    truth: FloatArray | None = None
    at_best: Mapping[str, Record] = field(default_factory=dict)
    interval: Interval | None = None
    float_format: ClassVar[str] = "%.9g"

    @property
    def better(self) -> Optimum:
        """The search that found the smaller distance; the grid search if both found the same."""
        return min((self.grid, self.scipy), key=lambda search: search.cost)

    @property
    def searches_agree(self) -> bool:
        """Whether the optima of both searches differ by at most `AGREEMENT`."""
        difference = np.abs(self.grid.point - self.scipy.point) / (UPPER - LOWER)
        return bool(np.all(difference <= AGREEMENT))

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return every point of the grid search with its distance."""
        from wm_drake.studies.gasket_damping.page import points_table

        return {"objective": points_table(self)}

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON, in the units of [B]."""

        def plain(search: Optimum) -> dict[str, Any]:
            return {
                **_named(search.point),
                "objective_mm": search.cost,
                "evaluations": search.evaluations,
            }

        interval = self.interval
        ends = [] if interval is None else [_named(interval.low), _named(interval.high)]
        return {
            "units": {"C_L": "N s/mm", "C_T": "N mm s/deg"},
            "virtual_experiment": self.truth is not None,
            "planted": None if self.truth is None else _named(self.truth),
            "best": plain(self.better)
            | {"search": "grid" if self.better is self.grid else "scipy"},
            "searches_agree": self.searches_agree,
            "grid": plain(self.grid)
            | {"rounds": len(self.rounds), "mesh_percent": 100.0 * self.rounds[-1].spacing},
            "scipy": plain(self.scipy),
            "interval_95": {name: [end[name] for end in ends] for name in UNKNOWNS}
            if ends
            else None,
        }

    def terminal(self) -> "list[Table | str]":
        """Return the summary."""
        from wm_drake.studies.gasket_damping.page import summary

        return [summary(self)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        from wm_drake.studies.gasket_damping.page import gasket_damping_page

        return gasket_damping_page(self, facts)


def in_units_of_paper(damping: FloatArray) -> FloatArray:
    """Return C_L and C_T (..., 2) in the units of [B]. [N s/mm, N mm s/deg]"""
    return damping * np.array([unit.from_si(1.0) for unit in UNITS])


def _named(damping: FloatArray) -> dict[str, float]:
    return dict(zip(UNKNOWNS, in_units_of_paper(damping).tolist(), strict=True))


class GasketDampingTask(Task):
    """The study with checked options."""

    def __init__(self, options: GasketDampingOptions, machine: Machine) -> None:
        """Check the machine, and read the records or the true values of the virtual experiment."""
        self.options, self.machine = options, machine
        run_up_of(machine.parameters)
        self.records, self.truth = read_records(machine.parameters, options.record), None
        if not options.record:
            self.truth = planted_damping(
                machine.parameters, options.planted_linear, options.planted_torsional
            )

    def run(self, executor: Executor) -> Damping:  # noqa: ARG002
        """Identify the damping, from the records or from a virtual experiment."""
        records = self.records
        if self.truth is not None:
            say(
                "No measured records were given. The Drake engine runs a virtual experiment with "
                "other damping values and noise.",
                err=True,
            )
            records = virtual_experiment(self.machine.parameters, self.truth, self.options.seed)
        return identify_damping(self.machine, records, self.truth, self.options.mesh / 100.0)


def read_records(parameters: MachineParameters, entries: Sequence[str]) -> dict[str, xr.DataArray]:
    """Return the measured displacements of LOAD=FILE entries, by load. [m]

    Raises:
        InputError: an entry names no load of the machine, or a file is wrong.
    """
    measured, sensors = {}, list(parameters.sensors)
    for entry in entries:
        load, equals, name = (part.strip() for part in entry.partition("="))
        if not equals or load not in parameters.loads:
            raise input_error(
                f"'{entry}' does not have the form LOAD=FILE with a load of the machine "
                f"({', '.join(parameters.loads)})",
                where="--record",
            )
        path = existing_file(Path(name), "--record")
        if path.suffix.lower() != ".nc":
            record = _recorded(path, sensors)
        else:
            needs = {"time": ("time",), "displacement": ("time", "sensor")}
            record = read_measured(path, needs).displacement
        measured[load] = as_measured(record, sensors, name)
    return measured


def _recorded(path: Path, sensors: Sequence[str]) -> xr.DataArray:
    """Return the displacements at sensors in a recorded file (time, sensor). [m]"""
    recording = read_recording(path)
    uses = {name: ChannelUse(recording.chosen(name), LENGTH, LENGTH.shown) for name in sensors}
    channels = recording.synchronous(uses)
    return xr.DataArray(
        np.stack([channels.values[name] for name in sensors], axis=1),
        {"time": channels.time, "sensor": list(sensors)},
        ["time", "sensor"],
    )


def planted_damping(parameters: MachineParameters, linear: str, torsional: str) -> FloatArray:
    """Return C_L and C_T of a virtual experiment, of texts with units. [N s/m, N m s/rad]

    Raises:
        InputError: a unit does not fit, or the machine does not have the loads of the experiment.
    """
    changed = with_values(
        parameters, {"gasket.damping_x": linear, "gasket.rotational_damping_x": torsional}
    )
    assert changed.gasket is not None  # checked before
    for name in LOADS:
        if name not in parameters.loads:
            raise input_error(
                f"machine '{parameters.name}' has no load '{name}', which the virtual experiment "
                "needs",
                key="loads",
            )
    return np.array([changed.gasket.damping_x, changed.gasket.rotational_damping_x])


def identify_damping(
    machine: Machine, measured: Measured, truth: FloatArray | None = None, mesh: float = MESH
) -> Damping:
    """Identify C_L and C_T from measured displacements.

    Args:
        measured: Displacements of its sensors, by load.
        truth: True values if `measured` is from `virtual_experiment`. [N s/m, N m s/rad]
        mesh: Spacing at which the grid search ends, as a part of the region.

    Raises:
        InputError: the machine has no gasket, or its profile ends before the window.
    """
    model = EnvelopeModel(machine, measured)
    problem = damping_problem(model)
    grid, rounds = grid_search(problem, mesh)
    scipy = simplex_search(problem, STOP)
    grid, scipy = (replace(end, point=problem.points_at(end.point)) for end in (grid, scipy))
    result = Damping(machine.parameters, grid, scipy, measured, rounds, truth)
    best = result.better.point
    at_best = {case.name: simulate(machine, case) for case in model.cases(best)}
    return replace(result, at_best=at_best, interval=jackknife_interval(problem, best))


def damping_problem(model: "EnvelopeModel") -> NormProblem:
    """Return the problem of C_L and C_T: the distance [B] Eq. (2), (3) of the envelopes. [mm]

    It is the sum over the loads of the 2-norm of envelope differences. The norm includes the upper
    and lower envelopes of all sensors at all samples in the window.
    """
    unknowns = tuple(
        Unknown(name, float(lower), float(upper), unit)
        for name, lower, upper, unit in zip(UNKNOWNS, LOWER, UPPER, UNITS, strict=True)
    )
    return NormProblem(unknowns, model, tuple(model.curves))


def virtual_experiment(
    parameters: MachineParameters, truth: FloatArray, seed: int
) -> dict[str, xr.DataArray]:
    """Simulate an experiment and return its displacements (time, sensor), by load. [m]

    The Drake engine runs the machine with the true damping, and noise is added.

    Args:
        truth: True values of C_L and C_T. [N s/m, N m s/rad]
    """
    rng = np.random.default_rng(seed)
    true_parameters = with_damping(parameters, truth)
    machine = build_machine(true_parameters)
    records = {}
    for load in LOADS:
        case = Case(load, true_parameters.loads[load], run_up_of(true_parameters))
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


class EnvelopeModel:
    """Differences of computed and measured envelopes as a function of C_L and C_T.

    The envelopes are those of the analytic signal (`smooth_envelope`).

    Attributes:
        profile: Its profile, cut after the window.
        curves: Load and columns of each curve: upper and lower envelope of a sensor with a load.
    """

    def __init__(self, machine: Machine, measured: Measured) -> None:
        """Compute the measured envelopes.

        Raises:
            InputError: the machine has no gasket, or its profile ends before the window.
        """
        self.machine = machine
        self.profile = run_up_of(machine.parameters)
        self._targets = {load: _envelopes(displacement) for load, displacement in measured.items()}
        self.curves, end = list[tuple[str, slice]](), 0
        for load, (sides, samples, sensors) in ((k, v.shape) for k, v in self._targets.items()):
            for _ in range(sensors):
                self.curves.append((load, slice(end, end + sides * samples)))
                end += sides * samples

    def cases(self, damping: FloatArray) -> list[Case]:
        """Return one case for each load, with a damping C_L, C_T. [N s/m, N m s/rad]"""
        changed = with_damping(self.machine.parameters, damping)
        return [
            Case(load, changed.loads[load], self.profile, parameters=changed)
            for load in self._targets
        ]

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the differences (k, n) at points (k, 2); NaN where a run diverges. [mm]"""
        differences = np.full((len(points), self.curves[-1][1].stop), np.nan)
        cases = [case for damping in points for case in self.cases(damping)]

        def keep(run: RunResult) -> None:
            if not run.diverged and run.record is not None:
                point, load = run.number // len(self._targets), run.case.name
                parts = [where for name, where in self.curves if name == load]
                columns = slice(parts[0].start, parts[-1].stop)
                apart = _envelopes(run.record.displacement) - self._targets[load]
                differences[point, columns] = MM_PER_M * np.moveaxis(apart, 2, 0).ravel()

        simulate_many(self.machine, cases, measures=("extremes",), histories=True, finished=keep)
        return differences


def _envelopes(displacement: xr.DataArray) -> FloatArray:
    """Return the upper and lower smooth envelopes (2, time, sensor) in the window. [m]"""
    whole = smooth_envelope(xr.Dataset({"displacement": displacement}))
    upper = whole.sel(time=slice(WINDOW[0] - 1e-9, WINDOW[1] + 1e-9)).values
    return np.stack([upper, -upper])


def run_up_of(parameters: MachineParameters) -> SpinProfile:
    """Return the profile, cut after the window and the time that the filter needs.

    Raises:
        InputError: the machine has no gasket, or its profile ends before the window.
    """
    if parameters.gasket is None:
        raise input_error(
            f"machine '{parameters.name}' has no gasket; this study needs one", key="gasket"
        )
    profile, end = parameters.profile, WINDOW[1] + AFTER
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
    """Return a measured record with the sensors of the machine, resampled every 5 ms.

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
    first, last = time[0] / OUTPUT_PERIOD - 1e-6, time[-1] / OUTPUT_PERIOD + 1e-6
    grid = np.arange(np.ceil(first), np.floor(last) + 1) * OUTPUT_PERIOD
    columns = resampled(time, values, grid, OUTPUT_PERIOD)
    lacking = grid[~np.isfinite(columns).all(axis=1)]
    if len(lacking):
        raise input_error(
            f"lacks a displacement at {lacking[0]:.6g} s; needs all of them without a gap",
            where=where,
        )
    return xr.DataArray(columns, {"time": grid, "sensor": sensors}, ["time", "sensor"])
