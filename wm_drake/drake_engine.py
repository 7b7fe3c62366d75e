"""The reference engine: Drake's Simulator on the machine's diagram, at fixed steps."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, EventStatus

from wm_drake.machine import Machine, Setup
from wm_drake.parameters import SpinProfile
from wm_drake.systems.speed_source import REFLECTED_INERTIA
from wm_drake.trajectory import Divergence, Trajectory, diverging_coordinate

PROGRESS_PERIOD = 0.5
"""Simulated time between progress reports. [s]"""


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
    divergence = _watch(simulator, machine)
    source_context = machine.source.GetMyContextFromRoot(context)
    machine.source.set_acceleration(source_context, profile.acceleration()[0])
    try:
        simulator.Initialize()
        for begin, end, acceleration in zip(profile.time, profile.time[1:], profile.acceleration(), strict=False):
            machine.source.set_acceleration(source_context, acceleration)
            for pause in _pauses(begin, end):
                simulator.AdvanceTo(pause)
                progress(pause / profile.duration)
                if divergence:
                    break
        simulator.AdvancePendingEvents()
    except RuntimeError as error:  # the plant refuses a state that is not a number
        if not divergence:
            divergence.append(Divergence(context.get_time(), "state", f"Drake: {str(error).splitlines()[0]}"))
    return _logged(setup, profile, divergence[0] if divergence else None)


def _pauses(begin: float, end: float) -> list[float]:
    """Times at which to report progress in a piece of the profile, and its end."""
    inner = np.arange(np.floor(begin / PROGRESS_PERIOD) + 1, np.ceil(end / PROGRESS_PERIOD)) * PROGRESS_PERIOD
    return [*map(float, inner), end]


def _watch(simulator: Simulator, machine: Machine) -> list[Divergence]:
    """Ends the run at the first step that leaves the region where the model means anything; tells of it in the list."""
    found: list[Divergence] = []

    def monitor(context: Context) -> EventStatus:
        positions = machine.plant.GetPositions(machine.plant.GetMyContextFromRoot(context))
        reason = diverging_coordinate(positions)
        if reason is None:
            return EventStatus.DidNothing()
        found.append(Divergence(context.get_time(), *reason))
        return EventStatus.ReachedTermination(machine.diagram, found[0].reason)

    simulator.set_monitor(monitor)
    return found


def _logged(setup: Setup, profile: SpinProfile, divergence: Divergence | None) -> Trajectory:
    data = {name: sink.FindLog(setup.context) for name, sink in setup.machine.logs.items()}
    time = np.array(data["state"].sample_times())
    state = np.array(data["state"].data()).T
    good = np.array([diverging_coordinate(q) is None for q in state[:, :7]]) if divergence else slice(None)
    rows = {name: np.array(log.data()).T[good] for name, log in data.items()}
    # the drive's torque is what its reflected inertia does not take up: J alpha - J vdot
    segment = np.clip(np.searchsorted(profile.time, time[good], side="right") - 1, 0, len(profile.time) - 2)
    alpha = np.array(profile.acceleration())[segment]
    torque = REFLECTED_INERTIA * (alpha - rows.pop("acceleration")[:, 6])
    return Trajectory(time[good], rows.pop("state"), torque, rows, divergence)
