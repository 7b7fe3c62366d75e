"""simulate(machine, case) -> Record: a labelled, unit-carrying dataset of one run."""

import functools
import importlib.metadata
import itertools
import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.compiled_engine import run_compiled
from wm_drake.drake_engine import run_drake
from wm_drake.errors import input_error, nearest_names
from wm_drake.kernel.histories import position_history
from wm_drake.machine import OUTPUT_PERIOD, Machine, Setup
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.elements import FloatArray
from wm_drake.parameters.machine import DEFAULT_STEP as DEFAULT_STEP
from wm_drake.systems.drum_bearing import FORCE_SIZE as BEARING_FORCE_SIZE
from wm_drake.systems.drum_bearing import drum_bearing_history
from wm_drake.systems.friction_damper import friction_damper_history
from wm_drake.systems.six_component_bushing import six_component_bushing_history
from wm_drake.systems.spring_strut import spring_strut_history
from wm_drake.systems.telescopic_damper import FORCE_SIZE, telescopic_damper_history
from wm_drake.trajectory import COORDINATES, Trajectory, divergence_text

Record: TypeAlias = xr.Dataset
"""One run. Dimensions time, axis (x, y, z), angle (roll, pitch, yaw), sensor, accelerometer, spring, damper, bushing; SI, each
variable with its unit in attrs["units"]. See `as_record`."""

Engine: TypeAlias = Callable[[Setup, SpinProfile, float, Callable[[float], None]], Trajectory]

ENGINES: dict[str, Engine] = {"compiled": run_compiled, "drake": run_drake}
DEFAULT_ENGINE = "compiled"

AXES = ("x", "y", "z")


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
            f"no load '{load}' in machine '{parameters.name}'{nearest_names(load, parameters.loads)}", key="loads"
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
    if not step > 0.0 or abs(OUTPUT_PERIOD / step - round(OUTPUT_PERIOD / step)) > 1e-9 or step > OUTPUT_PERIOD:
        raise input_error(f"{step:g} s is not a whole part of the output period {OUTPUT_PERIOD:g} s", key="step")
    return step


def check_bearing(setup: Setup, step: float) -> None:
    """Refuses a step that is too long for the drum's motion in its bearing.

    A sixth of the fastest period: the engines' schemes are stable up to 0.45 (RK4) and 0.27 of it (RK3), and RK4 takes at most
    0.6 % of that motion's amplitude away in a step then.

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
    variables = {
        name: (dims, values, {"units": unit, "long_name": text})
        for name, (dims, values, unit, text) in {**_motion(setup, trajectory), **_forces(setup, trajectory)}.items()
    }
    labels = {
        "time": ("time", trajectory.time, {"units": "s"}),
        "axis": list(AXES),
        "angle": list(COORDINATES[:3]),
        "sensor": list(setup.sensors),
        "accelerometer": list(setup.accelerometer_points),
        "spring": list(setup.springs),
        "damper": [*setup.dampers, *setup.telescopes],
        "bushing": [*setup.bushings, *(f"{name}_{end}" for name in setup.telescopes for end in ("tub", "housing"))],
        **({"tube": list(setup.telescopes)} if setup.telescopes else {}),
    }
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
    return xr.Dataset(variables, labels, attributes)


_Variables: TypeAlias = dict[str, tuple[tuple[str, ...], FloatArray, str, str]]
"""By name: dimensions, values, unit, what it is."""


def _motion(setup: Setup, trajectory: Trajectory) -> _Variables:
    state = trajectory.state
    axes = [AXES.index(sensor.axis) for sensor in setup.sensors.values()]
    points = list(setup.sensor_points.values())
    accelerometers = np.stack(list(setup.accelerometer_points.values()))
    displaced = point_displacements(state, np.stack([*points, setup.detergent_point]), setup.rest_pose)
    moved = [displaced[:, index, axis] for index, axis in enumerate(axes)]
    detergent = displaced[:, -1]
    return (
        _tubes(trajectory)
        | _whirl(setup, trajectory)
        | {
            "tub_angle": (("time", "angle"), state[:, 0:3], "rad", "roll, pitch, yaw of T in W (3-2-1 Euler angles)"),
            "tub_position": (("time", "axis"), state[:, 3:6], "m", "position of To in W"),
            "tub_angular_velocity": (("time", "axis"), state[:, 7:10], "rad/s", "angular velocity of T in W"),
            "tub_velocity": (("time", "axis"), state[:, 10:13], "m/s", "velocity of To in W"),
            "tub_angular_acceleration": (("time", "axis"), trajectory.acceleration[:, :3], "rad/s^2", "rate of it in W"),
            "tub_acceleration": (("time", "axis"), trajectory.acceleration[:, 3:], "m/s^2", "acceleration of To in W"),
            "drum_angle": (("time",), state[:, 6], "rad", "angle of the drum against the tub"),
            "drum_speed": (("time",), state[:, 13], "rad/s", "speed of the drum against the tub"),
            "displacement": (("time", "sensor"), np.stack(moved, axis=1), "m", "displacement at the sensors, along their axes"),
            "sensor_point": (("sensor", "axis"), np.stack(points), "m", "points of the sensors in T"),
            "accelerometer_point": (("accelerometer", "axis"), accelerometers, "m", "points of the vibration sensors in T"),
            "detergent_displacement": (("time", "axis"), detergent, "m", "displacement of the point nearest the detergent box"),
            "damper_deformation": (("time", "damper"), trajectory.deformation, "m", "deformation of the damper's sponge"),
        }
    )


def _tubes(trajectory: Trajectory) -> _Variables:
    """Of machines whose damper tubes are bodies."""
    tubes = trajectory.tubes
    if not tubes.shape[1]:
        return {}
    return {
        "tube_angle": (("time", "tube", "angle"), tubes[:, :, :3], "rad", "roll, pitch, yaw of the outer tubes in W"),
        "tube_position": (("time", "tube", "axis"), tubes[:, :, 3:6], "m", "displacement of their link frames in W"),
        "tube_extension": (("time", "tube"), tubes[:, :, 6], "m", "by how much the damper is longer than drawn"),
    }


def _whirl(setup: Setup, trajectory: Trajectory) -> _Variables:
    """Of machines whose drum can whirl in its bearing."""
    if setup.bearing is None:
        return {}
    carrier, none = trajectory.carrier, np.zeros((len(trajectory.time), 1))
    own = np.empty((len(carrier), BEARING_FORCE_SIZE))
    both = np.hstack([trajectory.state, carrier[:, :6], none, carrier[:, 6:], none])
    drum_bearing_history(both, np.empty((len(carrier), 0)), setup.bearing.packed(), own)
    dims, where = ("time", "axis"), "in the tub's frame, y along the drum axis"
    return {
        "drum_displacement": (dims, own[:, 0:3], "m", f"displacement of the drum axis in the bearing, {where}"),
        "drum_tilt": (dims, own[:, 3:6], "rad", f"rotation of the drum axis against the tub as a vector, {where}"),
        "bearing_force": (dims, own[:, 6:9], "N", f"force of the drum on the tub in the bearing, {where}"),
        "bearing_moment": (dims, own[:, 9:12], "N m", f"moment of the drum on the tub in the bearing, {where}"),
    }


def _forces(setup: Setup, trajectory: Trajectory) -> _Variables:
    springs, dampers, bushings = element_forces(setup, trajectory)
    dims = ("time", "bushing", "axis")
    return {
        "motor_torque": (("time",), trajectory.motor_torque, "N m", "torque of the motor on the drum"),
        "spring_tension": (("time", "spring"), springs, "N", "spring tension"),
        "damper_tension": (("time", "damper"), dampers, "N", "damper tension"),
        "bushing_force": (dims, bushings[:, :, :3], "N", "force of gasket and bushings on the housing"),
        "bushing_moment": (dims, bushings[:, :, 3:], "N m", "moment of gasket and bushings on the housing"),
    }


def element_forces(setup: Setup, trajectory: Trajectory) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Own forces of the elements along a trajectory.

    Returns:
        Spring tensions (n, springs), damper tensions (n, dampers) [N], and force and moment of the bushings on the housing
        (n, bushings, 6) [N, N m]. Of a telescopic damper, its bushing at the tub (on the outer tube), that at the housing.
    """
    states, none = trajectory.state, np.empty((len(trajectory.time), 0))
    springs = np.empty((len(states), len(setup.springs)))
    dampers = np.empty((len(states), len(setup.dampers) + len(setup.telescopes)))
    bushings = np.empty((len(states), len(setup.bushings) + 2 * len(setup.telescopes), 6))
    for index, spring in enumerate(setup.springs.values()):
        spring_strut_history(states, none, spring.packed(), springs[:, index : index + 1])
    for index, damper in enumerate(setup.dampers.values()):
        own = trajectory.deformation[:, index : index + 1]
        friction_damper_history(states, own, damper.packed(), dampers[:, index : index + 1])
    for index, bushing in enumerate(setup.bushings.values()):
        six_component_bushing_history(states, none, bushing.packed(), bushings[:, index])
    for index, telescope in enumerate(setup.telescopes.values()):
        column, first = len(setup.dampers) + index, len(setup.bushings) + 2 * index
        forces, both = np.empty((len(states), FORCE_SIZE)), np.hstack([states, trajectory.tubes[:, index]])
        telescopic_damper_history(both, trajectory.deformation[:, column : column + 1], telescope.packed(), forces)
        dampers[:, column] = forces[:, 0]
        bushings[:, first : first + 2] = forces[:, 1:].reshape(-1, 2, 6)
    return springs, dampers, bushings


def point_displacements(state: FloatArray, points: FloatArray, rest_pose: FloatArray) -> FloatArray:
    """Displacements from the rest pose of points of the tub.

    Args:
        state: (n, >= 6) roll, pitch, yaw, x, y, z. [rad, m]
        points: (k, 3) in T. [m]
        rest_pose: (6,) the same coordinates at rest.

    Returns:
        (n, k, 3) in W. [m]
    """
    displaced = point_positions(state, points)
    displaced -= point_positions(rest_pose[None, :], points)
    return displaced


def point_positions(state: FloatArray, points: FloatArray) -> FloatArray:
    """Positions in W of points of the tub; arguments as in `point_displacements`. (n, k, 3) [m]"""
    positions = np.empty((len(state), 3 * len(points)))
    position_history(np.ascontiguousarray(state[:, :6]), np.ascontiguousarray(points), positions)
    return positions.reshape(len(state), len(points), 3)


def save_record(record: Record, path: Path) -> None:
    """Writes a record as netCDF, compressed."""
    packing = {name: {"compression": "gzip", "compression_opts": 1} for name in record.data_vars if record[name].size}
    record.to_netcdf(path, engine="h5netcdf", encoding=packing)


def load_record(path: Path) -> Record:
    """Reads a record written by `save_record`."""
    return xr.load_dataset(path, engine="h5netcdf")


@functools.cache  # reading them takes longer than a tenth of a run
def versions() -> dict[str, str]:
    """Versions that determine a result."""
    return {name: importlib.metadata.version(name) for name in ("wm-drake", "drake", "numpy", "scipy", "numba")}
