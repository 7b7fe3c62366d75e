"""Pictures of the vibration of one case on a spin page, with their captions."""

import numpy as np
import xarray as xr

from wm_drake.report.formatting import MM_PER_M, number
from wm_drake.report.page import Picture, picture
from wm_drake.report.spin.cases import case_title, sensors_of
from wm_drake.report.spin.vibration_figures import (
    accelerations_figure,
    mounts_figure,
    spectra_figure,
)
from wm_drake.simulation.mount_forces import mount_forces
from wm_drake.simulation.orders import REVOLUTIONS, WINDOW
from wm_drake.simulation.vibration import sensor_accelerations
from wm_drake.studies.spin.study import CaseResult, SpinResult


def vibration_pictures(result: SpinResult, case: CaseResult) -> list[Picture | None]:
    """Return mount forces, accelerations and spectra of a case; None where there is nothing.

    Args:
        result: Result that the case belongs to.
        case: A case with at least two samples.
    """
    accelerations = sensor_accelerations(case.record, sensors_of(result, case))
    return [
        _mounts_picture(case),
        _accelerations_picture(case, accelerations),
        _spectra_picture(case, accelerations),
    ]


def _mounts_picture(case: CaseResult) -> Picture | None:
    forces = [force for force in mount_forces(case.record) if force.name != "gasket"]
    if not forces:
        return None
    caption = (
        "Forces of springs, dampers and bushings on the cabinet over time. The shaded area extends "
        "from the smallest to the largest size within each drum revolution. Each row has its own "
        "scale."
    )
    largest = max(forces, key=lambda force: force.peak)
    alternative = (
        f"Mount forces over time, load {case_title(case)}. Largest: {largest.name} "
        f"{number(largest.peak)} N."
    )
    return picture(mounts_figure(case.record, forces), alternative, caption)


def _accelerations_picture(case: CaseResult, accelerations: xr.DataArray) -> Picture | None:
    caption = (
        "Acceleration of the tub at each sensor, along its axis, over time; without gravity and "
        "unfiltered. The shaded area extends from the smallest to the largest value within each "
        "drum revolution."
    )
    alternative = (
        f"Accelerations at the sensors over time, load {case_title(case)}. Largest: "
        f"{number(float(abs(accelerations).max()))} m/s²."
    )
    return picture(accelerations_figure(case.record, accelerations), alternative, caption)


def _spectra_picture(case: CaseResult, accelerations: xr.DataArray) -> Picture | None:
    amplitude = case.measures.amplitude.fillna(0.0)
    sensor = str(amplitude.sensor.values[int(np.argmax(amplitude.values))])
    displacement = MM_PER_M * case.record.displacement.sel(sensor=sensor).values
    signals = [
        (f"{sensor} displacement", "mm", displacement),
        (f"{sensor} acceleration", "m/s²", accelerations.sel(sensor=sensor).values),
    ]
    figure = spectra_figure(case.record, signals)
    if figure is None:
        return None
    caption = (
        f"Frequencies and orders at the sensor with the largest amplitude, {sensor}: displacement "
        "(upper row) and acceleration (lower row). Left: spectrum, the largest amplitude at each "
        f"frequency over all windows of {WINDOW:g} s. Middle: amplitude over time and frequency; "
        "dotted: 1, 2 and 3 times the drum frequency. Right: amplitude over time and order, in "
        f"windows of {REVOLUTIONS} drum revolutions; order 1 is the unbalance itself, other orders "
        "come from the nonlinear forces of friction and gasket."
    )
    alternative = (
        f"Spectrum, frequency map and order map of displacement and acceleration at sensor "
        f"{sensor}, load {case_title(case)}."
    )
    return picture(figure, alternative, caption)
