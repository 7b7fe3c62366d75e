"""The reference engine: Drake's derivatives of the machine's diagram, at fixed steps of the classical Runge-Kutta scheme."""

from collections.abc import Callable

import numpy as np

from wm_drake.elements.motion import PLANT_STATE_SIZE
from wm_drake.engines.schedule import Schedule, schedule_of
from wm_drake.engines.trajectory import Trajectory, diverging_coordinate, ended_where_it_diverged
from wm_drake.model.machine import OUTPUT_PERIOD, Machine, Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.speed_source import REFLECTED_INERTIA

PAUSE_STEPS = 200
"""Steps between looks at the state and reports of progress: half a second of motion at the default step."""


def run_drake(
    setup: Setup, profile: SpinProfile, step: float, progress: Callable[[float], None]
) -> Trajectory:
    """Runs a machine through a spin profile with Drake's model of it.

    Drake's Simulator has no scheme of fourth order at fixed steps that takes fewer than six derivatives a step. With that of
    the compiled engine, four, the engines differ by their mechanics alone. Steps end at every output time and at every corner
    of the profile, so no step sees the acceleration jump.

    Args:
        setup: Machine at rest in its Context; the Context is used for the run.
        profile: Drum speed over time.
        step: Integration step. [s]
        progress: Called with the fraction done.

    Returns:
        The motion sampled at the output period; up to the last good sample if it diverged.
    """
    machine = setup.machine
    machine.plant.GetJointByName(setup.parameters.drive.joint).set_angular_rate(
        setup.plant_context, profile.speed[0]
    )
    schedule = schedule_of(profile, step, OUTPUT_PERIOD)
    motion, steps = _Motion(setup), len(schedule.step)
    samples = np.full((2, len(schedule.time), len(motion.state)), np.nan)
    done, failure = 0, ""
    try:
        with machine.held(setup.context):
            while (
                done < steps
                and diverging_coordinate(machine.plant.GetPositions(setup.plant_context)) is None
            ):
                begin, done = done, min(done + PAUSE_STEPS, steps)
                _integrate(motion, schedule, begin, done, samples)
                progress(done / steps)
    except RuntimeError as error:  # Drake refuses a state that is not a number
        failure = str(error).splitlines()[0]
    return _trajectory(setup, schedule, samples, failure)


class _Motion:
    """Continuous state of a diagram, its derivative, and the acceleration of the drum."""

    def __init__(self, setup: Setup) -> None:
        self._context, self._derivatives = setup.context, setup.machine.diagram.EvalTimeDerivatives
        self._source = setup.machine.source
        self._source_context = self._source.GetMyContextFromRoot(self._context)
        self._acceleration = np.nan
        self.state = self._context.get_continuous_state_vector().CopyToVector()

    def accelerate(self, acceleration: float) -> None:
        """Sets the drum's acceleration. [rad/s^2]"""
        if acceleration != self._acceleration:
            self._source.set_acceleration(self._source_context, acceleration)
            self._acceleration = acceleration

    def derivative(self, state: FloatArray) -> FloatArray:
        """Of any state."""
        self._context.SetContinuousState(state)
        return self._derivatives(self._context).CopyToVector()

    def advance(self, rate: FloatArray, h: float) -> None:
        """By a step h, from its derivative here. [s]"""
        x, derivative, half = self.state, self.derivative, 0.5 * h
        second = derivative(x + half * rate)
        third = derivative(x + half * second)
        fourth = derivative(x + h * third)
        self.state = x + h / 6.0 * (rate + 2.0 * (second + third) + fourth)


def _integrate(
    motion: _Motion, schedule: Schedule, begin: int, end: int, samples: FloatArray
) -> None:
    """Steps a motion from the begin of one step of a schedule to that of another; writes the samples on the way."""
    columns = schedule.step, schedule.acceleration, schedule.row
    for h, acceleration, row in zip(
        *(column[begin:end].tolist() for column in columns), strict=True
    ):
        motion.accelerate(acceleration)
        rate = motion.derivative(motion.state)
        if row >= 0:
            samples[0, row], samples[1, row] = motion.state, rate
        if h > 0.0:
            motion.advance(rate, h)


def _trajectory(setup: Setup, schedule: Schedule, samples: FloatArray, failure: str) -> Trajectory:
    """Motion up to the last good sample.

    Args:
        samples: (2, rows, size of the diagram's state) states and their derivatives; NaN behind the end of a run.
        failure: What stopped the run, if something did.
    """
    states, rates = samples
    bodies, sponges = _places_of_state(setup.machine)
    state_layout = setup.machine.state_layout
    velocities = bodies[state_layout.size :]
    # the drive's torque is what its reflected inertia does not take up: J alpha - J vdot
    wanted = schedule.acceleration[schedule.row >= 0]
    torque = REFLECTED_INERTIA * (wanted - rates[:, velocities[state_layout.drum]])
    dampers = [*setup.dampers, *setup.telescopes]
    deformation = np.zeros((len(states), len(dampers)))
    for index, name in enumerate(dampers):
        if name in sponges:
            deformation[:, index] = states[:, sponges[name]]
    trees = [states[:, bodies[indices]] for indices in state_layout.states()]
    count = len(setup.telescopes)
    tubes = (
        np.stack(trees[1 : 1 + count], axis=1)
        if count
        else np.empty((len(states), 0, PLANT_STATE_SIZE))
    )
    carrier = states[
        :, bodies[[*state_layout.carrier, *(state_layout.size + state_layout.carrier)]]
    ]
    acceleration = rates[:, velocities[state_layout.tub]]
    trajectory = Trajectory(
        schedule.time, trees[0], deformation, torque, acceleration, tubes, carrier
    )
    return ended_where_it_diverged(trajectory, failure)


def _places_of_state(machine: Machine) -> tuple[np.ndarray, dict[str, int]]:
    """Where the diagram's state has that of the plant, and the sponge of each damper that has one: as the systems see it."""
    context = machine.diagram.CreateDefaultContext()
    context.SetContinuousState(np.arange(context.num_continuous_states(), dtype=float))
    bodies = machine.plant.GetPositionsAndVelocities(
        machine.plant.GetMyContextFromRoot(context)
    ).astype(int)
    with_state = {
        name: damper
        for name, damper in (machine.dampers | machine.telescopes).items()
        if damper.state_size
    }
    sponges = {
        name: int(damper.GetOutputPort("state").Eval(damper.GetMyContextFromRoot(context))[0])
        for name, damper in with_state.items()
    }
    return bodies, sponges
