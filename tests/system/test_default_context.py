"""The default Context is the machine at rest with its load, so that a plain Simulator runs it."""

import numpy as np
import pytest
from machine_with_bearing import with_bearing
from pydrake.autodiffutils import ExtractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from wm_drake import add_washing_machine, build_machine
from wm_drake.errors import InputError
from wm_drake.parameters import (
    Load,
    SpinProfile,
    Unbalance,
    load_machine,
    shipped_machines,
    with_value,
    with_values,
)
from wm_drake.parameters.spin import Water
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate

every_machine = pytest.mark.parametrize("name", shipped_machines())


def state_of(context):
    return context.get_continuous_state_vector().CopyToVector()


def rates_at(diagram, context, state):
    """Return the time derivatives at a state, which is set in the Context."""
    context.SetContinuousState(state)
    return diagram.EvalTimeDerivatives(context).CopyToVector()


def check_default(diagram, expected):
    """Check that the default Context has every bit of another one, at rest and in motion."""
    default, rest = diagram.CreateDefaultContext(), state_of(expected)
    np.testing.assert_array_equal(state_of(default), rest)
    moving = rest + 1e-3 * np.random.default_rng(8).standard_normal(len(rest))
    for state in (rest, moving):
        rates = [rates_at(diagram, context, state) for context in (default, expected)]
        np.testing.assert_array_equal(*rates)
    for port in map(diagram.get_output_port, range(diagram.num_output_ports())):
        np.testing.assert_array_equal(port.Eval(default), port.Eval(expected))


@every_machine
def test_it_has_every_bit_that_set_up_sets(name):
    machine = build_machine(name)
    first = next(iter(machine.parameters.loads))
    check_default(machine.diagram, machine.set_up(first).context)


def test_so_has_a_machine_with_a_compliant_bearing_and_a_wet_load(reference):
    water = Water(share=0.6, speed=(0.0, 40.0), left=(1.0, 0.3), time_constant=20.0)
    wet = Load(unbalances=(Unbalance(mass=0.8, radius=0.24, y=0.0, water=water),))
    machine = build_machine(with_bearing(reference), load=wet)
    check_default(machine.diagram, machine.set_up(wet).context)
    assert machine.outputs["water_left"].size() == 1


def test_the_load_is_chosen_when_the_machine_is_built(reference):
    for load, gasket in (("counter", True), (None, True), ("front", False)):
        machine = build_machine(reference, load=load, gasket=gasket)
        check_default(machine.diagram, machine.set_up(load, gasket=gasket).context)
    with pytest.raises(InputError, match=r"no load 'countr'.*counter"):
        build_machine(reference, load="countr")


def test_numbers_of_the_built_machine_do_not_stay_in_a_set_up(machine, reference):
    """Set the numbers of the SDF in a machine that was built with others, and the reverse."""
    moved = (-0.2, -0.06, 0.21)
    changed = with_values(
        reference, {"bodies.drum.mass": 9.5, "frames.spring_left_tub.position": moved}
    )
    built = {"reference": machine, "changed": build_machine(changed)}
    check_default(built["changed"].diagram, built["changed"].set_up("middle").context)
    for parameters in (reference, changed):
        contexts = [one.set_up("middle", parameters=parameters).context for one in built.values()]
        state = state_of(contexts[0]) + 1e-3
        rates = [
            rates_at(one.diagram, context, state)
            for one, context in zip(built.values(), contexts, strict=True)
        ]
        np.testing.assert_array_equal(*rates)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name == "reference" else pytest.mark.slow)
        for name in shipped_machines()
    ],
)
def test_a_plain_simulator_moves_as_the_compiled_engine(name):
    """Compare the sensors after 3 s of Drake's default integrator with those at a fine step.

    The default accuracy of 1e-4 leaves 1 um (`reference_folded`); with 1e-6 it is 0.02 um.
    """
    machine = build_machine(name)
    simulator = Simulator(machine.diagram)
    simulator.AdvanceTo(3.0)
    parameters = machine.parameters
    speeds = tuple(float(parameters.profile.speed_at(time)) for time in (0.0, 3.0))
    profile = SpinProfile(time=(0.0, 3.0), speed=speeds)
    case = Case("first", next(iter(parameters.loads.values())), profile)
    record = simulate(machine, case, step=parameters.step / 8)
    found = machine.diagram.GetOutputPort("displacement").Eval(simulator.get_context())
    size = float(np.abs(record.displacement).max())
    np.testing.assert_allclose(
        found, record.displacement[-1], rtol=0.0, atol=max(2e-6, 3e-4 * size)
    )


def test_copies_of_the_diagram_keep_it(reference):
    """Compare a copy for AutoDiff and a clone with the diagram, which another diagram contains."""
    builder = DiagramBuilder()
    for name, load in (("one", "counter"), ("two", None)):
        washer = add_washing_machine(builder, reference, load=load, name=name)
        push = builder.AddSystem(ConstantVectorSource(np.zeros(6)))
        builder.Connect(push.get_output_port(), washer.inputs["tub_force"])
    diagram = builder.Build()
    default = diagram.CreateDefaultContext()
    rates = diagram.EvalTimeDerivatives(default).CopyToVector()
    alone = [build_machine(reference, load=load).diagram for load in ("counter", None)]
    contexts = [one.CreateDefaultContext() for one in alone]
    np.testing.assert_array_equal(state_of(default), np.concatenate([*map(state_of, contexts)]))
    each = (
        one.EvalTimeDerivatives(context).CopyToVector()
        for one, context in zip(alone, contexts, strict=True)
    )
    np.testing.assert_array_equal(rates, np.concatenate([*each]))
    for copy in (diagram.Clone(), diagram.ToAutoDiffXd()):
        context = copy.CreateDefaultContext()
        for name in ("one", "two"):
            check_positions_of_copy(copy.GetSubsystemByName(f"{name}_bodies"), context)
        context.SetContinuousState(state_of(default))  # the positions only are another
        found = copy.EvalTimeDerivatives(context).CopyToVector()
        np.testing.assert_allclose(ExtractValue(found.reshape(-1, 1)).ravel(), rates, atol=1e-9)


def check_positions_of_copy(plant, context):
    """Check what the manual says of Drake 1.51: a copy of a plant forgets its default positions.

    If this fails, a release of Drake keeps them: take the warning out of the manual.
    """
    wanted = ExtractValue(plant.GetDefaultPositions().reshape(-1, 1)).ravel()
    assert np.abs(wanted).max() > 1e-3
    now = plant.GetPositions(plant.GetMyContextFromRoot(context)).reshape(-1, 1)
    assert not ExtractValue(now).any()
    plant.SetDefaultPositions(wanted)
    mended = plant.GetPositions(plant.CreateDefaultContext()).reshape(-1, 1)
    np.testing.assert_array_equal(ExtractValue(mended).ravel(), wanted)


@pytest.mark.parametrize("name", ["reference", "motor", "ball_rings"])
def test_a_profile_that_starts_with_a_turning_drum_is_refused(name):
    """Drake has no default velocities: the first step refuses a drum at rest, and says the way."""
    machine = build_machine(
        with_value(load_machine(name), "profile", SpinProfile(time=(0.0, 1.0), speed=(2.0, 3.0)))
    )
    with pytest.raises(InputError, match=r"starts at 19\.1 rpm.*call `set_up"):
        Simulator(machine.diagram).AdvanceTo(0.01)
    simulator = Simulator(machine.diagram)
    machine.set_up("middle", context=simulator.get_mutable_context())
    simulator.AdvanceTo(0.01)
    assert machine.diagram.GetOutputPort("drum_speed").Eval(simulator.get_context()) > 1.9
    own = Simulator(machine.diagram)
    port = "drum_speed_reference" if name == "motor" else "drum_acceleration"
    machine.diagram.GetInputPort(port).FixValue(own.get_mutable_context(), [0.0])
    own.Initialize()
