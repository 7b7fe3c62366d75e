"""Spin cycle: RMS displacement per region, sensor and axis for unbalance cases ([A] section 4)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.batch.run_table import RunTable
from wm_drake.elements.bushing import AXES
from wm_drake.errors import InputError, check_known, input_error
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.unbalance_cases import TABLE_9, UnbalanceCase, load_unbalance_cases
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES as KNOWN_MEASURES
from wm_drake.simulation.measures import measure
from wm_drake.simulation.mounts import mount_names
from wm_drake.simulation.vibration import relative_error
from wm_drake.studies.executor import RunCases
from wm_drake.studies.inputs import channel_names, existing_file
from wm_drake.studies.spin.study import run_spin
from wm_drake.studies.spin_cycle.measured import DIMS, read_accelerations, read_rms
from wm_drake.studies.spin_cycle.options import SpinCycleDataOptions

FORCES = ("mounts", "cabinet")
"""Measures of the forces on the cabinet."""

MEASURES = ("regions", "gap", "spring tensions", *FORCES)
"""Measures of each run, as for `simulate_many`."""

FEET = ("feet", "feet regions")
"""Measures of each run of a machine with a cabinet."""

DRIVE = ("drive",)
"""Measures of each run of a machine with a motor."""


@dataclass(frozen=True)
class SpinCycleRuns:
    """Results of a spin-cycle study.

    Attributes:
        profile: Spin profile with regions.
        cases: The cases, in the order of the runs.
        displacement: (case, region, accelerometer, axis) RMS displacement from the displacement
            itself; NaN where a run ended before the region did. [m]
        integrated: (case, region, accelerometer, axis) RMS displacement from the acceleration,
            integrated twice. [m]
        smallest_gap: (case) smallest gap between tub group and housing. [m]
        smallest_tension: (case, spring) smallest tension of each spring. [N]
        diverged: (case) time and reason if a run diverged, else "".
        forces: Forces of the mounts and, if the machine has a cabinet, loads and margins of its
            feet; with a motor, measures of the drive: the variables of `simulate_many` over case.
            SI.
        measured: (case, region, accelerometer, axis) measured RMS displacement; NaN where nothing
            was measured. None without a measurement. [m]
    """

    parameters: MachineParameters
    profile: SpinProfile
    cases: tuple[UnbalanceCase, ...]
    displacement: xr.DataArray
    integrated: xr.DataArray
    smallest_gap: xr.DataArray
    smallest_tension: xr.DataArray
    diverged: tuple[str, ...]
    forces: xr.Dataset
    measured: xr.DataArray | None = None


def measures_of(parameters: MachineParameters) -> tuple[str, ...]:
    """Return the measures of each run of a machine, as for `simulate_many`."""
    return (*MEASURES, *forces_measured(parameters)[len(FORCES) :])


def forces_measured(parameters: MachineParameters) -> tuple[str, ...]:
    """Return the measures of the forces of a machine: on cabinet and floor, and of its motor."""
    feet = FEET if parameters.cabinet else ()
    return (*FORCES, *feet, *(DRIVE if motor_of(parameters.drive) else ()))


def forces_of(
    parameters: MachineParameters, table: xr.Dataset, labels: dict[str, list[str]]
) -> xr.Dataset:
    """Return the forces of a table of runs, with cases and regions by name."""
    coordinates = {name: labels[name] for name in ("case", "region", "axis")}
    coordinates["mount"] = list(mount_names(parameters))
    if parameters.cabinet:
        coordinates["foot"] = list(parameters.cabinet.corners)
    measures = forces_measured(parameters)
    if "drive" in measures:
        coordinates["order"] = ["cosine", "sine"]
    names = [name for measure in measures for name in KNOWN_MEASURES[measure].names]
    variables = {name: (("case", *table[name].dims[1:]), table[name].values) for name in names}
    return xr.Dataset(variables, coordinates)


def runs_of(
    parameters: MachineParameters, cases: Sequence[UnbalanceCase], profile: SpinProfile
) -> list[Case]:
    """Return the runs of a study.

    Raises:
        InputError: the profile has no regions, or the machine does not define the planes of the
            unbalance masses.
    """
    if not profile.regions:
        raise input_error(
            "has no regions; this study needs them: regions: [{name, begin, end}, ...]",
            key="profile",
        )
    return [Case(case.name, case.load(parameters), profile) for case in cases]


def run_spin_cycle(
    parameters: MachineParameters,
    cases: Sequence[UnbalanceCase],
    profile: SpinProfile,
    evaluate: RunCases,
) -> SpinCycleRuns:
    """Run unbalance cases and label their measures.

    Raises:
        InputError: the profile has no regions, or the machine does not define the planes of the
            unbalance masses.
    """
    table = evaluate(runs_of(parameters, cases, profile))
    labels = labels_of(parameters, cases, profile)
    direct, integrated = (
        xr.DataArray(table[name].values, labels, DIMS, attrs={"units": "m"})
        for name in ("region_displacement", "region_displacement_integrated")
    )
    gap = xr.DataArray(table.smallest_gap.values, {"case": labels["case"]}, attrs={"units": "m"})
    tension = xr.DataArray(
        table.smallest_spring_tension.values,
        {"case": labels["case"], "spring": list(parameters.springs)},
        attrs={"units": "N"},
    )
    diverged = tuple(map(str, table.diverged.values))
    forces = forces_of(parameters, table, labels)
    measured = direct, integrated, gap, tension
    return SpinCycleRuns(parameters, profile, tuple(cases), *measured, diverged, forces)


def labels_of(
    parameters: MachineParameters, cases: Sequence[UnbalanceCase], profile: SpinProfile
) -> dict[str, list[str]]:
    """Return the names along each dimension of the results."""
    regions = [region.name for region in profile.regions]
    sensors = list(parameters.accelerometer_frames())
    return dict(
        zip(DIMS, ([case.name for case in cases], regions, sensors, list(AXES)), strict=True)
    )


def disagreement(result: SpinCycleRuns) -> xr.DataArray:
    """Return the relative error (case, region) of the displacements from integrated acceleration.

    It is [A] Eq. (9) with norms over all sensors and axes; the reference is the displacement
    itself.
    """
    direct, integrated = (_flat(values) for values in (result.displacement, result.integrated))
    return xr.DataArray(
        relative_error(integrated, direct), {dim: result.displacement[dim] for dim in DIMS[:2]}
    )


def region_errors(computed: xr.DataArray, measured: xr.DataArray) -> xr.DataArray:
    """Return the relative error (case, region) of computed displacements, [A] Eq. (9).

    The norms are over the sensors and axes that were measured.
    """
    is_measured = np.isfinite(measured)
    vectors = [_flat(values.where(is_measured, 0.0)) for values in (computed, measured)]
    return xr.DataArray(relative_error(*vectors), {dim: computed[dim] for dim in DIMS[:2]})


def average_errors(computed: xr.DataArray, measured: xr.DataArray) -> xr.DataArray:
    """Return the mean relative error (case) of single values, as in [A] Table 9.

    The mean is over regions, sensors and axes.
    """
    single = relative_error(computed.values[..., None], measured.values[..., None])
    return xr.DataArray(single, computed.coords, computed.dims).mean(DIMS[1:], skipna=True)


def missing_regions(computed: xr.DataArray, measured: xr.DataArray) -> dict[str, list[str]]:
    """Return the measured cases whose errors leave a region out, by the name of the region.

    They have no value there that is both computed and measured.
    """
    is_measured = measured.notnull()
    compared = (is_measured & computed.notnull()).any(DIMS[2:])
    left_out = ~compared & is_measured.any(DIMS[1:])
    cases = {
        str(region): [str(case) for case in left_out.case.values[of_region]]
        for region, of_region in zip(
            left_out.region.values, left_out.transpose("region", "case").values, strict=True
        )
    }
    return {region: of_region for region, of_region in cases.items() if of_region}


def mean_and_deviation(errors: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Return mean and standard deviation of errors over the cases.

    As in [A], it is the standard deviation of these cases, not an estimate for a population.
    """
    return errors.mean("case", skipna=True), errors.std("case", skipna=True)


@dataclass(frozen=True)
class Largest:
    """The largest RMS displacement, with the names of its case, region, sensor and axis. [m]"""

    case: str
    region: str
    accelerometer: str
    axis: str
    value: float


def largest(displacement: xr.DataArray) -> Largest | None:
    """Return the largest value of an array (case, region, accelerometer, axis).

    The result is None if no run completed a region.
    """
    values = displacement.values
    if not np.isfinite(values).any():
        return None
    index = np.unravel_index(int(np.nanargmax(values)), values.shape)
    case, region, sensor, axis = (
        str(displacement[dim].values[i]) for dim, i in zip(DIMS, index, strict=True)
    )
    return Largest(case, region, sensor, axis, float(values[index]))


def _flat(values: xr.DataArray) -> np.ndarray:
    return values.values.reshape(*values.shape[:2], -1)


def cases_of_table(path: Path | None, names: Sequence[str] | None) -> list[UnbalanceCase]:
    """Return the cases that `--cases` and `--case` select."""
    table = load_unbalance_cases(existing_file(path, "--cases") if path else TABLE_9)
    known = {case.name: case for case in table}
    for name in names or []:
        check_known(name, known, f"unknown case '{name}'", where="--case")
    return [known[name] for name in dict.fromkeys(names)] if names else table


def measured_displacements(
    options: SpinCycleDataOptions,
    parameters: MachineParameters,
    cases: list[UnbalanceCase],
    profile: SpinProfile,
) -> xr.DataArray | None:
    """Return the measured RMS displacements in a file of the options; None without a file.

    Raises:
        InputError: there are files of both kinds, one is wrong, or a case cannot be run.
    """
    names, unit = channel_names(options)
    if options.measured and options.accelerations:
        raise input_error("not allowed together with --measured", where="--accelerations")
    for option, given in (("--channels", names.channels), ("--unit", options.unit)):
        if given and not options.accelerations:
            raise input_error("is about the files of --accelerations", where=option)
    try:
        runs_of(parameters, cases, profile)  # raises an error for cases that cannot be run
    except InputError as error:
        raise InputError(
            replace(p, where="--profile", key="") if p.key == "profile" else p
            for p in error.problems
        ) from None
    labels = labels_of(parameters, cases, profile)
    if options.measured:
        return read_rms(existing_file(options.measured, "--measured"), labels)
    if options.accelerations:
        return read_accelerations(options.accelerations, labels, profile, names, unit)
    return None


def compiled_runs(machine: Machine) -> RunCases:
    """Return a function that runs cases of a built machine with the compiled engine."""
    return partial(simulate_many, machine, measures=measures_of(machine.parameters))


def drake_runs(
    parameters: MachineParameters, *, progress: Callable[[int], None] = lambda done: None
) -> RunCases:
    """Return a function that runs cases with the Drake engine in processes, minutes a case."""

    def evaluate(cases: Iterable[Case]) -> xr.Dataset:
        runs = list(cases)
        done = np.zeros(len(runs))

        def report(index: int, fraction: float) -> None:
            done[index] = fraction
            progress(int(done.sum()))

        results = run_spin(parameters, runs, "drake", progress=report).results
        measures, scene = measures_of(parameters), Scene(parameters)
        table = RunTable(parameters, measures)
        for number, result in enumerate(results):
            of_run = measure(result.record, scene, measures)
            values = {
                variable.name: of_run.table[variable.name].values for variable in table.variables
            }
            diverged = str(result.record.attrs["diverged"])
            table.put(number, result.case.name, values, diverged)
        return table.dataset()

    return evaluate
