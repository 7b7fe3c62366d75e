"""The machine in the hands of a Drake user: ports, Simulator, logs, Meshcat, linearization, AutoDiff."""

import gc
import struct

import numpy as np
import pytest
from moving_cabinet import with_moving_cabinet
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, Linearize, LogVectorOutput

from wm_drake import add_washing_machine, advance_to, build_machine
from wm_drake.elements.spin_profile import drum_motion
from wm_drake.errors import InputError
from wm_drake.parameters import SpinProfile

RPM = 2.0 * np.pi / 60.0
CORNERED = SpinProfile(time=(0.0, 0.3337, 0.7, 1.0), speed=(0.0, 300 * RPM, 100 * RPM, 250 * RPM))


def speed_error_rpm(machine, simulator, end, profile):
    """Return the largest difference of drum speed and profile in a plain AdvanceTo."""
    port, errors = machine.diagram.GetOutputPort("drum_speed"), []

    def monitor(context):
        wanted, _ = drum_motion(profile, np.array([context.get_time()]))
        errors.append(abs(port.Eval(context)[0] - wanted[0]) / RPM)

    simulator.set_monitor(monitor)
    simulator.AdvanceTo(end)
    return max(errors)


@pytest.mark.parametrize(("scheme", "step"), [("runge_kutta3", 0.1), ("runge_kutta5", 0.05)])
def test_a_plain_simulator_follows_the_profile(machine, scheme, step):
    simulator = Simulator(machine.diagram)
    machine.set_up("middle", context=simulator.get_mutable_context())
    ResetIntegratorFromFlags(simulator, scheme, step)
    assert speed_error_rpm(machine, simulator, 4.0, machine.parameters.profile) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "fixed_step"),
    [("runge_kutta3", None), ("runge_kutta3", 2e-3), ("runge_kutta2", 2e-3)],
)
def test_a_plain_simulator_follows_a_run_up_to_its_end(machine, scheme, fixed_step):
    """Run up by 7 rpm/s as the machine does, to a corner between two steps, and hold the speed."""
    profile = SpinProfile(time=(0.0, 71.0 / 7.0, 12.0), speed=(0.0, 71.0 * RPM, 71.0 * RPM))
    simulator = Simulator(machine.diagram, machine.set_up("middle", profile=profile).context)
    if fixed_step:
        ResetIntegratorFromFlags(simulator, scheme, fixed_step).set_fixed_step_mode(True)
    assert speed_error_rpm(machine, simulator, profile.duration, profile) < 0.01


def test_the_helper_is_exact_across_sharp_corners(machine):
    setup = machine.set_up("middle", profile=CORNERED)
    simulator = Simulator(machine.diagram, setup.context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 5e-3).set_fixed_step_mode(True)
    port = machine.diagram.GetOutputPort("drum_speed")
    for time in (0.25, 0.5, 0.7, 0.95, 1.0):
        advance_to(simulator, time, CORNERED)
        wanted, angle = drum_motion(CORNERED, np.array([time]))
        assert setup.context.get_time() == time
        assert port.Eval(setup.context)[0] == pytest.approx(wanted[0], abs=1e-5 * RPM)
        state = machine.diagram.GetOutputPort("state").Eval(setup.context)
        assert state[machine.state_layout.drum] == pytest.approx(angle[0], abs=1e-6)


def test_a_plain_step_across_a_sharp_corner_is_not_exact(machine):
    """Show what the helper is for: fixed steps of 5 ms miss this corner by much more."""
    setup = machine.set_up("middle", profile=CORNERED)
    simulator = Simulator(machine.diagram, setup.context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 5e-3).set_fixed_step_mode(True)
    simulator.AdvanceTo(0.5)
    wanted, _ = drum_motion(CORNERED, np.array([0.5]))
    speed = machine.diagram.GetOutputPort("drum_speed").Eval(setup.context)[0]
    assert abs(speed - wanted[0]) > 0.1 * RPM


def test_outputs_can_be_logged(reference):
    builder = DiagramBuilder()
    washer = add_washing_machine(builder, reference)
    log = LogVectorOutput(washer.outputs["displacement"], builder, publish_period=0.01)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    washer.set_up("middle", context=context)
    Simulator(diagram, context).AdvanceTo(2.0)
    data = log.FindLog(context)
    assert data.data().shape == (len(reference.sensors), 201)
    assert np.all(data.data()[:, 0] == pytest.approx(0.0, abs=1e-12))
    assert np.max(np.abs(data.data())) > 1e-5  # m


def test_a_user_system_closes_a_loop_around_the_motor(reference):
    """Hold 60 rpm by a proportional speed controller in place of the spin profile."""

    class Controller(LeafSystem):
        def __init__(self):
            super().__init__()
            self.DeclareVectorInputPort("speed", 1)
            self.DeclareVectorOutputPort("acceleration", 1, self.calc)

        def calc(self, context, output):
            speed = self.get_input_port().Eval(context)
            output.SetFromVector(20.0 * (60.0 * RPM - speed))

    builder = DiagramBuilder()
    washer = add_washing_machine(builder, reference)
    controller = builder.AddSystem(Controller())
    builder.Connect(washer.outputs["drum_speed"], controller.get_input_port())
    builder.Connect(controller.get_output_port(), washer.inputs["drum_acceleration"])
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    washer.set_up("middle", context=context)
    Simulator(diagram, context).AdvanceTo(1.0)
    system = washer.outputs["drum_speed"].get_system()
    speed = washer.outputs["drum_speed"].Eval(system.GetMyContextFromRoot(context))[0]
    assert speed == pytest.approx(60.0 * RPM, rel=1e-4)


def test_a_disturbance_can_be_connected_to_the_tub(reference):
    builder = DiagramBuilder()
    washer = add_washing_machine(builder, reference)
    push = builder.AddSystem(ConstantVectorSource([0.0, 0.0, 0.0, 30.0, 0.0, 0.0]))
    builder.Connect(push.get_output_port(), washer.inputs["tub_force"])
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    washer.set_up(context=context)
    Simulator(diagram, context).AdvanceTo(0.05)
    assert washer.plant.GetPositions(washer.plant.GetMyContextFromRoot(context))[3] > 1e-4  # m


def test_a_fixed_input_pushes_the_tub(machine):
    setup = machine.set_up()
    free = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()
    machine.diagram.GetInputPort("tub_force").FixValue(setup.context, [0, 0, 0, 0, 0, 50.0])
    pushed = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()
    mass = sum(
        machine.plant.get_body(index).get_mass(setup.plant_context)
        for index in machine.plant.GetBodyIndices(
            machine.plant.GetBodyByName("tub").model_instance()
        )
        if machine.plant.get_body(index).name() not in ("housing",)
    )
    assert pushed[12] - free[12] > 0.8 * 50.0 / mass  # rotation takes a little of it


def test_a_fixed_drum_acceleration_replaces_the_profile(machine):
    setup = machine.set_up("middle")
    port = machine.diagram.GetInputPort("drum_acceleration")
    profile = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()[13]
    port.FixValue(setup.context, [3.0])
    fixed = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()[13]
    assert profile == pytest.approx(machine.parameters.profile.acceleration()[0], rel=1e-6)
    assert fixed == pytest.approx(3.0, rel=1e-6)


def test_two_contexts_of_one_diagram_in_alternation(machine):
    """Check that what one Context holds does not reach the other."""
    alone = []
    for load in ("middle", "counter"):
        context = machine.set_up(load).context
        simulator = Simulator(machine.diagram, context)
        for time in (0.5, 1.0):  # a stop changes the steps
            simulator.AdvanceTo(time)
        alone.append(context.get_continuous_state_vector().CopyToVector())
    contexts = [machine.set_up(load).context for load in ("middle", "counter")]
    simulators = [Simulator(machine.diagram, context) for context in contexts]
    for time in (0.5, 1.0):
        for simulator in simulators:
            simulator.AdvanceTo(time)
    for context, expected in zip(contexts, alone, strict=True):
        found = context.get_continuous_state_vector().CopyToVector()
        np.testing.assert_array_equal(found, expected)
    assert np.max(np.abs(alone[0][:6] - alone[1][:6])) > 1e-4  # the two runs differ


def test_linearize_with_motor_in_and_sensors_out(machine):
    """Linearize at rest without dampers: the drum integrates its acceleration, sensors follow."""
    setup = machine.set_up("middle", dampers=False)
    machine.diagram.GetInputPort("drum_acceleration").FixValue(setup.context, [0.0])
    machine.diagram.GetInputPort("tub_force").FixValue(setup.context, np.zeros(6))
    residual = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()
    system = Linearize(
        machine.diagram,
        setup.context,
        machine.diagram.GetInputPort("drum_acceleration").get_index(),
        machine.diagram.GetOutputPort("displacement").get_index(),
        equilibrium_check_tolerance=np.max(np.abs(residual)) + 1e-9,
    )
    drum = machine.state_layout.drum
    size = machine.state_layout.size
    assert system.B()[size + drum, 0] == pytest.approx(1.0, rel=1e-6)
    assert system.C().shape == (len(setup.sensors), setup.context.num_continuous_states())
    sensor = list(setup.sensors).index("Xr")
    assert system.C()[sensor, 3] == pytest.approx(1.0)  # x of the tub


def test_derivatives_by_state_are_those_of_finite_differences(machine):
    setup = machine.set_up("middle", gasket=True)
    rng = np.random.default_rng(3)
    count = setup.context.num_continuous_states()
    x = rng.uniform(-1.0, 1.0, count) * np.array(
        [0.02] * 3 + [5e-3] * 3 + [3.0] + [0.5] * 3 + [0.2] * 3 + [20.0] + [1e-4] * (count - 14)
    )
    machine.set_drum_acceleration(setup.context, 0.5)

    def rate(state):
        setup.context.SetContinuousState(state)
        return machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()

    differences = np.column_stack(
        [(rate(x + step) - rate(x - step)) / 2e-7 for step in 1e-7 * np.eye(count)]
    )
    rate(x)
    diagram = machine.diagram.ToAutoDiffXd()
    context = diagram.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(setup.context)
    diagram.GetInputPort("drum_acceleration").FixValue(context, [AutoDiffXd(0.5)])
    context.SetContinuousState(InitializeAutoDiff(x).ravel())
    exact = ExtractGradient(diagram.EvalTimeDerivatives(context).CopyToVector().reshape(-1, 1))
    scale = np.abs(exact).max(axis=0) + 1.0
    np.testing.assert_allclose(exact / scale, differences / scale, atol=2e-6)


@pytest.mark.parametrize("element", ["spring_left", "damper_left", "gasket"])
def test_derivatives_by_element_parameters_are_those_of_finite_differences(machine, element):
    setup = machine.set_up("middle")
    system = machine.diagram.GetSubsystemByName(element)
    state = setup.context.get_continuous_state_vector().CopyToVector()
    state[:14] = [0.01, -0.02, 0.01, 3e-3, 2e-3, -3e-3, 1, 0.3, -0.2, 0.1, 0.1, 0.2, -0.1, 20.0]
    state[14:] = 1.3e-4
    setup.context.SetContinuousState(state)
    machine.set_drum_acceleration(setup.context, 0.5)
    numbers = system.packed_numbers(system.GetMyContextFromRoot(setup.context))

    def rate(values):
        system.set_parameters(system.GetMyContextFromRoot(setup.context), values)
        return machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()

    diagram = machine.diagram.ToAutoDiffXd()
    context = diagram.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(setup.context)
    diagram.GetInputPort("drum_acceleration").FixValue(context, [AutoDiffXd(0.5)])
    differentiable = diagram.GetSubsystemByName(element)
    own = differentiable.GetMyContextFromRoot(context)
    own.get_mutable_numeric_parameter(0).SetFromVector(InitializeAutoDiff(numbers).ravel())
    exact = ExtractGradient(diagram.EvalTimeDerivatives(context).CopyToVector().reshape(-1, 1))
    assert np.any(exact != 0.0)
    physical = np.flatnonzero(np.abs(exact).max(axis=0) > 0.0)
    for column in physical:
        step = 1e-6 * max(1e-3, abs(numbers[column]))
        change = step * np.eye(len(numbers))[column]
        difference = (rate(numbers + change) - rate(numbers - change)) / (2.0 * step)
        rounding = 1e-14 * np.abs(rate(numbers)).max() / step
        tolerance = 1e-4 * np.abs(exact[:, column]).max() + rounding
        np.testing.assert_allclose(exact[:, column], difference, atol=tolerance)


@pytest.fixture
def meshcat():
    """Return a Meshcat; it must end in the thread that made it, or the process aborts."""
    yield Meshcat(MeshcatParams(host="localhost"))
    gc.collect()


def test_meshcat_shows_the_moving_machine_and_cannot_touch_the_dynamics(
    machine, reference, meshcat
):
    shown = build_machine(reference, meshcat=meshcat)
    ends, rates = [], []
    for built in (machine, shown):
        context = built.set_up("middle").context
        simulator = Simulator(built.diagram, context)
        # 1/32 s between pictures is a whole number of steps
        ResetIntegratorFromFlags(simulator, "runge_kutta3", 1.0 / 800).set_fixed_step_mode(True)
        simulator.AdvanceTo(0.25)
        ends.append(context.get_continuous_state_vector().CopyToVector())
        context.SetContinuousState(ends[0])
        rates.append(built.diagram.EvalTimeDerivatives(context).CopyToVector())
    np.testing.assert_array_equal(*rates)
    np.testing.assert_allclose(*ends, atol=1e-7)
    assert meshcat.HasPath("/drake/visualizer/oscillating_group/tub")


def test_meshcat_moves_a_cabinet_that_moves(meshcat):
    """Compare the picture with the plant: the cabinet is where it is there, and its floor stays."""
    shown = build_machine(with_moving_cabinet(friction=0.1), meshcat=meshcat)
    context = shown.set_up("middle").context
    simulator = Simulator(shown.diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1.0 / 800).set_fixed_step_mode(True)
    simulator.AdvanceTo(0.25)
    plant = shown.plant
    poses = plant.GetPositions(plant.GetMyContextFromRoot(context))[shown.state_layout.cabinet]
    assert np.abs(poses).max() > 1e-7
    shown.diagram.ForcedPublish(context)
    packed = meshcat._GetPackedTransform("/drake/visualizer")
    columns = packed.partition(b"matrix")[2][3:]  # msgpack: 16 numbers of a type byte and a double
    matrix = np.array([struct.unpack(">d", columns[k + 1 : k + 9])[0] for k in range(0, 144, 9)])
    np.testing.assert_allclose(matrix[12:15], poses[3:], atol=1e-12)
    assert meshcat.HasPath("/floor")


def test_a_cloned_context_keeps_its_profile(machine):
    setup = machine.set_up("middle", profile=CORNERED)
    clone = setup.context.Clone()
    source = machine.spin_profile
    assert source.get_profile(source.GetMyContextFromRoot(clone)) == CORNERED


def test_motor_torque_of_a_run_is_that_of_the_port(machine):
    """Compare with inertia times acceleration, both constant, and a locked tub."""
    setup = machine.set_up()
    machine.set_drum_acceleration(setup.context, 2.0)
    torque = machine.diagram.GetOutputPort("motor_torque").Eval(setup.context)[0]
    drum = machine.plant.GetBodyByName("drum")
    about_axis = drum.CalcSpatialInertiaInBodyFrame(setup.plant_context).CalcRotationalInertia()
    assert torque == pytest.approx(2.0 * about_axis.CopyToFullMatrix3()[1, 1], rel=0.2)


def test_a_torque_of_ones_own_turns_the_drum_of_a_motor():
    motor = build_machine("motor")
    plain = motor.set_up("middle")
    motor.diagram.GetInputPort("drum_torque").FixValue(plain.context, [5.0])
    assert motor.diagram.GetOutputPort("motor_torque").Eval(plain.context) == pytest.approx([5.0])
    Simulator(motor.diagram, plain.context).AdvanceTo(0.5)
    angle, speed = motor.diagram.GetOutputPort("drum_motion").Eval(plain.context)
    assert speed == motor.diagram.GetOutputPort("drum_speed").Eval(plain.context)[0] > 1.0
    assert angle == motor.diagram.GetOutputPort("drum_angle").Eval(plain.context)[0] > 0.0


def test_a_wrong_port_lists_those_of_the_machine(machine):
    with pytest.raises(
        InputError, match=r"no input 'drum_torque'; it needs a drive with a motor.*"
    ):
        machine.inputs["drum_torque"]
    with pytest.raises(InputError, match=r"no output 'speed'\. The outputs are .*drum_speed"):
        machine.outputs["speed"]
