"""A cabinet that moves: walking, limits of its feet, energy, rest, and what is refused."""

import re

import numpy as np
import pytest
from both_engines import check_alike
from moving_cabinet import with_moving_cabinet
from pydrake.math import RollPitchYaw

from wm_drake.batch import simulate_many
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.errors import InputError
from wm_drake.model.bodies import add_load, cabinet_inertia
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine, with_value, with_values
from wm_drake.simulation.cabinet import walk
from wm_drake.simulation.cases import Case, case_of
from wm_drake.simulation.measures import measure
from wm_drake.simulation.measures.record import walk_of
from wm_drake.simulation.records import as_record
from wm_drake.simulation.runs import DivergenceWarning, simulate
from wm_drake.studies.modes.study import modes, three_linearisations
from wm_drake.studies.response.response import steady_response

RUN_UP = SpinProfile(time=(0.0, 1.0, 12.0, 15.0), speed=(0.0, 5.0, 24.0, 24.0))
SHORT = SpinProfile(time=(0.0, 0.5, 2.0), speed=(4.0, 8.0, 20.0))
FEET_PLACES = load_machine("reference").cabinet.feet
TWO = Load(unbalances=(Unbalance(mass=0.8, radius=0.25, y=-0.1),))


@pytest.fixture(scope="module")
def light(shipped):
    return shipped("light_cabinet")


@pytest.fixture(scope="module")
def moving():
    return build_machine(with_moving_cabinet())


def walked(machine, **changes):
    """Return distance [mm] of a run-up with the load `middle`, with other values by key path."""
    step = changes.pop("step", None)
    keys = {f"cabinet.{key.replace('__', '.')}": value for key, value in changes.items()}
    parameters = with_values(machine.parameters, keys)
    case = Case("middle", parameters.loads["middle"], RUN_UP, parameters=parameters)
    return 1e3 * walk_of(simulate(machine, case, step=step)).distance


@pytest.mark.slow
def test_a_light_cabinet_walks_and_a_heavy_one_does_not(light):
    heavy = load_machine("heavy_cabinet")
    found = measure(simulate(build_machine(heavy), case_of(heavy, "middle")))
    assert found.walk.distance == 0.0  # not a micrometre: feet that stick do not creep
    assert found.walk.turn == 0.0
    assert float(found.feet.slide_margin) > 100.0
    record = simulate(light, case_of(light.parameters, "middle"))
    found = measure(record)
    assert found.walk.distance > 0.02
    assert abs(found.walk.turn) > np.deg2rad(2.0)
    assert 0.0 <= float(found.feet.turn_margin) < 0.1  # friction is at its limit, never above it
    # the smallest distance of feet from each other stays: they move as a rigid body
    ends = np.array([(foot.x, foot.y) for foot in light.parameters.cabinet.feet.values()])
    names = list(light.parameters.cabinet.feet)
    after = ends + record.foot_slip.sel(foot=names).values[-1, :, :2]
    spans = [np.linalg.norm(feet[:, None] - feet, axis=2) for feet in (ends, after)]
    np.testing.assert_allclose(spans[1], spans[0], atol=3e-3)


def test_the_distance_is_no_artefact_of_step_or_regularisation(light):
    """Halve the damping, which regularises the friction: in the end the change halves as well."""
    base, finer = walked(light), walked(light, step=2.5e-3 / 8)
    assert base == pytest.approx(finer, rel=2e-3)
    distances = [
        walked(light, foot_type__horizontal_damping=damping, step=2.5e-3 / 32)
        for damping in (30.0, 15.0, 7.5)
    ]
    assert distances == pytest.approx([base] * 3, rel=0.15)
    first, second = np.diff(distances)
    assert 0.3 < second / first < 0.7


def test_stiff_feet_give_back_the_fixed_housing(moving, machine, reference):
    """Check that the deviation falls as 1 / stiffness."""
    case = Case("middle", reference.loads["middle"], SHORT)
    how = {"step": 2.5e-3 / 8, "integrator": "runge_kutta"}
    fixed = simulate(machine, case, **how).displacement.values
    errors = []
    for k in (4.0, 8.0):
        feet = {
            "vertical_stiffness": 200e3 * k,
            "horizontal_stiffness": 60e3 * k,
            "vertical_damping": 800.0 * k**0.5,
            "horizontal_damping": 600.0 * k**0.5,
        }
        parameters = with_moving_cabinet(friction=5.0, foot_type=feet)
        same = Case("middle", case.load, SHORT, parameters=parameters)
        errors.append(np.abs(simulate(moving, same, **how).displacement.values - fixed).max())
    assert errors[0] < 0.03 * np.abs(fixed).max()
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.15)


def test_both_engines_move_alike(moving):
    """Run at a friction at which the feet slide."""
    parameters = with_value(moving.parameters, "cabinet.friction", 0.12)
    profile = SpinProfile(time=(0.0, 0.301, 1.0), speed=(8.0, 12.0, 20.0))
    case = Case("two", TWO, profile, parameters=parameters)
    drake, compiled = (
        simulate(moving, case, "drake-accurate"),
        simulate(moving, case, step=2.5e-3 / 16),
    )
    assert float(np.abs(drake.foot_slip).max()) > 1e-4
    variables = "displacement", "tub_position", "cabinet_position", "foot_slip", "motor_torque"
    variables += "spring_tension", "bushing_force", "floor_force"
    check_alike(compiled, drake, variables, 1e-3)


def test_at_rest_the_feet_carry_the_weight_and_nothing_moves(light):
    setup = light.set_up()
    light.set_drum_acceleration(setup.context, 0.0)
    rates = light.diagram.EvalTimeDerivatives(setup.context).CopyToVector()
    assert np.max(np.abs(rates)) < 1e-8
    plant, context = light.plant, setup.plant_context
    # the housing of the SDF is fixed, and none of its mass stands on the feet
    mass = plant.CalcTotalMass(context) - plant.GetBodyByName("housing").get_mass(context)
    assert np.sum(setup.cabinet.at_rest) == pytest.approx(mass * 9.81, rel=1e-9)
    floor = light.outputs["feet_floor_force"].Eval(light.feet.GetMyContextFromRoot(setup.context))
    np.testing.assert_allclose(floor.reshape(4, 3)[:, 2], setup.cabinet.at_rest, rtol=1e-12)


def test_energy_of_bodies_is_the_work_of_all_forces(moving):
    """Compare kinetic energy and weight of cabinet, tub and drum with the work of all forces.

    It is computed from the record in W, without the mechanics of the engine.
    """
    profile = SpinProfile(time=(0.0, 0.5), speed=(12.0, 16.0))
    parameters = with_value(moving.parameters, "cabinet.friction", 0.06)
    setup = moving.set_up(TWO, parameters=parameters)
    step = 2.5e-3 / 16
    run = run_compiled(setup, profile, step, lambda fraction: None, step, "runge_kutta")
    record = as_record(setup, Case("two", TWO, profile, parameters=parameters), run)
    cabinet, floor = run.cabinet, record.floor_force.values
    assert np.abs(cabinet[:, 12:]).max() > 1e-4  # it slides
    plant = build_machine(load_machine("reference"), load=None).plant
    context = plant.CreateDefaultContext()
    add_load(plant, context, TWO)
    plant.get_joint_actuator(plant.GetJointActuatorIndices()[0]).SetRotorInertia(context, 0.0)
    inertia = cabinet_inertia(parameters.cabinet)
    mass, centre = inertia.get_mass(), inertia.get_com()
    energy, power = [], []
    feet = [parameters.cabinet.feet[name] for name in parameters.cabinet.corners]
    for k in range(len(run.time)):
        X, w, v = (
            RollPitchYaw(cabinet[k, :3]).ToRotationMatrix().matrix(),
            *np.split(cabinet[k, 6:12], 2),
        )
        seen, p = run.state[k], cabinet[k, 3:6]
        away, R_CT = X @ seen[3:6], RollPitchYaw(seen[:3]).ToRotationMatrix()
        w_T, v_T = w + X @ seen[7:10], v + np.cross(w, away) + X @ seen[10:13]
        angles = RollPitchYaw(RollPitchYaw(cabinet[k, :3]).ToRotationMatrix() @ R_CT).vector()
        state = [*angles, *(p + away), seen[6], *w_T, *v_T, seen[13]]
        plant.SetPositionsAndVelocities(context, state)
        I_W = X @ inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3() @ X.T
        v_cm = v + np.cross(w, X @ centre)
        energy.append(
            plant.CalcKineticEnergy(context) + plant.CalcPotentialEnergy(context)
            + 0.5 * mass * v_cm @ v_cm + 0.5 * w @ I_W @ w + 9.81 * mass * (p + X @ centre)[2]
        )  # fmt: skip
        force = X @ record.cabinet_force.values[k]
        moment = X @ record.cabinet_moment.values[k]
        # the mounts do work at the rate of the motion of the tub against the cabinet
        w_rel, v_rel = X @ seen[7:10], X @ seen[10:13]
        on_tub = -(moment - np.cross(away, force))
        rate = run.motor_torque[k] * seen[13] - force @ v_rel + on_tub @ w_rel
        yaw = cabinet[k, 2]
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        for foot, on_foot in zip(feet, floor[k], strict=True):
            arm = X @ (foot.x, foot.y, parameters.cabinet.floor)
            rate += (turn @ on_foot) @ (v + np.cross(w, arm))
        power.append(rate)
    work = np.concatenate([[0.0], np.cumsum(0.5 * step * (np.array(power)[1:] + power[:-1]))])
    change = np.array(energy) - energy[0]
    assert np.ptp(change) > 1.0
    np.testing.assert_allclose(work, change, atol=2e-4 * np.ptp(change))


def test_walk_is_the_nearest_rigid_motion():
    cabinet = load_machine("reference").cabinet
    feet = np.array([(cabinet.feet[n].x, cabinet.feet[n].y) for n in cabinet.corners])
    turn, shift = np.deg2rad(7.0), np.array([0.03, -0.01])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    found = walk(cabinet, feet @ rotation.T + shift - feet)
    assert found.turn == pytest.approx(turn)
    np.testing.assert_allclose(found.shift, shift)
    assert found.distance == pytest.approx(np.hypot(*shift))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"friction": 0.0}, "friction"),
        ({"foot_type": {"vertical_stiffness": -1.0}}, "vertical_stiffness"),
        ({"foot_type": {"horizontal_damping": 0.0}}, "horizontal_damping"),
        ({"inertia": None}, "needs inertia"),
        ({"feet": {n: {"x": 0.1 * i, "y": 0.0} for i, n in enumerate("abcd")}}, "in a line with two others"),
    ],
)  # fmt: skip
def test_a_cabinet_that_cannot_stand_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        with_moving_cabinet(**changes)


def test_other_refusals(machine):
    with pytest.raises(ValueError, match="not possible with telescopic_dampers"):
        with_moving_cabinet(load_machine("free_stroke"))
    with pytest.raises(InputError, match="tips over at rest"):
        build_machine(with_moving_cabinet(centre_of_mass=(2.0, 0.0, 0.0))).set_up()
    with pytest.raises(InputError, match=r"cabinet.moves: this cabinet moves"):
        machine.set_up(parameters=with_moving_cabinet())


def test_modes_and_steady_states_are_refused(light):
    """Check for one message, before any computation, that names the key and what to set."""
    message = r"^cabinet\.moves: the cabinet of machine 'light_cabinet' moves; .* set it to false$"
    for refused in (
        lambda: modes(light),
        lambda: steady_response(light, "middle", [10.0, 20.0]),
        lambda: three_linearisations(light, "middle"),
    ):
        with pytest.raises(InputError, match=message):
            refused()


def test_a_cabinet_that_tips_over_is_said_to():
    """Check that both engines and a batch name the time and the side."""
    feet = {n: {"x": 0.06 if "right" in n else -0.06, "y": f.y} for n, f in FEET_PLACES.items()}
    machine = build_machine(with_moving_cabinet(feet=feet, friction=2.0, mass=14.0))
    load = Load(unbalances=(Unbalance(mass=4.0, radius=0.25, y=0.0),))
    case = Case("heavy", load, SpinProfile(time=(0.0, 4.0), speed=(5.0, 17.0)))
    with pytest.warns(DivergenceWarning, match="the cabinet tips over to its"):
        told = simulate(machine, case).attrs["diverged"]
    assert re.match(
        r"the run diverged at \d\.\d{3} s: the cabinet tips over to its (right|left), "
        r"tilted by (29|3\d) deg, bound 29 deg; last good state at ",
        told,
    )
    with pytest.warns(DivergenceWarning):
        in_drake = simulate(machine, case, "drake-accurate").attrs["diverged"]
    ours, drakes = (re.split(r"(\d\.\d{3}) s", text.partition(";")[0]) for text in (told, in_drake))
    assert ours[::2] == drakes[::2]
    # our run is repeated with closer samples, one of which is the first beyond the bound
    assert float(ours[1]) == pytest.approx(float(drakes[1]), abs=0.005)
    table = simulate_many(machine, [case], measures=["extremes"], histories=False)
    assert list(table.diverged) == [told]


def test_a_step_too_long_for_stiff_feet_is_never_silent(moving):
    stiff = {"vertical_stiffness": 200e6, "horizontal_stiffness": 60e6, "horizontal_damping": 1e5}
    parameters = with_moving_cabinet(foot_type=stiff)
    case = Case("two", TWO, SHORT, parameters=parameters)
    with pytest.raises(InputError, match="too long for the cabinet on its feet"):
        simulate(moving, case)
