"""Statics, Contexts and linearization of the whole diagram."""

import numpy as np
import pytest
from applied_force import elastic_and_gravity_force
from scipy.linalg import eigh
from simple_machines import with_gasket_tables

from wm_drake.errors import InputError
from wm_drake.model.bodies import sdf_path
from wm_drake.model.build import build_machine
from wm_drake.model.equilibrium import EQUILIBRIUM_TOLERANCE
from wm_drake.parameters import Load, Unbalance, load_machine, with_value, with_values
from wm_drake.studies.modes.natural import natural_modes
from wm_drake.systems.speed_source import REFLECTED_INERTIA


@pytest.mark.parametrize("springs", ["leaning", "upright"])
def test_rest_pose_is_a_static_equilibrium(machine, reference, upright, springs):
    setup = machine.set_up(parameters=upright if springs == "upright" else reference)
    machine.set_drum_acceleration(setup.context, 0.0)
    derivative = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()
    assert EQUILIBRIUM_TOLERANCE == 1e-9
    assert np.max(np.abs(setup.residual)) < 1e-9  # N and N m
    if springs == "upright":
        assert np.max(np.abs(setup.rest_pose)) < 1e-9  # T coincides with W
    assert np.max(np.abs(derivative)) < 1e-9


def test_preloads_carry_the_weight_and_its_moments(machine, upright):
    setup = machine.set_up(parameters=upright)
    plant, context = machine.plant, setup.plant_context
    moving = [body for body in map(plant.get_body, plant.GetBodyIndices(plant.GetBodyByName("tub").model_instance()))
              if body.name() not in ("world", "housing")]  # fmt: skip
    weights = [body.get_mass(context) * setup.parameters.gravity for body in moving]
    centres = [
        plant.EvalBodyPoseInWorld(context, body) @ body.CalcCenterOfMassInBodyFrame(context)
        for body in moving
    ]
    pulls = [
        s.preload * (s.p_WH - s.p_ToA_T) / np.linalg.norm(s.p_WH - s.p_ToA_T)
        for s in setup.springs.values()
    ]
    assert sum(pull[2] for pull in pulls) == pytest.approx(sum(weights), rel=1e-12)
    moment = sum(
        np.cross(s.p_ToA_T, pull) for s, pull in zip(setup.springs.values(), pulls, strict=True)
    )
    weight_moment = sum(np.cross(c, [0, 0, -w]) for c, w in zip(centres, weights, strict=True))
    np.testing.assert_allclose(moment, -weight_moment, atol=1e-10)


def test_only_a_spring_that_pushes_may_have_a_compressive_preload(machine, reference):
    """Put the hook of the left spring below the tub: it has to push upwards."""
    below = with_value(reference, "frames.spring_left_housing.position", (-0.25, 0.0, -0.6))
    with pytest.raises(InputError, match=r"springs.left: would be slack at rest \(preload -"):
        machine.set_up(parameters=below)
    action = "spring_types.suspension.action"
    setup = machine.set_up(parameters=with_value(below, action, "tension-compression"))
    left = setup.springs["left"]
    assert left.preload < -10.0
    assert left.free_length > left.rest_length
    assert np.max(np.abs(setup.residual)) < 1e-9


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("bodies.upper_counterweight.mass", 11.0),
        ("bodies.motor.centre_of_mass", (0.02, 0.13, -0.28)),
        ("frames.damper_left_tub.position", (-0.23, -0.01, -0.15)),
        ("frames.spring_left_housing.position", (-0.31, -0.19, 0.41)),
        ("gasket.damping_x", 30.0),
        ("damper_types.friction.friction_force", 40.0),
    ],
)
def test_a_change_in_the_context_equals_a_rebuild_bit_for_bit(machine, reference, key, value):
    assert_change_equals_rebuild(machine, with_value(reference, key, value))


def test_a_changed_table_in_the_context_equals_a_rebuild_bit_for_bit(reference):
    tables = with_gasket_tables(reference)
    changed = with_value(tables, "gasket.stiffness_x.force", (-90.0, -40.0, 0.0, 40.0, 90.0))
    assert_change_equals_rebuild(build_machine(tables), changed)


def assert_change_equals_rebuild(machine, changed):
    load = Load(unbalances=(Unbalance(mass=0.8, radius=0.24, y=0.05, phase=1.0),))
    rng = np.random.default_rng(7)
    states = rng.normal(
        0.0, 0.02, (5, machine.diagram.CreateDefaultContext().num_continuous_states())
    )
    derivatives = []
    for built in (machine, build_machine(changed)):
        setup = built.set_up(load, parameters=changed)
        rows = [setup.rest_pose]
        for state in states:
            setup.context.SetContinuousState(state)
            rows.append(built.diagram.EvalTimeDerivatives(setup.context).CopyToVector())
        derivatives.append(rows)
    original = machine.set_up(load)
    original.context.SetContinuousState(states[0])
    assert all(np.array_equal(a, b) for a, b in zip(*derivatives, strict=True))
    assert not np.array_equal(
        derivatives[0][1], machine.diagram.EvalTimeDerivatives(original.context).CopyToVector()
    )


def test_an_unbalanced_override_finds_its_own_equilibrium(machine, reference):
    hook = machine.set_up().springs["left"].p_WH
    changed = with_value(reference, "bodies.upper_counterweight.mass", 10.5)
    # it leans now
    changed = with_value(
        changed, "frames.spring_left_housing.position", tuple(hook + np.array([-0.004, 0.002, 0.0]))
    )
    setup = machine.set_up(parameters=changed)
    assert np.max(np.abs(setup.residual)) < 1e-9
    assert 0.0 < np.max(np.abs(setup.rest_pose)) < 0.03


def test_springs_that_cannot_hold_the_tub_are_refused(machine, reference):
    heavy = with_value(reference, "bodies.motor.centre_of_mass", (0.0, 3.0, -0.3))
    with pytest.raises(InputError, match="spring"):
        machine.set_up(parameters=heavy)


def test_another_machine_than_the_built_one_is_refused(machine, reference):
    with pytest.raises(InputError, match="law"):
        machine.set_up(
            parameters=with_value(
                reference, "damper_types.friction", {"law": "coulomb", "friction_force": 30.0}
            )
        )
    with pytest.raises(InputError, match="gravity"):
        machine.set_up(parameters=with_value(reference, "gravity", 1.6))


def test_gasket_out_means_no_gasket_force(machine):
    setup = machine.set_up(gasket=False)
    machine.plant.SetPositions(setup.plant_context, [0.01, 0.02, -0.01, 0.01, 0.01, 0.01, 0.3])
    gasket = machine.bushings["gasket"]
    assert not np.any(
        gasket.GetOutputPort("force").Eval(gasket.GetMyContextFromRoot(setup.context))
    )


def mass_and_finite_difference_stiffness(machine, setup):
    """Return mass matrix of tub with locked drum, and stiffness by differences of static force.

    Both are those of the velocities (angular velocity in W), not of the derivatives of roll, pitch and yaw.
    """
    plant, context = machine.plant, setup.plant_context
    mass = plant.CalcMassMatrix(context)
    step = 1e-6
    stiffness = np.empty((6, 6))
    rest = np.append(setup.rest_pose, 0.0)
    plant.SetPositions(context, rest)
    directions = [plant.MapVelocityToQDot(context, unit) for unit in np.eye(7)[:6]]
    for column, direction in enumerate(directions):
        forces = []
        for sign in (1.0, -1.0):
            plant.SetPositions(context, rest + sign * step * direction)
            forces.append(elastic_and_gravity_force(machine, setup))
        stiffness[:, column] = -(forces[0] - forces[1]) / (2 * step)
    return mass[:6, :6], stiffness


@pytest.mark.parametrize("gasket", [True, False])
def test_linearized_frequencies_equal_those_of_a_finite_difference_stiffness(
    machine, reference, gasket
):
    undamped = reference
    for axis in "xyz":
        undamped = with_value(undamped, f"gasket.damping_{axis}", 0.0)
        undamped = with_value(undamped, f"gasket.rotational_damping_{axis}", 0.0)
    undamped = with_value(undamped, "damper_types.friction.end_bushing.damping", 0.0)
    modes = natural_modes(machine, undamped, gasket=gasket)
    mass, stiffness = mass_and_finite_difference_stiffness(
        machine, machine.set_up(parameters=undamped, gasket=gasket, dampers=False)
    )
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-3 * np.abs(stiffness).max())
    squared = eigh(0.5 * (stiffness + stiffness.T), mass, eigvals_only=True)
    assert len(modes.frequency) == 6
    np.testing.assert_allclose(modes.frequency, np.sqrt(squared) / (2 * np.pi), rtol=1e-5)
    np.testing.assert_allclose(modes.damping_ratio, 0.0, atol=1e-9)


def test_drum_is_locked_to_its_speed_by_the_reflected_inertia(machine):
    setup = machine.set_up()
    mass = machine.plant.CalcMassMatrix(setup.plant_context)
    assert mass[6, 6] == pytest.approx(REFLECTED_INERTIA, rel=1e-6)
    assert np.max(np.abs(mass[6, :6])) < 1.0  # nothing of it reaches the tub


@pytest.mark.parametrize("effort", ["0", "10"])
def test_a_model_of_ones_own_must_not_clamp_the_motor(tmp_path, effort):
    text = sdf_path("oscillating_group.sdf").read_text()
    limit = f"<limit><effort>{effort}</effort><lower>"
    assert "<limit><lower>" in text
    (tmp_path / "own.sdf").write_text(text.replace("<limit><lower>", limit))
    (tmp_path / "free.sdf").write_text(text)
    for model in ("own", "free"):
        (tmp_path / f"{model}.yaml").write_text(f"extends: reference\nmodel: {model}.sdf\n")
    with pytest.raises(InputError, match="must have no effort limit"):
        build_machine(load_machine(tmp_path / "own.yaml"))
    assert (
        np.max(np.abs(build_machine(load_machine(tmp_path / "free.yaml")).set_up().residual)) < 1e-9
    )


def test_an_sdf_error_is_one_short_line(tmp_path):
    (tmp_path / "own.sdf").write_text(
        f"<sdf version='1.9'><model name='m'><{'x' * 500}/></model></sdf>"
    )
    (tmp_path / "own.yaml").write_text("extends: reference\nmodel: own.sdf\n")
    with pytest.raises(InputError, match="line 1: <xxx") as caught:
        build_machine(load_machine(tmp_path / "own.yaml"))
    (problem,) = caught.value.problems
    assert "\n" not in problem.message
    assert len(problem.message) <= 400


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("damper_types.free_stroke.sponge", r"telescopic_dampers.left: sponge has 4 points, .* 12"),
        ("bushing_types.connecting.stiffness_y", r"telescopic_dampers.left.tub_bushing: stiffness_y has 4 points, .* 6; rebuild"),
        ("bushing_types.connecting.stiffness_x", r"tub_bushing: stiffness_x has 4 points, that of the built machine none"),
    ],
)  # fmt: skip
def test_a_table_with_other_points_is_refused_by_its_name(key, message, shipped):
    machine = shipped("free_stroke")
    table = {"displacement": "(-20, -5, 5, 20) mm", "force": "(-100, 0, 0, 100) N"}
    changed = with_values(machine.parameters, {key: table})
    with pytest.raises(InputError, match=message):
        machine.set_up("front", parameters=changed)
