"""Systems of a diagram have the name of their kind, and their numbers that of the machine file."""

import numpy as np
import pytest
from drag_damper import DRAG_DAMPER
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import DiagramBuilder, LeafSystem

import wm_drake as wm
from wm_drake import add_washing_machine, build_machine
from wm_drake.errors import InputError
from wm_drake.parameters import MachineParameters, load_machine, with_value, with_values

MOVED = np.array([0.01, -0.02, 0.01, 3e-3, 2e-3, -3e-3, 1.0, 0.3, -0.2, 0.1, 0.1, 0.2, -0.1, 20.0])
wm.register_element(DRAG_DAMPER)
DRAG = {"tub_frame": "damper_left_tub", "housing_frame": "damper_left_housing"}


@pytest.fixture(scope="module")
def extended():
    """Return the reference machine with an element of a kind that this package does not have."""
    tree = load_machine("reference").model_dump(exclude_unset=True)
    slow = {"kind": "drag_damper", **DRAG, "coefficient": 4000.0}
    return build_machine(MachineParameters.model_validate(tree | {"elements": {"slow": slow}}))


def moved(machine):
    """Return a default Context in which tub and drum move."""
    context = machine.diagram.CreateDefaultContext()
    machine.plant.SetPositionsAndVelocities(machine.plant.GetMyContextFromRoot(context), MOVED)
    return context


def rates(diagram, context):
    return diagram.EvalTimeDerivatives(context).CopyToVector()


def test_the_class_of_a_system_has_the_name_of_its_kind(extended):
    def types_of(diagram):
        return {system.get_name(): type(system).__name__ for system in diagram.GetSystems()}

    plain = types_of(extended.diagram)
    expected = {
        "spring_left": "SpringStrut",
        "damper_left": "FrictionDamper",
        "gasket": "SixComponentBushing",
        "element_slow": "DragDamper",
        "sensors": "Sensors",
    }
    assert plain | expected == plain
    copy = types_of(extended.diagram.ToAutoDiffXd())
    assert {name: kind.split("_")[0] for name, kind in copy.items()} == plain
    assert "SixComponentBushing" in extended.diagram.GetGraphvizString()


@pytest.mark.parametrize(
    ("group", "element", "name", "key", "factor"),
    [
        ("bushings", "gasket", "damping_x", "gasket.damping_x", 1.7),
        ("dampers", "left", "friction_force", "damper_types.friction.friction_force", 0.6),
        ("dampers", "left", "end_bushing.damping", "damper_types.friction.end_bushing.damping", 2),
        ("others", "slow", "coefficient", "elements.slow.coefficient", 0.3),
    ],
)
def test_a_named_number_is_that_of_the_machine_file(extended, group, element, name, key, factor):
    """Compare a number set in a Context with the machine that is set up with it."""
    system, context = getattr(extended, group)[element], moved(extended)
    value = system.number(context, name)
    parameters = extended.parameters
    changed = with_value(parameters, key, factor * value)
    for other in getattr(extended, group) if group == "dampers" else [element]:
        one = getattr(extended, group)[other]  # the dampers share their type
        assert one.numbers(context)[name].value == value
        one.set_number(context, name, factor * value)
    found = rates(extended.diagram, context)
    expected = extended.set_up(next(iter(parameters.loads)), parameters=changed)
    extended.plant.SetPositionsAndVelocities(expected.plant_context, MOVED)
    np.testing.assert_array_equal(found, rates(extended.diagram, expected.context))
    assert not np.array_equal(found, rates(extended.diagram, moved(extended)))


def test_numbers_have_the_units_of_the_machine_file(extended):
    context = extended.diagram.CreateDefaultContext()
    gasket = extended.bushings["gasket"].numbers(context)
    assert gasket["damping_x"] == (19.0, "N*s/m")
    assert gasket["rotational_stiffness_y"].unit == "N*m/rad"
    assert extended.springs["left"].numbers(context)["preload"].unit == "N"
    assert extended.others["slow"].numbers(context)["coefficient"].unit == "N*s^2/m^2"
    with pytest.raises(InputError, match=r"no number 'dampingx' of gasket; .*damping_x, damping_y"):
        extended.bushings["gasket"].number(context, "dampingx")


@pytest.mark.parametrize("name", ["stiffness_x", "rotational_stiffness_y", "damping_z"])
def test_the_gradient_by_a_named_number_is_that_of_differences(extended, name):
    """Differentiate by the slope of a table, which is scaled, and by a number. Own oracle."""
    gasket, context = extended.bushings["gasket"], moved(extended)
    value = gasket.number(context, name)
    around = []
    for factor in (1.0 + 1e-6, 1.0 - 1e-6):
        gasket.set_number(context, name, factor * value)
        assert gasket.number(context, name) == pytest.approx(factor * value, rel=1e-12)
        around.append(rates(extended.diagram, context))
    differences = (around[0] - around[1]) / (2e-6 * value)
    copy = extended.diagram.ToAutoDiffXd()
    of_copy = copy.CreateDefaultContext()
    of_copy.SetTimeStateAndParametersFrom(moved(extended))
    copy.GetSubsystemByName("gasket").set_number(of_copy, name, AutoDiffXd(value, [1.0]))
    exact = [rate.derivatives() for rate in rates(copy, of_copy)]
    exact = np.array([slope[0] if len(slope) else 0.0 for slope in exact])
    assert np.abs(exact).max() > 0.0
    np.testing.assert_allclose(differences, exact, atol=1e-5 * np.abs(exact).max())


def test_a_table_without_slope_at_zero_is_not_scaled(reference):
    free = {"displacement": (-0.02, -0.01, 0.01, 0.02), "force": (-50.0, 0.0, 0.0, 50.0)}
    tree = reference.model_dump(exclude_unset=True)
    tree["gasket"] = {**tree["gasket"], "stiffness_x": free}
    machine = build_machine(MachineParameters.model_validate(tree))
    gasket, context = machine.bushings["gasket"], machine.diagram.CreateDefaultContext()
    assert gasket.number(context, "stiffness_x") == 0.0
    with pytest.raises(InputError, match="without slope at 0"):
        gasket.set_number(context, "stiffness_x", 100.0)


class Dashpot(LeafSystem):
    """A damper of a user between two frames of the machine, in place of a shipped one."""

    def __init__(self, plant, tub_frame, housing_frame, damping):
        super().__init__()
        self._plant, self._context, self._damping = plant, plant.CreateDefaultContext(), damping
        self._frames = [plant.GetFrameByName(name) for name in (tub_frame, housing_frame)]
        self.DeclareVectorInputPort("state", plant.num_multibody_states())
        self.DeclareVectorOutputPort("tub_force", 6, self._calc)

    def _calc(self, context, output):
        plant, now = self._plant, self._context
        plant.SetPositionsAndVelocities(now, self.get_input_port().Eval(context))
        tub, housing = (frame.CalcPoseInWorld(now).translation() for frame in self._frames)
        velocity = self._frames[0].CalcSpatialVelocityInWorld(now).translational()
        line = (tub - housing) / np.linalg.norm(tub - housing)
        force = -self._damping * (line @ velocity) * line
        origin = plant.GetFrameByName("tub").CalcPoseInWorld(now).translation()
        output.SetFromVector([*np.cross(tub - origin, force), *force])


def test_a_damper_of_ones_own_takes_the_place_of_a_shipped_one(reference):
    """Compare it with the shipped damper without friction and without end bushings."""
    law, bushing = "damper_types.friction", "damper_types.friction.end_bushing"
    viscous = with_values(
        reference,
        {f"{law}.friction_force": 0.0}
        | {f"{bushing}.{part}": 0.0 for part in ("stiffness", "damping", "friction_torque")},
    )
    shipped = build_machine(viscous)
    others = {name: damper for name, damper in viscous.dampers.items() if name != "left"}
    builder = DiagramBuilder()
    washer = add_washing_machine(builder, with_value(viscous, "dampers", others))
    frames = viscous.dampers["left"].tub_frame, viscous.dampers["left"].housing_frame
    own = builder.AddSystem(
        Dashpot(washer.plant, *frames, viscous.damper_types["friction"].damping)
    )
    builder.Connect(washer.outputs["state"], own.get_input_port())
    builder.Connect(own.get_output_port(), washer.inputs["tub_force"])
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    washer.plant.SetPositionsAndVelocities(washer.plant.GetMyContextFromRoot(context), MOVED)
    expected = rates(shipped.diagram, moved(shipped))
    np.testing.assert_allclose(rates(diagram, context), expected, rtol=1e-9, atol=1e-9)
