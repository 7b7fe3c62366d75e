"""Files with measurements of a spin cycle: RMS displacements, or records of acceleration."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import check_known, input_error
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.recorded import (
    ACCELERATION,
    ChannelNames,
    ChannelUse,
    Synchronous,
    read_recording,
)
from wm_drake.parameters.recorded.clock import UNEVEN
from wm_drake.parameters.recorded.formats import SUFFIXES
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.band import HIGH_PASS_HZ
from wm_drake.simulation.vibration import displacement_of, region_rms
from wm_drake.studies.compare.recordings import check_distinct

DIMS = ("case", "region", "accelerometer", "axis")

RMS = Quantity("RMS displacement", Unit("m", "mm"), 3)

RMS_COLUMNS = ["case", "region", "sensor", "axis", f"rms_{RMS.unit.shown}"]
"""Columns of a file of RMS displacements, as read by `read_rms` and written by the study."""

LEAST_ROWS = 32
"""Smallest number of samples that the high-pass filter and the removal of the mean need."""

COARSEST = 0.05 / HIGH_PASS_HZ
"""Largest sampling interval: ten samples of the slowest motion that the filter passes. [s]"""


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
    names = table[RMS_COLUMNS[:4]]
    for column, dim in zip(RMS_COLUMNS, DIMS, strict=False):
        for name in names[column]:
            check_known(name, labels[dim], f"no {column} '{name}' in this study", where=str(path))
    if names.duplicated().any():
        name = " ".join(names[names.duplicated()].iloc[0])
        raise input_error(f"{name} occurs twice; each value may occur once", where=str(path))
    values = pd.to_numeric(table[RMS_COLUMNS[-1]], errors="coerce").to_numpy(dtype=float)
    if not (np.isfinite(values) & (values >= 0.0)).all():
        raise input_error("an RMS displacement is not a number of at least 0", where=str(path))
    measured = np.full([len(labels[dim]) for dim in DIMS], np.nan)
    places = [
        [labels[dim].index(name) for name in names[column]]
        for column, dim in zip(RMS_COLUMNS, DIMS, strict=False)
    ]
    measured[tuple(places)] = RMS.unit.to_si(values)
    return xr.DataArray(measured, labels, DIMS)


def read_accelerations(
    folder: Path,
    labels: Mapping[str, Sequence[str]],
    profile: SpinProfile,
    names: ChannelNames | None = None,
    unit: str = "",
) -> xr.DataArray:
    """Compute RMS displacements from records of acceleration, integrated twice.

    The folder has one file for each measured case, CASE.csv or one of another recorded format;
    cases without a file are NaN. Its time starts with the profile; its channels are SENSOR_AXIS
    (S1_x, ...). They are compared with what such sensors would record of the model.

    Args:
        names: Name in the files of ``time`` or of an accelerometer's axis, such as ``S1_x``; units
            of channels whose file has none.
        unit: Unit of accelerations without one; "" for m/s^2.

    Returns:
        (case, region, accelerometer, axis). [m]

    Raises:
        InputError: the folder has no file of a case, a file lacks a channel or a sample, or the
            samples are not evenly spaced.
    """
    names = names or ChannelNames()
    known = {"time", *_words(labels)}
    for word in names.channels:
        check_known(word, known, f"no word '{word}'", where="--channels")
    paths = {name: file_of_case(folder, name) for name in labels["case"]}
    if not any(paths.values()):
        raise input_error(
            "has no file CASE.csv with accelerations of a case of this study; give at least one",
            where=str(folder),
        )
    empty = np.full([len(labels[dim]) for dim in DIMS[1:]], np.nan)
    rows, records = [], list[Synchronous]()
    for path in paths.values():
        if path is None:
            rows.append(empty)
            continue
        records.append(_samples(path, _words(labels), names, unit or ACCELERATION.si))
        time = records[-1].time
        acceleration = np.stack(list(records[-1].values.values()), axis=1)
        period = float((time[-1] - time[0]) / (len(time) - 1))
        rms = region_rms(displacement_of(acceleration, period), period, profile)
        rows.append(rms.reshape(empty.shape))
    check_distinct(records)
    return xr.DataArray(np.array(rows), labels, DIMS)


def file_of_case(folder: Path, case: str) -> Path | None:
    """Return the file of a case; None if there is none.

    Raises:
        InputError: there are several.
    """
    files = [path for suffix in SUFFIXES if (path := folder / f"{case}{suffix}").is_file()]
    if len(files) > 1:
        names = " and ".join(path.name for path in files)
        raise input_error(f"has {names}; give one file for each case", where=str(folder))
    return files[0] if files else None


def _words(labels: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the words of the channels of all accelerometers."""
    return [f"{sensor}_{axis}" for sensor in labels["accelerometer"] for axis in labels["axis"]]


def _samples(path: Path, words: list[str], names: ChannelNames, unit: str) -> Synchronous:
    """Return the accelerations of a file, evenly spaced from 0.

    Raises:
        InputError: a channel is missing, has a gap or is too short, or the time does not fit.
    """
    recording = read_recording(path, names)
    uses = {
        word: ChannelUse(
            recording.word(word) or recording.chosen(word), ACCELERATION, unit, kind="vibration"
        )
        for word in words
    }
    channels = recording.synchronous(uses)
    time = channels.time
    if len(time) < LEAST_ROWS:
        raise input_error(
            f"has {len(time)} samples; at least {LEAST_ROWS} are needed", where=str(path)
        )
    for word, values in channels.values.items():
        missing = np.flatnonzero(~np.isfinite(values))
        if len(missing):
            raise input_error(
                f"lacks {len(missing)} of {len(values)} samples, the first at "
                f"{time[missing[0]]:.6g} s; it is integrated twice, which needs all of them",
                where=str(path),
                key=word,
            )
    period = float((time[-1] - time[0]) / (len(time) - 1))
    if np.max(np.abs(np.diff(time) / period - 1.0)) > UNEVEN or abs(time[0]) > period:
        raise input_error(
            "samples must be evenly spaced in time and begin at time 0 of the profile; they begin "
            f"at {time[0]:.6g} s, with steps of {np.diff(time).min():.4g} to "
            f"{np.diff(time).max():.4g} s",
            where=str(path),
        )
    if period > COARSEST:
        raise input_error(
            f"has a sample every {period:.4g} s; at least one every {COARSEST:.3g} s is needed; if "
            "the time has another unit, name it: --unit time=ms",
            where=str(path),
        )
    return channels
