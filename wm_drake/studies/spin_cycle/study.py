"""The spin cycle: RMS displacement per region, sensor and axis for a table of unbalance cases ([A] section 4)."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.simulation.cases import Case
from wm_drake.simulation.outputs import AXES
from wm_drake.simulation.vibration import relative_error

MEASURES = ("regions", "gap")
"""Of `simulate_many`: what the study reads off each run."""

DIMS = ("case", "region", "accelerometer", "axis")

Evaluate: TypeAlias = Callable[[Iterable[Case]], xr.Dataset]
"""Runs cases, gives the table that `simulate_many` gives of `MEASURES`."""


@dataclass(frozen=True)
class SpinCycleResult:
    """All cases of one study.

    Attributes:
        parameters: The machine.
        profile: The spin cycle, with regions.
        cases: What was run, in order.
        displacement, integrated: RMS displacement (case, region, accelerometer, axis), taken directly and from acceleration;
            NaN where a run did not get there. [m]
        smallest_gap: (case) between tub group and housing. [m]
        diverged: (case) when and why a run stopped early, "" if it did not.
        measured: As `displacement`, NaN where nothing was measured; None without a measurement. [m]
    """

    parameters: MachineParameters
    profile: SpinProfile
    cases: tuple[UnbalanceCase, ...]
    displacement: xr.DataArray
    integrated: xr.DataArray
    smallest_gap: xr.DataArray
    diverged: tuple[str, ...]
    measured: xr.DataArray | None = None


def runs_of(
    parameters: MachineParameters, cases: Sequence[UnbalanceCase], profile: SpinProfile
) -> list[Case]:
    """The runs of a study.

    Raises:
        InputError: the profile has no regions, or the machine no places for unbalances.
    """
    if not profile.regions:
        raise input_error(
            "has no regions; a profile of this study names them: regions: [{name, begin, end}, ...]",
            key="profile",
        )
    return [Case(case.name, case.load(parameters), profile) for case in cases]


def run_spin_cycle(
    parameters: MachineParameters,
    cases: Sequence[UnbalanceCase],
    profile: SpinProfile,
    evaluate: Evaluate,
) -> SpinCycleResult:
    """Runs the cases of a table and labels what is measured of them.

    Args:
        parameters: The machine; its imperfections count.
        cases: At least one.
        profile: With regions.
        evaluate: Runs them.
    """
    table = evaluate(runs_of(parameters, cases, profile))
    labels = labels_of(parameters, cases, profile)
    direct, integrated = (
        xr.DataArray(table[name].values, labels, DIMS, attrs={"units": "m"})
        for name in ("region_displacement", "region_displacement_integrated")
    )
    gap = xr.DataArray(table.smallest_gap.values, {"case": labels["case"]}, attrs={"units": "m"})
    diverged = tuple(map(str, table.diverged.values))
    return SpinCycleResult(parameters, profile, tuple(cases), direct, integrated, gap, diverged)


def labels_of(
    parameters: MachineParameters, cases: Sequence[UnbalanceCase], profile: SpinProfile
) -> dict[str, list[str]]:
    """Names along the dimensions of the results."""
    regions = [region.name for region in profile.regions]
    sensors = list(parameters.accelerometer_frames())
    return dict(
        zip(DIMS, ([case.name for case in cases], regions, sensors, list(AXES)), strict=True)
    )


def disagreement(result: SpinCycleResult) -> xr.DataArray:
    """(case, region) how far the two ways of taking displacements are apart: [A] Eq. (9) over all sensors and axes."""
    direct, integrated = (_flat(values) for values in (result.displacement, result.integrated))
    return xr.DataArray(
        relative_error(integrated, direct), {dim: result.displacement[dim] for dim in DIMS[:2]}
    )


def region_errors(computed: xr.DataArray, measured: xr.DataArray) -> xr.DataArray:
    """(case, region) relative error [A] Eq. (9), norms over the sensors and axes that were measured."""
    there = np.isfinite(measured)
    shown = [_flat(values.where(there, 0.0)) for values in (computed, measured)]
    return xr.DataArray(relative_error(*shown), {dim: computed[dim] for dim in DIMS[:2]})


def average_errors(computed: xr.DataArray, measured: xr.DataArray) -> xr.DataArray:
    """(case) mean over regions, sensors and axes of the relative errors of single numbers, as in [A] Table 9."""
    single = relative_error(computed.values[..., None], measured.values[..., None])
    return xr.DataArray(single, computed.coords, computed.dims).mean(DIMS[1:], skipna=True)


def mean_and_deviation(errors: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Over the cases: mean and standard deviation, of these cases as [A] has it, not of what they are a sample of."""
    return errors.mean("case", skipna=True), errors.std("case", skipna=True)


@dataclass(frozen=True)
class Largest:
    """The largest RMS displacement of a case, or of all. [m]"""

    case: str
    region: str
    accelerometer: str
    axis: str
    value: float


def largest(displacement: xr.DataArray) -> Largest | None:
    """Where an array (case, region, accelerometer, axis) is largest; None if no run got through a region."""
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
