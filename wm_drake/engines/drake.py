"""The reference engine: pydrake's Simulator steps the diagram of the machine."""

import functools
from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import InitializeParams, ResetIntegratorFromFlags, Simulator

from wm_drake.elements.cabinet import SLIP_SIZE
from wm_drake.engines.cabinet_frame import seen_from_cabinet
from wm_drake.engines.memory import check_size
from wm_drake.engines.schedule import output_times
from wm_drake.engines.trajectory import Trajectory, cut_at_divergence, diverging_coordinate
from wm_drake.errors import shortened
from wm_drake.model.machine import Machine, MachineSystems, Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray

INTEGRATION_SCHEME = "runge_kutta3"
"""Drake's explicit scheme of third order with error control: friction has kinks, across which a
higher order gains nothing (docs/theory/integrator.md)."""

ACCURACY = 3e-4
"""Target accuracy of a step, relative to unit coordinates. Peaks of the shipped washing
machines that were measured differ from converged ones by less than 0.1 %, those of the rotor rig by
0.15 % (docs/theory/integrator.md)."""

ACCURATE = 1e-5
"""Target accuracy of the engine `drake-accurate`: peaks within 0.01 %."""

PEAKS_WITHIN = {"drake": 1e-3, "drake-accurate": 1e-4}
"""Relative error of peaks by engine, of `reference` (docs/theory/integrator.md)."""

LARGEST_STEPS = 2.0
"""Largest step of the error control over the step of the machine, which is half a sample."""

SMALLEST_STEP = 5e-5
"""Smallest step of the error control, which is accepted with any error. [s] Coulomb friction jumps
where the velocity changes its sign. No step across such a jump is short enough."""

SAMPLES_BETWEEN_CHECKS = 100
"""Samples between checks for divergence and reports of progress: half a second of motion."""


def advance_to(simulator: Simulator, time: float, profile: SpinProfile) -> None:
    """Advance a simulation so that no step contains a corner of the spin profile.

    The drum's acceleration jumps at a corner. Drake evaluates the last stage of a step at its end,
    where the next piece is already in force. So the step ends just before the corner, and then the
    time is set to the corner. A plain `AdvanceTo` is right within the accuracy of the integrator.

    Args:
        simulator: Simulation of a diagram that contains the machine.
        time: When to stop. [s]
        profile: The spin profile that the machine follows in the simulation's Context.

    Example:
        >>> import wm_drake as wm
        >>> from pydrake.systems.analysis import Simulator
        >>> machine = wm.build_machine(wm.load_machine("reference"))
        >>> setup = machine.set_up("middle")
        >>> simulator = Simulator(machine.diagram, setup.context)
        >>> wm.advance_to(simulator, 0.05, machine.parameters.profile)
        >>> simulator.get_context().get_time()
        0.05
    """
    context = simulator.get_mutable_context()
    for corner in profile.time[1:]:
        if context.get_time() < corner <= time:
            simulator.AdvanceTo(np.nextafter(corner, -np.inf))
            context.SetTime(corner)
            simulator.Initialize(InitializeParams(suppress_initialization_events=True))
    simulator.AdvanceTo(max(time, context.get_time()))


def run_drake(
    setup: Setup,
    profile: SpinProfile,
    step: float,
    progress: Callable[[float], None],
    *,
    scheme: str = INTEGRATION_SCHEME,
    accuracy: float | None = ACCURACY,
    largest: float = LARGEST_STEPS,
) -> Trajectory:
    """Run a machine through a spin profile with pydrake's Simulator.

    Args:
        setup: Machine at rest in its Context; the Context is used for the run.
        profile: Drum speed over time.
        step: Step without error control; of that, `largest` steps are the largest one. [s]
        progress: Called with the fraction done.
        scheme: Name of one of Drake's integration schemes.
        accuracy: Target accuracy of the error control; None for fixed steps.
        largest: Largest step of the error control, in steps.

    Returns:
        The motion sampled at the output period, up to the last good sample if it diverged.
    """
    setup.machine.set_profile(setup.context, profile, setup.elements)
    longest = step if accuracy is None else largest * step
    simulator = _simulator(setup, longest, scheme, accuracy)
    period = profile.sample_period(setup.parameters.output_period)
    check_size(profile, step, period)
    samples = _Samples(setup, output_times(profile, period))
    dries, failure = bool(setup.load and setup.load.wet), ""
    is_sampled = bool(setup.motor and setup.motor.controller.sample_time)
    try:
        for row, time in enumerate(samples.time):
            advance_to(simulator, time, profile)
            if is_sampled:  # the controller acts before the sample is taken
                simulator.AdvancePendingEvents()
            if dries:
                setup.follow_water()
            samples.take(row)
            if dries:
                setup.follow_water(0.5 * period)
            if row % SAMPLES_BETWEEN_CHECKS == 0:
                if diverging_coordinate(*samples.poses()) is not None:
                    break
                progress(time / profile.duration)
        progress(1.0)
    except RuntimeError as error:  # Drake raises if the state is not finite
        failure = shortened(str(error).partition("\n")[0], 200)
    return samples.trajectory(failure)


run_drake_accurately = functools.partial(run_drake, accuracy=ACCURATE, largest=1.0)
"""`run_drake` with less than a tenth of the error, in twice the time."""


def _simulator(setup: Setup, step: float, scheme: str, accuracy: float | None) -> Simulator:
    """Return an initialized Simulator of the machine's diagram in the Context of a setup."""
    assert isinstance(setup.machine, Machine)  # a diagram of its own, not part of a user's
    simulator = Simulator(setup.machine.diagram, setup.context)
    integrator = ResetIntegratorFromFlags(simulator, scheme, step)
    if accuracy is None:
        integrator.set_fixed_step_mode(True)
    else:
        integrator.set_target_accuracy(accuracy)
        first = 0.1 * step
        integrator.request_initial_step_size_target(first)
        integrator.set_requested_minimum_step_size(min(SMALLEST_STEP, first))
        integrator.set_throw_on_minimum_step_size_violation(False)
    simulator.Initialize()
    return simulator


class _Samples:
    """States, accelerations and motor torque of a run at the output times; NaN until taken."""

    def __init__(self, setup: Setup, time: FloatArray) -> None:
        self._machine: MachineSystems = setup.machine
        self._setup, self.time = setup, time
        size = self._machine.state_layout.size
        dampers = {**self._machine.dampers, **self._machine.telescopes}
        self._sponges = [
            (column, damper, damper.GetMyContextFromRoot(setup.context))
            for column, damper in enumerate(dampers.values())
            if damper.state_size
        ]
        self._branches = [
            (bushing, bushing.GetMyContextFromRoot(setup.context))
            for bushing in self._machine.bushings.values()
            if bushing.state_size
        ]
        stretches = sum(bushing.state_size for bushing, _ in self._branches)
        self._stretches = np.zeros((len(time), stretches))
        self._others = [
            (element, element.GetMyContextFromRoot(setup.context))
            for element in self._machine.others.values()
            if element.state_size
        ]
        others = sum(element.state_size for element, _ in self._others)
        self._element_states = np.zeros((len(time), others))
        self._plant_context = setup.plant_context
        self._torque = self._machine.outputs["motor_torque"]
        self._torque_context = self._torque.get_system().GetMyContextFromRoot(setup.context)
        self._state = np.full((len(time), 2 * size), np.nan)
        self._rate = np.full((len(time), size), np.nan)
        self._deformation = np.zeros((len(time), len(dampers)))
        self._motor_torque = np.full(len(time), np.nan)
        self._slips = np.full((len(time), SLIP_SIZE), np.nan)
        wet = len(setup.load.wet) if setup.load else 0
        self._water = np.full((len(time), wet), np.nan) if wet else None

    def poses(self) -> tuple[FloatArray, FloatArray | None]:
        """Return roll, pitch, yaw, x, y, z of the tub now, seen from the cabinet [rad, m].

        Roll and pitch of the cabinet follow, None if it is fixed. [rad]
        """
        cabinet, layout = self._machine.cabinet, self._machine.state_layout
        positions = np.asarray(self._machine.plant.GetPositions(self._plant_context))
        if cabinet is not None:
            seen = self._machine.outputs["tub_in_cabinet"]
            tub = np.asarray(seen.Eval(cabinet.GetMyContextFromRoot(self._setup.context))[:6])
            return tub, positions[layout.cabinet[:2]]
        return positions[layout.tub], None

    def take(self, row: int) -> None:
        """Write the sample of the Context's state to a row."""
        plant = self._machine.plant
        self._state[row] = plant.GetPositionsAndVelocities(self._plant_context)
        self._rate[row] = plant.get_generalized_acceleration_output_port().Eval(self._plant_context)
        for column, damper, context in self._sponges:
            self._deformation[row, column] = damper.GetOutputPort("state").Eval(context)[0]
        if self._branches:
            self._stretches[row] = np.concatenate(
                [bush.GetOutputPort("state").Eval(context) for bush, context in self._branches]
            )
        if self._others:
            self._element_states[row] = np.concatenate(
                [element.GetOutputPort("state").Eval(context) for element, context in self._others]
            )
        self._motor_torque[row] = self._torque.Eval(self._torque_context)[0]
        water = self._machine.water
        if self._water is not None and water is not None:
            context = water.GetMyContextFromRoot(self._setup.context)
            left = context.get_continuous_state_vector().CopyToVector()
            self._water[row] = left[: self._water.shape[1]]
        feet = self._machine.feet
        if feet is not None:
            context = feet.GetMyContextFromRoot(self._setup.context)
            self._slips[row] = feet.GetOutputPort("state").Eval(context)

    def trajectory(self, failure: str) -> Trajectory:
        """Return the motion up to the last good sample.

        Args:
            failure: Message of the error that stopped the run, if any.
        """
        layout, telescopes = self._machine.state_layout, len(self._setup.telescopes)
        trees = [self._state[:, indices] for indices in layout.states()]
        tubes = np.empty((len(self.time), 0, trees[0].shape[1]))
        if telescopes:
            tubes = np.stack(trees[1 : 1 + telescopes], axis=1)
        tub, carrier, cabinet = (
            self._state[:, [*body, *(layout.size + body)]]
            for body in (layout.tub, layout.carrier, layout.cabinet)
        )
        state, of_tub, moving = trees[0], self._rate[:, layout.tub], None
        if layout.cabinet.size:
            in_world = cabinet, self._rate[:, layout.cabinet]
            tub, of_tub = seen_from_cabinet(*in_world, tub, of_tub)
            state = np.column_stack([tub[:, :6], state[:, 6], tub[:, 6:], state[:, 13]])
            if carrier.shape[1]:
                carrier, _ = seen_from_cabinet(*in_world, carrier, self._rate[:, layout.carrier])
            moving = np.column_stack([cabinet, self._slips])
        columns = self.time, state, self._deformation, self._motor_torque, of_tub, tubes, carrier
        trajectory = Trajectory(
            *columns,
            self._stretches,
            cabinet=moving,
            element_states=self._element_states,
            water=self._water,
        )
        return cut_at_divergence(trajectory, failure)
