"""Identification of the gasket damping C_L and C_T from measured envelopes, [B] section 3.1.2."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile, with_values
from wm_drake.parameters.csv_files import with_distinct_times
from wm_drake.parameters.machine import OUTPUT_PERIOD
from wm_drake.parameters.recorded import ChannelUse, read_recording, resampled
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.parameters.variation import Change, number_at
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.parameters.varying import Varied, Varying
from wm_drake.report.quantity import TIME, Quantity
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import smooth_envelope
from wm_drake.simulation.records import read_measured
from wm_drake.simulation.runs import simulate
from wm_drake.studies.calibrate.blocks import Block, BlockModel
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.fitting.free_numbers import FreeNumbers
from wm_drake.studies.fitting.grid import grid_search
from wm_drake.studies.fitting.problem import FAILED, FitProblem, Unknown
from wm_drake.studies.inputs import existing_file

UNKNOWNS = ("C_L", "C_T")

UPPER = np.array([50.0, 0.2 * 180.0 / np.pi])
"""Upper bounds of [B]: 0.05 N s/mm for C_L and 200 N mm s/deg for C_T. [N s/m, N m s/rad]"""

LEAST_FALL = 0.02e-3
"""Fall of the distance that ends the search of [B], which prints 0.02, of lengths in mm. [m]"""

STARTS = 3
"""Searches by least squares at most."""

WINDOW = (10.0, 50.0)
"""Time interval that is compared ([B] section 3.1.2). [s]"""

AFTER = 5.0
"""Time that runs continue after the window, so that end effects of the filter stay outside. [s]"""

LOADS = ("middle", "counter")

NOISE = 1e-4
"""Standard deviation of the noise at each sample of a virtual experiment; an assumption. [m]"""

UNITS = (Unit("N*s/m", "N*s/mm"), Unit("N*m*s/rad", "N*mm*s/deg"))
"""SI units and printed units of C_L and C_T."""

LENGTH = Unit("m", "mm")
ENVELOPE = Quantity("envelope", LENGTH, 1)
APART = Quantity("difference of envelopes", LENGTH, 3)
DISTANCE = Quantity("distance", LENGTH, 2)
DAMPING = {
    "C_L": Quantity("C_L", UNITS[0], 4),
    "C_T": Quantity("C_T", UNITS[1], 1),
}
SPACING = Quantity("spacing", Unit("dimensionless", "%"))

MeasuredDisplacements: TypeAlias = Mapping[str, xr.DataArray]
"""Displacements (time, sensor), sampled every 5 ms, by load. [m]"""


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
    uses = {
        name: ChannelUse(recording.chosen(name), LENGTH, LENGTH.shown, kind="vibration")
        for name in sensors
    }
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


def damping_numbers(parameters: MachineParameters) -> FreeNumbers:
    """Return C_L and C_T, each that of all axes of the gasket, as the unknowns of a fit."""
    entries, every, unknowns = gasket_entries(), [], []
    for name, upper, unit in zip(UNKNOWNS, UPPER.tolist(), UNITS, strict=True):
        numbers = tuple(number_at(parameters, key) for key in entries[name].keys)
        ends = {"low": 0.0, "high": upper}
        every.append(Varied(name, entries[name], numbers, Change.VALUE, unit, ends))
        unknowns.append(Unknown(name, 0.0, upper, unit))
    return FreeNumbers(Varying(parameters, tuple(every)), tuple(unknowns), "identified")


@dataclass(frozen=True, eq=False)
class EnvelopeModel(BlockModel):
    """Smooth envelopes as a function of C_L and C_T: a block for each load. [m]

    Attributes:
        measured: Measured displacements.
    """

    measured: MeasuredDisplacements

    misfit = APART

    @cached_property
    def blocks(self) -> list[Block]:
        """Return the measured envelopes of each load."""
        blocks = []
        for load, displacement in self.measured.items():
            envelopes = envelopes_of(displacement)
            places = list(map(TIME.text, envelopes.time.values))
            blocks.append(Block(load, places, envelopes.values, np.ones(envelopes.shape)))
        return blocks

    def computed(self, points: FloatArray) -> list[list[FloatArray]]:
        """Return the computed envelopes of each load at each point; NaN where a run failed."""
        loads, shape = tuple(self.measured), self.blocks[0].measured.shape
        values = self.experiment.records(
            {"point": range(len(points)), "load": loads},
            (case for point in points for case in self.cases_at(point)),
            lambda record: envelopes_of(record.displacement).values.ravel(),
            math.prod(shape),
        )
        return [[of_load.reshape(shape) for of_load in of_point] for of_point in values]

    def cases_at(self, damping: FloatArray) -> list[Case]:
        """Return a case for each load, with a damping C_L, C_T. [N s/m, N m s/rad]"""
        changed = self.free.parameters_at(damping)
        profile = run_up_of(changed)
        return [Case(n, changed.loads[n], profile, parameters=changed) for n in self.measured]


def envelope_model(machine: Machine, measured: MeasuredDisplacements) -> EnvelopeModel:
    """Return the model of measured displacements.

    Raises:
        InputError: the machine has no gasket, or its profile ends before the window.
    """
    run_up_of(machine.parameters)
    free, sensors = damping_numbers(machine.parameters), list(machine.parameters.sensors)
    return EnvelopeModel(Experiment(machine, ()), free, sensors, measured)


@dataclass(frozen=True, eq=False)
class DistanceProblem(FitProblem):
    """Problem of an `EnvelopeModel` with the distance of [B] Eq. (2), (3) as cost. [m]

    It is the sum over the loads of the 2-norm of the differences of the upper and lower envelopes
    of all sensors. The lower envelope is the upper one with the other sign.
    """

    def costs_of(self, rows: FloatArray) -> FloatArray:
        """Return the distances (k,); infinite where the model fails."""
        squares: dict[str, FloatArray] = {}
        for where, curve in zip(self.slices, self.measurements, strict=True):
            apart = np.abs(rows[:, where])
            apart = np.where(apart >= FAILED * curve.largest, np.inf, apart)
            load = curve.name.rpartition(", ")[0]
            both = 2.0 * np.sum(np.square(apart), axis=1)
            squares[load] = squares.get(load, np.zeros(len(rows))) + both
        return np.sum(np.sqrt(list(squares.values())), axis=0)


def grid_of_paper(problem: FitProblem, mesh: float | None) -> xr.Dataset:
    """Search by the grids of [B] section 3.1.2.

    Args:
        mesh: Spacing at which the search ends, as a part of the region; None for the rule of [B].

    Returns:
        Over the points of all grids: `round`, `spacing` as a part of the region, `C_L`, `C_T` and
        `objective`, the distance [m].
    """
    of_paper = DistanceProblem(problem.unknowns, problem.measurements, problem.evaluate)
    if mesh is None:
        rounds = grid_search(of_paper, 0.0, least_fall=LEAST_FALL)[1]
    else:
        rounds = grid_search(of_paper, mesh)[1]
    counts = [len(grid.points) for grid in rounds]
    points = np.concatenate([grid.points for grid in rounds])
    spacing = np.repeat([grid.spacing for grid in rounds], counts)
    return xr.Dataset(
        {
            "round": ("point", np.repeat(np.arange(1, len(rounds) + 1), counts)),
            "spacing": SPACING.variable("point", spacing),
            **{n: DAMPING[n].variable("point", points[:, k]) for k, n in enumerate(UNKNOWNS)},
            "objective": DISTANCE.variable("point", np.concatenate([g.values for g in rounds])),
        }
    )


def virtual_experiment(
    parameters: MachineParameters, truth: FloatArray, seed: int
) -> dict[str, xr.DataArray]:
    """Simulate an experiment and return its displacements (time, sensor), by load. [m]

    The Drake engine runs the machine with the true damping, and noise is added.

    Args:
        truth: True values of C_L and C_T. [N s/m, N m s/rad]
    """
    rng = np.random.default_rng(seed)
    true_parameters = damping_numbers(parameters).parameters_at(truth)
    machine = build_machine(true_parameters)
    records = {}
    for load in LOADS:
        case = Case(load, true_parameters.loads[load], run_up_of(true_parameters))
        displacement = simulate(machine, case, "drake-accurate").displacement
        records[load] = displacement + rng.normal(scale=NOISE, size=displacement.shape)
    return records


def envelopes_of(displacement: xr.DataArray) -> xr.DataArray:
    """Return the upper smooth envelopes (time, sensor) in the window. [m]

    They are those of the analytic signal (`smooth_envelope`): a line from peak to peak jumps where
    a small peak appears.
    """
    whole = smooth_envelope(xr.Dataset({"displacement": displacement}))
    first, last = np.rint(np.array(WINDOW) / OUTPUT_PERIOD)
    compared = OUTPUT_PERIOD * np.arange(first, last + 1)  # runs may have closer samples
    return whole.sel(time=compared, method="nearest")


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
