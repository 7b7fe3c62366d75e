"""The reference engine: Drake's Simulator on the machine's diagram, at fixed steps."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from wm_drake.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.systems.element import PLANT_STATE_SIZE
from wm_drake.systems.speed_source import REFLECTED_INERTIA
from wm_drake.trajectory import Trajectory, diverging_coordinate, ended_where_it_diverged

PAUSE_PERIOD = 0.5
"""Simulated time between looks at the state and reports of progress. [s]"""


def run_drake(setup: Setup, profile: SpinProfile, step: float, progress: Callable[[float], None]) -> Trajectory:
    """Runs a machine through a spin profile with Drake's explicit third-order Runge-Kutta at a fixed step.

    Steps end at every output time and at every corner of the profile, so no step sees the acceleration jump.

    Args:
        setup: Machine at rest in its Context; the Context is advanced.
        profile: Drum speed over time.
        step: Integration step. [s]
        progress: Called with the fraction done.

    Returns:
        The motion sampled at the output period; up to the last good sample if it diverged.
    """
    machine, context = setup.machine, setup.context
    plant_context = setup.plant_context
    machine.plant.GetJointByName(setup.parameters.drive.joint).set_angular_rate(plant_context, profile.speed[0])
    simulator = Simulator(machine.diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", step).set_fixed_step_mode(True)
    source_context = machine.source.GetMyContextFromRoot(context)
    machine.source.set_acceleration(source_context, profile.acceleration()[0])
    _held = machine.handles(context)  # until this function returns
    failure = ""
    try:
        simulator.Initialize()
        for begin, end, acceleration in zip(profile.time, profile.time[1:], profile.acceleration(), strict=False):
            machine.source.set_acceleration(source_context, acceleration)
            for pause in _pauses(begin, end):
                simulator.AdvanceTo(pause)
                progress(pause / profile.duration)
                if diverging_coordinate(machine.plant.GetPositions(plant_context)):
                    return _logged(setup, profile, failure)
        simulator.AdvancePendingEvents()
    except RuntimeError as error:  # Drake refuses a state that is not a number
        failure = str(error).splitlines()[0]
    return _logged(setup, profile, failure)


def _pauses(begin: float, end: float) -> list[float]:
    """Times at which to look up and report in a piece of the profile, and its end."""
    inner = np.arange(np.floor(begin / PAUSE_PERIOD) + 1, np.ceil(end / PAUSE_PERIOD)) * PAUSE_PERIOD
    return [*map(float, inner), end]


def _logged(setup: Setup, profile: SpinProfile, failure: str) -> Trajectory:
    logs = {name: sink.FindLog(setup.context) for name, sink in setup.machine.logs.items()}
    count = min(log.num_samples() for log in logs.values())  # a run that failed may have ended between two logs
    time = np.array(logs["bodies"].sample_times()[:count])
    columns = {name: np.array(log.data()).T[:count] for name, log in logs.items()}
    coordinates = setup.machine.coordinates
    # the drive's torque is what its reflected inertia does not take up: J alpha - J vdot
    segment = np.clip(np.searchsorted(profile.time, time, side="right") - 1, 0, len(profile.time) - 2)
    torque = REFLECTED_INERTIA * (np.array(profile.acceleration())[segment] - columns["acceleration"][:, coordinates.drum])
    dampers = [*setup.dampers, *setup.telescopes]
    deformation = np.zeros((len(time), len(dampers)))
    for index, name in enumerate(dampers):
        if name in columns:
            deformation[:, index] = columns[name][:, 0]
    count = len(setup.telescopes)
    trees = [columns["bodies"][:, indices] for indices in coordinates.states()]
    tubes = np.stack(trees[1 : 1 + count], axis=1) if count else np.empty((len(time), 0, PLANT_STATE_SIZE))
    carrier = columns["bodies"][:, [*coordinates.carrier, *(coordinates.size + coordinates.carrier)]]
    trajectory = Trajectory(time, trees[0], deformation, torque, columns["acceleration"][:, coordinates.tub], tubes, carrier)
    return ended_where_it_diverged(trajectory, failure)
