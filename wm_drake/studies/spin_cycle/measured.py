"""Measurements of a spin cycle, as files: RMS displacements, or acceleration records to be integrated twice."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.vibration import HIGH_PASS_HZ, high_passed, integrated_twice, region_rms
from wm_drake.studies.spin_cycle.study import DIMS

RMS_COLUMNS = ["case", "region", "sensor", "axis", "rms_mm"]
"""Of a table of RMS displacements; `rms_table` writes the same."""

UNEVEN = 1e-3
"""How much the time between two samples may differ from the mean one."""


def rms_table(displacement: xr.DataArray) -> pd.DataFrame:
    """RMS displacements as a table with `RMS_COLUMNS`, one number a row. [mm]"""
    table = (1e3 * displacement).rename("rms_mm").to_dataframe().reset_index()
    return table.rename(columns={"accelerometer": "sensor"})[RMS_COLUMNS]


def read_rms(path: Path, labels: Mapping[str, Sequence[str]]) -> xr.DataArray:
    """Measured RMS displacements (case, region, accelerometer, axis) from a CSV with `RMS_COLUMNS`; NaN where it has none. [m]

    Raises:
        InputError: not such a table, a name the study does not have, a value that is not a number, a row twice.
    """
    table = read_csv(path, RMS_COLUMNS)
    if table.empty:
        raise input_error("has no row", where=str(path))
    names = table[RMS_COLUMNS[:4]].astype(str)
    for column, dim in zip(RMS_COLUMNS, DIMS, strict=False):
        for name in names[column]:
            if name not in labels[dim]:
                raise input_error(
                    f"no {column} '{name}' in this study{nearest_names(name, labels[dim])}",
                    where=str(path),
                )
    if names.duplicated().any():
        raise input_error(
            f"{' '.join(names[names.duplicated()].iloc[0])} is there twice", where=str(path)
        )
    values = pd.to_numeric(table["rms_mm"], errors="coerce").to_numpy(dtype=float)
    if not (np.isfinite(values) & (values >= 0.0)).all():
        raise input_error("an RMS displacement is not a number of at least 0", where=str(path))
    measured = np.full([len(labels[dim]) for dim in DIMS], np.nan)
    places = [
        [labels[dim].index(name) for name in names[column]]
        for column, dim in zip(RMS_COLUMNS, DIMS, strict=False)
    ]
    measured[tuple(places)] = 1e-3 * values
    return xr.DataArray(measured, labels, DIMS)


def read_accelerations(
    folder: Path, labels: Mapping[str, Sequence[str]], profile: SpinProfile
) -> xr.DataArray:
    """RMS displacements (case, region, accelerometer, axis) from acceleration records, integrated twice. [m]

    One file CASE.csv a case, for some of the cases: time_s from the begin of the profile on, then SENSOR_AXIS (S1_x, ...) in
    m/s^2. The mean of each, faded in and out, is taken for the sensor's bias.

    Raises:
        InputError: no such folder or no file of a case, not such a table, samples that are not evenly spaced.
    """
    paths = {name: folder / f"{name}.csv" for name in labels["case"]}
    if not any(path.is_file() for path in paths.values()):
        raise input_error(
            "has no file CASE.csv with accelerations of a case of this study", where=str(folder)
        )
    empty = np.full([len(labels[dim]) for dim in DIMS[1:]], np.nan)
    rows = [
        _from_acceleration(path, labels, profile) if path.is_file() else empty
        for path in paths.values()
    ]
    return xr.DataArray(np.array(rows), labels, DIMS)


def _from_acceleration(
    path: Path, labels: Mapping[str, Sequence[str]], profile: SpinProfile
) -> FloatArray:
    channels = [f"{sensor}_{axis}" for sensor in labels["accelerometer"] for axis in labels["axis"]]
    numbers = (
        read_csv(path, ["time_s", *channels])
        .apply(pd.to_numeric, errors="coerce")
        .to_numpy(dtype=float)
    )
    if not np.isfinite(numbers).all() or len(numbers) < 2:
        raise input_error(
            "has a value that is not a finite number, or fewer than two rows", where=str(path)
        )
    time, acceleration = numbers[:, 0], numbers[:, 1:]
    period = float((time[-1] - time[0]) / (len(time) - 1))
    if (
        period <= 0.0
        or np.max(np.abs(np.diff(time) / period - 1.0)) > UNEVEN
        or abs(time[0]) > period
    ):
        raise input_error(
            "samples must be evenly spaced in time and begin at time 0 of the profile",
            where=str(path),
        )
    # a plain mean holds the speed at which the record ends; fading in and out leaves of it what does not swing
    bias = np.average(acceleration, axis=0, weights=np.hanning(len(acceleration)))
    displacement = high_passed(integrated_twice(acceleration - bias, period), period, HIGH_PASS_HZ)
    return region_rms(displacement, period, profile).reshape([len(labels[dim]) for dim in DIMS[1:]])
