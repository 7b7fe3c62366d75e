"""Files with measurements of a spin cycle: RMS displacements, or records of acceleration."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import check_known, input_error
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.csv_files import read_csv, with_distinct_times
from wm_drake.parameters.lab_files import SUFFIXES, is_lab_file
from wm_drake.parameters.lab_signals import ACCELERATION, lab_signals
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import HIGH_PASS_HZ
from wm_drake.simulation.vibration import high_passed, integrated_twice, region_rms

DIMS = ("case", "region", "accelerometer", "axis")

RMS_COLUMNS = ["case", "region", "sensor", "axis", "rms_mm"]
"""Columns of a table of RMS displacements, as read by `read_rms` and returned by `rms_table`."""

LEAST_ROWS = 32
"""Smallest number of samples that the high-pass filter and the removal of the mean need."""

UNEVEN = 1e-3
"""Largest relative deviation of a sampling interval from the mean one."""


def rms_table(displacement: xr.DataArray) -> pd.DataFrame:
    """Return RMS displacements as a table with `RMS_COLUMNS`, one value per row. [mm]"""
    table = (1e3 * displacement).rename("rms_mm").to_dataframe().reset_index()
    return table.rename(columns={"accelerometer": "sensor"})[RMS_COLUMNS]


def read_rms(path: Path, labels: Mapping[str, Sequence[str]]) -> xr.DataArray:
    """Read measured RMS displacements from a CSV file with the columns `RMS_COLUMNS`.

    Returns:
        (case, region, accelerometer, axis); NaN where the file has no value. [m]

    Raises:
        InputError: the file has other columns or no row, the study does not have a name, a value is
            not a number of at least 0, or a row occurs twice.
    """
    table = read_csv(path, RMS_COLUMNS)
    if table.empty:
        raise input_error("has no row; at least one is needed", where=str(path))
    names = table[RMS_COLUMNS[:4]].astype(object).fillna("").astype(str)
    for column, dim in zip(RMS_COLUMNS, DIMS, strict=False):
        for name in names[column]:
            check_known(name, labels[dim], f"no {column} '{name}' in this study", where=str(path))
    if names.duplicated().any():
        name = " ".join(names[names.duplicated()].iloc[0])
        raise input_error(f"{name} occurs twice; each value may occur once", where=str(path))
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
    folder: Path,
    labels: Mapping[str, Sequence[str]],
    profile: SpinProfile,
    channels: Mapping[str, str] | None = None,
) -> xr.DataArray:
    """Compute RMS displacements from records of acceleration, integrated twice.

    The folder has one file CASE.csv for each measured case; cases without a file are NaN. The
    columns are time_s, which starts with the profile, and SENSOR_AXIS (S1_x, ...) in m/s^2. A file
    may be MDF4, TDMS, UFF 58 or MAT instead, with channels of these names and units of its own. The
    bias of each sensor is estimated by a mean with a Hann window and subtracted.

    Args:
        channels: Name in the files of ``time`` or of an accelerometer's axis, such as ``S1_x``. A
            CSV may have the unit in its header then: ``Acc 1 [g]``.

    Returns:
        (case, region, accelerometer, axis). [m]

    Raises:
        InputError: the folder has no file of a case, a file has other columns or values that are
            not finite numbers, or the samples are not evenly spaced.
    """
    known = {"time", *_words(labels)}
    for word in channels or {}:
        check_known(word, known, f"no word '{word}'", where="--channels")
    paths = {name: _file_of(folder, name) for name in labels["case"]}
    if not any(paths.values()):
        raise input_error(
            "has no file CASE.csv with accelerations of a case of this study; give at least one",
            where=str(folder),
        )
    empty = np.full([len(labels[dim]) for dim in DIMS[1:]], np.nan)
    rows = [
        empty if path is None else _from_acceleration(path, labels, profile, channels or {})
        for path in paths.values()
    ]
    return xr.DataArray(np.array(rows), labels, DIMS)


def _file_of(folder: Path, case: str) -> Path | None:
    """Return the file of a case; None if there is none.

    Raises:
        InputError: there are several.
    """
    files = [
        path for suffix in (".csv", *SUFFIXES) if (path := folder / f"{case}{suffix}").is_file()
    ]
    if len(files) > 1:
        names = " and ".join(path.name for path in files)
        raise input_error(f"has {names}; give one file for each case", where=str(folder))
    return files[0] if files else None


def _words(labels: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the words of the channels of all accelerometers."""
    return [f"{sensor}_{axis}" for sensor in labels["accelerometer"] for axis in labels["axis"]]


def _samples(path: Path, words: list[str], channels: Mapping[str, str]) -> FloatArray:
    """Return time [s] and accelerations [m/s^2] of a file, one row a sample."""
    if is_lab_file(path) or channels:
        units = dict.fromkeys(words, ACCELERATION)
        time, signals = lab_signals(path, units, "m/s^2", channels)
        return np.column_stack([time, *signals.values()])
    return (
        read_csv(path, ["time_s", *words])
        .apply(pd.to_numeric, errors="coerce")
        .to_numpy(dtype=float)
    )


def _from_acceleration(
    path: Path,
    labels: Mapping[str, Sequence[str]],
    profile: SpinProfile,
    channels: Mapping[str, str],
) -> FloatArray:
    numbers = _samples(path, _words(labels), channels)
    if not np.isfinite(numbers).all() or len(numbers) < LEAST_ROWS:
        raise input_error(
            f"has a value that is not a finite number, or fewer than {LEAST_ROWS} rows; at least "
            f"{LEAST_ROWS} rows of finite numbers are needed",
            where=str(path),
        )
    numbers = with_distinct_times(numbers, str(path))
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
    # a plain mean would include the velocity at the end of the record divided by its duration
    bias = np.average(acceleration, axis=0, weights=np.hanning(len(acceleration)))
    displacement = high_passed(integrated_twice(acceleration - bias, period), period, HIGH_PASS_HZ)
    return region_rms(displacement, period, profile).reshape([len(labels[dim]) for dim in DIMS[1:]])
