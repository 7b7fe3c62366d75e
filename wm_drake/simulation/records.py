"""The record: a labelled dataset of one run, with units; how it is made, written and read."""

import functools
import importlib.metadata
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
import xarray as xr

from wm_drake.elements.bushing import AXES
from wm_drake.engines.trajectory import COORDINATES, Trajectory, divergence_text
from wm_drake.errors import input_error
from wm_drake.model.machine import Setup
from wm_drake.parameters import Load, SpinProfile
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.mounts import mount_names
from wm_drake.simulation.netcdf import netcdf_bytes
from wm_drake.simulation.outputs import branch_names, masses_of, others_by_kind, variables_of
from wm_drake.written_files import write_files

Record: TypeAlias = xr.Dataset
"""Outputs of one run over time, in SI units.

The dimensions are time, axis (x, y, z), angle (roll, pitch, yaw), sensor, accelerometer, spring,
damper, bushing and mount (key paths of all that connects tub and cabinet); machines with telescopic
dampers also have tube, those with a cabinet that moves foot. Each variable has its unit in
attrs["units"]. `as_record` makes it.
"""


def as_record(setup: Setup, case: Case, trajectory: Trajectory) -> Record:
    """Return a trajectory as a record: labelled, with the outputs that follow from the motion.

    All displacements are in W and count from the rest pose of the empty machine. If the cabinet
    moves, all but `cabinet_angle` to `foot_slip` are seen from it, in its frame in place of W.
    """
    outputs = variables_of(setup, trajectory) | masses_of(case.load, trajectory)
    variables: dict[str, Any] = {
        name: (dims, values, {"units": unit, "long_name": text})
        for name, (dims, values, unit, text) in outputs.items()
    }
    labels = {
        "axis": AXES,
        "angle": COORDINATES[:3],
        "sensor": setup.sensors,
        "accelerometer": setup.accelerometer_points,
        "spring": setup.springs,
        "damper": (*setup.dampers, *setup.telescopes),
        "bushing": (
            *setup.bushings,
            *(f"{name}_{end}" for name in setup.telescopes for end in ("tub", "housing")),
        ),
        "mount": mount_names(setup.parameters),
        **({"tube": setup.telescopes} if setup.telescopes else {}),
        **({"branch": branches} if (branches := branch_names(setup)) else {}),
        **others_by_kind(setup),
        **({"unbalance": _numbered(case)} if case.load.wet else {}),
        **({"foot": setup.cabinet.cabinet.corners} if setup.cabinet else {}),
    }
    label_coordinates = _label_coordinates(**{name: tuple(of) for name, of in labels.items()})
    variables["time"] = "time", trajectory.time, {"units": "s"}
    attributes = {
        "machine": setup.parameters.name,
        "load": case.name,
        "gasket": "yes" if case.gasket and "gasket" in setup.bushings else "no",
        "rest_pose": setup.rest_pose,
        "parameters": json.dumps(setup.parameters.model_dump(mode="json", exclude={"sources"})),
        "load_parameters": case.load.model_dump_json(),
        "profile": case.profile.model_dump_json(),
        "diverged": divergence_text(trajectory.divergence, trajectory.time, trajectory.state),
    }
    attributes |= {f"version_{name}": version for name, version in versions().items()}
    return xr.Dataset(variables, label_coordinates, attributes)


def _numbered(case: Case) -> list[str]:
    """Return the numbers of the masses of a load, from 1, as texts."""
    return [str(k) for k in range(1, 1 + len(case.load.unbalances))]


@functools.lru_cache(maxsize=16)  # building them takes 2 % of the time of a run
def _label_coordinates(**labels: tuple[str, ...]) -> xr.Coordinates:
    """Return the coordinates of all dimensions except time."""
    return xr.Coordinates({name: list(of) for name, of in labels.items()})


def sample_period(record: Record) -> float:
    """Return the time between the samples of a record; 1 if it has fewer than two samples. [s]"""
    time = record.time.values
    return float(time[1] - time[0]) if len(time) > 1 else 1.0


def why_diverged(record: Record) -> str:
    """Return time and reason if the run of a record diverged, else ""."""
    return str(record.attrs["diverged"])


def rest_pose_of(record: Record) -> FloatArray:
    """Return the rest pose of the tub, to which the poses of a record are relative."""
    return np.asarray(record.attrs["rest_pose"], dtype=float)


def load_of_record(record: Record) -> Load:
    """Return the load of the run of a record, with all its water."""
    return Load.model_validate_json(record.attrs["load_parameters"])


def profile_of(record: Record) -> SpinProfile:
    """Return the spin profile of the run of a record."""
    return _profile_in(record.attrs["profile"])


@functools.lru_cache(maxsize=64)
def _profile_in(text: str) -> SpinProfile:
    """Return the profile of its JSON text."""
    return SpinProfile.model_validate_json(text)


def cabinet_in(record: Record) -> tuple[Cabinet, float] | None:
    """Return cabinet and gravity [m/s^2] of the machine of a record; None without a cabinet."""
    parameters = json.loads(record.attrs.get("parameters", "{}"))
    if not parameters.get("cabinet"):
        return None
    return Cabinet.model_validate(parameters["cabinet"]), float(parameters["gravity"])


MOST_REASON = 150
"""Largest number of characters of the reason why a file cannot be read."""


def save_record(record: Record, path: str | Path) -> None:
    """Write a record to a netCDF file.

    It is not compressed: the numbers fill all digits, so that gzip saves 6 % of the size and
    doubles the time. The file is made in memory first: if HDF5 itself meets a full disk, the
    process crashes.

    Raises:
        InputError: the file cannot be written.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> path = tempfile.mkdtemp() + "/middle.nc"
        >>> wm.save_record(record, path)
        >>> Path(path).exists()
        True
    """
    write_files({Path(path): netcdf_bytes(record)}, replace=True)


def load_record(path: str | Path) -> Record:
    """Read a record that `save_record` wrote.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> path = Path(tempfile.mkdtemp()) / "middle.nc"
        >>> wm.save_record(record, path)
        >>> bool((wm.load_record(path).displacement == record.displacement).all())
        True
    """
    return xr.load_dataset(path, engine="h5netcdf")


def read_measured(path: Path, variables: Mapping[str, tuple[str, ...]]) -> xr.Dataset:
    """Read variables of a record that a user names as a measurement.

    Args:
        path: netCDF file.
        variables: Names of the wanted variables, with their dimensions.

    Raises:
        InputError: the file is no netCDF file, or a variable is missing, has other dimensions, no
            value, or is not made of finite numbers.
    """
    record = _readable(path)
    if isinstance(record, str):
        raise input_error(f"cannot be read as a netCDF record ({record})", where=str(path))
    for name, dims in variables.items():
        if name not in record.variables or record[name].dims != dims:
            fault = "is missing" if name not in record.variables else "has other dimensions"
            need = ", ".join(dims)
            raise input_error(f"{fault}; it needs the dimensions {need}", where=str(path), key=name)
        if record[name].size == 0:
            raise input_error("has no values", where=str(path), key=name)
        if record[name].dtype.kind not in "iuf" or not np.all(np.isfinite(record[name].values)):
            raise input_error("has values that are not finite numbers", where=str(path), key=name)
    if "sensor" in record.dims and "sensor" not in record.coords:
        message = "is missing; it has the names of the sensors"
        raise input_error(message, where=str(path), key="sensor")
    return record[list(variables)]


def _readable(path: Path) -> xr.Dataset | str:
    """Return a record, or why it cannot be read."""
    try:
        # h5netcdf leaves a half-open file behind if the attributes of the file are damaged
        with h5py.File(path, "r") as file:
            dict(file.attrs)
        return xr.load_dataset(path, engine="h5netcdf")
    except Exception as error:  # damaged files end in errors of any kind
        return " ".join(str(error).split())[:MOST_REASON] or "it is damaged"


@functools.cache  # reading them takes more than 10 % of the time of a run
def versions() -> dict[str, str]:
    """Return the versions of the packages that determine a result, by package name."""
    return {
        name: importlib.metadata.version(name)
        for name in ("wm-drake", "drake", "numpy", "scipy", "numba")
    }
