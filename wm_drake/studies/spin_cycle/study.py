"""Spin cycle: RMS displacement per region, sensor and axis for unbalance cases ([A] section 4)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.elements.bushing import AXES
from wm_drake.errors import InputError, check_known, input_error
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.unbalance_cases import TABLE_9, UnbalanceCase, load_unbalance_cases
from wm_drake.parameters.units import Share, Unit
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.simulation.vibration import relative_error
from wm_drake.studies.executor import RunCases
from wm_drake.studies.experiment import placed
from wm_drake.studies.inputs import channel_names, existing_file
from wm_drake.studies.spin_cycle.measured import DIMS, RMS, read_accelerations, read_rms
from wm_drake.studies.spin_cycle.options import SpinCycleDataOptions

MEASURES = ("regions", "gap", "spring tensions", "mounts", "cabinet")
"""Measures of each run, as for `simulate_many`."""

RECORDED, RECORDED_REGIONS = "region_displacement_recorded", "recorded regions"
"""What accelerometers would tell of a run, which is compared with those of a measurement; and the
measure that has it."""

GRAMS = Quantity("mass", Unit("kg", "g"), 0)
PHASE = Quantity("phase", Unit("rad", "deg"), 0)
ERROR = Quantity("average error", Share(), 1)
INTEGRATED = Quantity("direct vs. integrated", Share(), 2)


def measures_of(parameters: MachineParameters, *more: str) -> tuple[str, ...]:
    """Return the measures of each run of a machine: also of its feet and of its motor."""
    feet = ("feet", "feet regions") if parameters.cabinet else ()
    return (*MEASURES, *more, *feet, *(("drive",) if motor_of(parameters.drive) else ()))


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
) -> xr.Dataset:
    """Run unbalance cases and label their measures.

    Returns:
        The measures of `simulate_many` over `case`, with masses [kg] and phase [rad] of each case,
        and regions by name. RMS displacements over case, region, accelerometer and axis are `rms`
        and `rms_from_acceleration`, NaN where a run ended before the region did. [m]
        `published_error` is that of [A] Table 9, NaN if there is none.

    Raises:
        InputError: the profile has no regions, or the machine does not define the planes of the
            unbalance masses.
    """
    table = evaluate(runs_of(parameters, cases, profile))
    data = placed(table, {"case": [case.name for case in cases]}).rename(
        region_displacement="rms", region_displacement_integrated="rms_from_acceleration"
    )
    data = data.rename({RECORDED: "rms_recorded"} if RECORDED in data else {})
    for name in ("rms", "rms_from_acceleration", "rms_recorded"):
        if name in data:
            data[name] = RMS.on(data[name])
    published = [case.published_error_percent for case in cases]
    errors = ERROR.unit.to_si(np.array(published, dtype=float))
    labels = {
        "front": GRAMS.named("front mass").variable("case", [case.front for case in cases]),
        "rear": GRAMS.named("rear mass").variable("case", [case.rear for case in cases]),
        "phase": PHASE.variable("case", [case.phase for case in cases]),
    }
    data["published_error"] = ERROR.named("average error, [A] Table 9").variable("case", errors)
    return data.assign_coords({**labels_of(parameters, cases, profile), **labels})


def labels_of(
    parameters: MachineParameters, cases: Sequence[UnbalanceCase], profile: SpinProfile
) -> dict[str, list[str]]:
    """Return the names along each dimension of the results."""
    regions = [region.name for region in profile.regions]
    sensors = list(parameters.accelerometer_frames())
    return dict(
        zip(DIMS, ([case.name for case in cases], regions, sensors, list(AXES)), strict=True)
    )


def compared_of(data: xr.Dataset) -> xr.DataArray:
    """Return what is compared with a measurement: what accelerometers tell, if they measured it."""
    return data.rms_recorded if "rms_recorded" in data else data.rms


def disagreement(data: xr.Dataset) -> xr.DataArray:
    """Return the relative error (case, region) of the displacements from integrated acceleration.

    It is [A] Eq. (9) with norms over all sensors and axes; the reference is the displacement
    itself.
    """
    direct, integrated = (_flat(data[name]) for name in ("rms", "rms_from_acceleration"))
    return xr.DataArray(
        relative_error(integrated, direct), {dim: data[dim] for dim in DIMS[:2]}, DIMS[:2]
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


def largest(displacement: xr.DataArray, over: Sequence[str] = ()) -> xr.DataArray:
    """Return the largest of displacements, with the labels where it occurs as coordinates.

    Args:
        displacement: Over case, region, accelerometer and axis. [m]
        over: Dimensions that the result keeps.

    Returns:
        Over the kept dimensions; NaN where no run completed a region. [m]
    """
    others = [dim for dim in displacement.dims if dim not in over]
    return displacement.isel(displacement.fillna(-1.0).argmax(others))


def _flat(values: xr.DataArray) -> np.ndarray:
    return values.values.reshape(*values.shape[:2], -1)


ALL = "all"
"""Name of all cases of the table."""


def cases_of_table(path: Path | None, names: Sequence[str] | None) -> list[UnbalanceCase]:
    """Return the cases that `--cases` and `--case` select; all of the table for `ALL`, or none."""
    table = load_unbalance_cases(existing_file(path, "--cases") if path else TABLE_9)
    if not names or tuple(names) == (ALL,):
        return table
    known = {case.name: case for case in table}
    for name in names:
        check_known(name, known, f"unknown case '{name}'", where="--case")
    return [known[name] for name in dict.fromkeys(names)]


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
