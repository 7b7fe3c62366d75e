"""simulate(machine, case) -> Record: a labelled, unit-carrying dataset of one run."""

import functools
import importlib.metadata
import itertools
import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.drake import run_drake
from wm_drake.engines.trajectory import COORDINATES, Trajectory, divergence_text
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import OUTPUT_PERIOD, Machine, Setup
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.machine import DEFAULT_STEP as DEFAULT_STEP
from wm_drake.simulation.outputs import AXES as AXES
from wm_drake.simulation.outputs import point_displacements as point_displacements
from wm_drake.simulation.outputs import point_positions as point_positions
from wm_drake.simulation.outputs import variables_of

Record: TypeAlias = xr.Dataset
"""One run. Dimensions time, axis (x, y, z), angle (roll, pitch, yaw), sensor, accelerometer, spring, damper, bushing; SI, each
variable with its unit in attrs["units"]. See `as_record`."""

Engine: TypeAlias = Callable[[Setup, SpinProfile, float, Callable[[float], None]], Trajectory]

ENGINES: dict[str, Engine] = {"compiled": run_compiled, "drake": run_drake}
DEFAULT_ENGINE = "compiled"


_LONGEST_BEARING_STEP = 1.0
"""Of the phase of the drum's fastest motion in a bearing that gives. [rad]"""


class DivergenceWarning(UserWarning):
    """A run stopped early; its record says so in attrs["diverged"]."""


@dataclass(frozen=True)
class Case:
    """One run to make: a load, with or without gasket, over a profile, with the machine's numbers or others."""

    name: str
    load: Load
    profile: SpinProfile
    gasket: bool = True
    parameters: MachineParameters | None = None


def case_of(parameters: MachineParameters, load: str, *, gasket: bool = True) -> Case:
    """The case of one of a machine's own loads over its own profile.

    Raises:
        InputError: no such load.
    """
    if load not in parameters.loads:
        raise input_error(
            f"no load '{load}' in machine '{parameters.name}'{nearest_names(load, parameters.loads)}",
            key="loads",
        )
    return Case(load, parameters.loads[load], parameters.profile, gasket)


def simulate(
    machine: Machine,
    case: Case | str,
    engine: str = DEFAULT_ENGINE,
    *,
    step: float | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Record:
    """Runs a machine through a case.

    Args:
        machine: A built machine.
        case: What to run, or the name of one of the machine's loads.
        engine: Name in `ENGINES`.
        step: Integration step, a whole part of the 5 ms between samples; the machine's if None. [s]
        progress: Called now and then with the fraction done.

    Returns:
        The record, sampled every 5 ms from the rest pose at time 0. A run that diverges ends there, warns, and is marked in
        attrs["diverged"].

    Raises:
        InputError: unknown load or engine, step that does not divide the output period, numbers the machine cannot take.
    """
    if engine not in ENGINES:
        raise input_error(f"no engine '{engine}'{nearest_names(engine, ENGINES)}", key="engine")
    step = checked_step(machine.parameters, step)
    if isinstance(case, str):
        case = case_of(machine.parameters, case)
    setup = machine.set_up(case.load, parameters=case.parameters, gasket=case.gasket)
    check_bearing(setup, step)
    trajectory = ENGINES[engine](setup, case.profile, step, progress)
    record = as_record(setup, case, trajectory)
    record.attrs |= {"engine": engine, "step_s": step}
    if trajectory.divergence:
        warnings.warn(record.attrs["diverged"], DivergenceWarning, stacklevel=2)
    return record


def checked_step(parameters: MachineParameters, step: float | None) -> float:
    """The step to integrate with: the machine's if None.

    Raises:
        InputError: it does not divide the output period.
    """
    step = parameters.step if step is None else step
    if (
        not step > 0.0
        or abs(OUTPUT_PERIOD / step - round(OUTPUT_PERIOD / step)) > 1e-9
        or step > OUTPUT_PERIOD
    ):
        raise input_error(
            f"{step:g} s is not a whole part of the output period {OUTPUT_PERIOD:g} s", key="step"
        )
    return step


def check_bearing(setup: Setup, step: float) -> None:
    """Refuses a step that is too long for the drum's motion in its bearing.

    A sixth of the fastest period: RK4 is stable up to 0.45 of it, and takes at most 0.6 % of that motion's amplitude away in a
    step then.

    Args:
        setup: A machine, set up.
        step: Integration step. [s]

    Raises:
        InputError: the step is too long.
    """
    if step * setup.bearing_rate > _LONGEST_BEARING_STEP:
        frequency_hz = setup.bearing_rate / (2.0 * np.pi)
        pieces = int(np.ceil(OUTPUT_PERIOD * setup.bearing_rate / _LONGEST_BEARING_STEP))
        longest = f"{1e3 * OUTPUT_PERIOD / pieces:.4g} ms"
        if 10**9 % pieces:  # no step that can be written out
            pieces = next(more for more in itertools.count(pieces) if 10**9 % more == 0)
            longest += f", such as {1e3 * OUTPUT_PERIOD / pieces:g} ms"
        raise input_error(
            f"{1e3 * step:g} ms is too long for the drum in its bearing, whose fastest motion is at {frequency_hz:.4g} Hz; "
            f"allowed are up to {longest}",
            key="step",
        )


def as_record(setup: Setup, case: Case, trajectory: Trajectory) -> Record:
    """Labels a trajectory and adds the displacements of the sensors and of the point nearest the detergent box.

    Displacements are from the rest pose of the empty machine, in W.
    """
    variables: dict[str, Any] = {
        name: (dims, values, {"units": unit, "long_name": text})
        for name, (dims, values, unit, text) in variables_of(setup, trajectory).items()
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
        **({"tube": setup.telescopes} if setup.telescopes else {}),
    }
    coordinates = _coordinates(**{name: tuple(of) for name, of in labels.items()})
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
    return xr.Dataset(variables, coordinates, attributes)


@functools.lru_cache(maxsize=16)  # to build them takes a fiftieth of a run
def _coordinates(**labels: tuple[str, ...]) -> xr.Coordinates:
    """Of all dimensions but time."""
    return xr.Coordinates({name: list(of) for name, of in labels.items()})


def save_record(record: Record, path: Path) -> None:
    """Writes a record as netCDF, compressed."""
    packing = {
        name: {"compression": "gzip", "compression_opts": 1}
        for name in record.data_vars
        if record[name].size
    }
    record.to_netcdf(path, engine="h5netcdf", encoding=packing)


def load_record(path: Path) -> Record:
    """Reads a record written by `save_record`."""
    return xr.load_dataset(path, engine="h5netcdf")


@functools.cache  # reading them takes longer than a tenth of a run
def versions() -> dict[str, str]:
    """Versions that determine a result."""
    return {
        name: importlib.metadata.version(name)
        for name in ("wm-drake", "drake", "numpy", "scipy", "numba")
    }
