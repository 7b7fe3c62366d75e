"""A drum that whirls in its bearing: the compiled machine against the Drake diagram, at random states and along a run."""

import re

import numpy as np
import pytest
from machine_with_bearing import with_bearing
from machines_of_each_kind import machines_of_each_kind

from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.errors import InputError
from wm_drake.model.bodies import sdf_path
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, MachineParameters, SpinProfile, Unbalance, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate

LOAD = Load(
    unbalances=(
        Unbalance(mass=0.6, radius=0.24, y=-0.1, phase=0.7),
        Unbalance(mass=0.4, radius=0.2, y=0.12, phase=2.9),
    )
)
SIZES = np.array(
    [1.0, 1.2, 1.0] + [0.15] * 3 + [30.0] + [8.0] * 3 + [3.0] * 3 + [150.0]
)  # rad, m, rad/s, m/s
VECTORS = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 7),
    slice(7, 10),
    slice(10, 13),
    slice(13, 14),
    slice(14, None),
)
OTHER_NUMBERS = {
    "radial_stiffness": 3e5,
    "torsional_stiffness": 7e3,
    "torsional_damping": 1.0,
    "y": -0.07,
}


def machines():
    crooked = MachineParameters.model_validate(
        load_machine("reference").model_dump()
        | {
            "bodies": {
                "drum": {"mass": 11.0, "centre_of_mass": (0.03, 0.05, -0.02)},
                "motor": {"mass": 3.0},
            }
        }
    )
    found = {name: load_machine(name) for name in ("reference", "free_stroke")}
    found |= {"crooked": crooked, "springs only": machines_of_each_kind()["springs only"]}
    return {name: with_bearing(parameters) for name, parameters in found.items()}


MACHINES = machines()


def random_states(rng, coordinates, sponges):
    """Draw a state of tub and drum, of each damper's tubes, of the carrier and of the sponges."""
    blocks = [rng.uniform(-1.0, 1.0, 14) * SIZES for _ in range(2 + len(coordinates.tubes))]
    for block in blocks[1:-1]:
        block[6] *= 0.05 / SIZES[6]  # an extension
        block[13] *= 2.0 / SIZES[13]
    return blocks, rng.uniform(-0.01, 0.01, sponges)


def worst_difference(machine, setup, count=1000, seed=5):
    """Return the largest relative difference between the time derivatives of both engines, per vector."""
    rng, context, trees = np.random.default_rng(seed), setup.context, machine.state_layout.states()
    derivative = StateDerivative(setup)
    struts, tubes = len(setup.dampers), len(setup.telescopes)
    worst = 0.0
    without_joint = np.delete(np.arange(14), (6, 13))
    for _ in range(count):
        blocks, sponges = random_states(rng, machine.state_layout, struts + tubes)
        state = np.zeros(context.num_continuous_states())
        for tree, block in reversed(
            list(zip(trees, blocks, strict=True))
        ):  # the drum's are those of the first
            state[tree] = block
        if struts + tubes:
            state[-struts - tubes :] = sponges
        context.SetContinuousState(state)
        machine.set_drum_acceleration(context, rng.uniform(-20.0, 20.0))
        told = machine.diagram.EvalTimeDerivatives(context).CopyToVector()
        own = told[len(told) - struts - tubes :]
        drake = [told[trees[0]], own[:struts]]
        drake += [
            np.append(told[tree], rate)
            for tree, rate in zip(trees[1:-1], own[struts:], strict=True)
        ]
        drake.append(told[trees[-1]])
        x = [blocks[0], sponges[:struts]]
        x += [
            np.append(block, delta)
            for block, delta in zip(blocks[1:-1], sponges[struts:], strict=True)
        ]
        x = np.concatenate([*x, blocks[-1][without_joint]])
        dx = derivative(x, told[trees[0]][DRUM_RATE])
        compiled = np.split(dx, np.cumsum([len(part) for part in drake])[:-1])
        compiled[-1] = np.insert(compiled[-1], (6, 12), (told[trees[0]][6], told[trees[0]][13]))
        for mine, its in zip(compiled, drake, strict=True):
            for part in VECTORS if len(its) >= 14 else [slice(None)]:
                scale = np.max(np.abs(its[part]), initial=1e-3)
                worst = max(worst, np.max(np.abs(mine[part] - its[part]), initial=0.0) / scale)
    return worst


@pytest.mark.parametrize("name", MACHINES)
def test_derivatives_are_those_of_the_diagram_at_1000_random_states(name):
    machine = build_machine(MACHINES[name])
    assert worst_difference(machine, machine.set_up(LOAD)) < 1e-10


def test_they_agree_without_load_gasket_and_dampers_and_with_other_numbers():
    machine = build_machine(MACHINES["reference"])
    other = with_bearing(load_machine("reference"), **OTHER_NUMBERS)
    assert worst_difference(machine, machine.set_up(), 200) < 1e-10
    assert worst_difference(machine, machine.set_up(LOAD, gasket=False, dampers=False), 200) < 1e-10
    assert worst_difference(machine, machine.set_up(LOAD, parameters=other), 200) < 1e-10


def redrawn(tmp_path, pattern, replacement):
    text, count = re.subn(
        pattern,
        replacement,
        sdf_path("oscillating_group.sdf").read_text(),
        count=1,
        flags=re.DOTALL,
    )
    assert count == 1
    (tmp_path / "redrawn.sdf").write_text(text)
    return MachineParameters.model_validate(
        MACHINES["reference"].model_dump() | {"model": str(tmp_path / "redrawn.sdf")}
    )


def test_a_drum_that_turns_about_another_axis_is_represented(tmp_path):
    pattern = r'(<joint name="drum_axis" type="revolute">)(.*?)<xyz>0 1 0</xyz>(<limit>.*?</limit>)'
    changed = r"\1<pose>0.02 0.1 -0.03 0.2 0.1 -0.3</pose>\2<xyz>0.1 0.9 -0.2</xyz>\3<dynamics><damping>0.3</damping></dynamics>"
    machine = build_machine(redrawn(tmp_path, pattern, changed))
    assert worst_difference(machine, machine.set_up(LOAD), 300) < 1e-10
    bearing = machine.set_up().bearing
    joint = machine.plant.GetJointByName("drum_axis")
    np.testing.assert_allclose(np.linalg.det(bearing.ground_side_rotation), 1.0)
    np.testing.assert_allclose(
        bearing.ground_side_rotation @ bearing.ground_side_rotation.T, np.eye(3), atol=1e-12
    )
    X_TF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
    axis = X_TF.rotation() @ joint.revolute_axis()
    np.testing.assert_allclose(bearing.ground_side_rotation[:, 1], axis, atol=1e-12)
    np.testing.assert_allclose(
        bearing.ground_side_point - X_TF.translation(), 0.15 * axis, atol=1e-12
    )


def test_a_joint_that_is_no_revolute_one_from_the_tub_is_refused(tmp_path):
    sliding = redrawn(
        tmp_path, r'name="drum_axis" type="revolute"', 'name="drum_axis" type="prismatic"'
    )
    with pytest.raises(
        InputError, match=r"imperfections.bearing: .* joint 'drum_axis' is prismatic, from 'tub'"
    ):
        build_machine(sliding)


@pytest.mark.parametrize("name", ["reference", pytest.param("free_stroke", marks=pytest.mark.slow)])
def test_a_run_moves_as_in_drake(name):
    machine = build_machine(MACHINES[name])
    case = Case("two", LOAD, SpinProfile(time=(0.0, 0.301, 1.0), speed=(8.0, 16.0, 40.0)))
    drake = simulate(machine, case, "drake")
    compiled = simulate(machine, case, step=machine.parameters.step / 4)
    assert list(drake.data_vars) == list(compiled.data_vars)
    for variable, largest in (
        ("displacement", 2e-4),
        ("drum_displacement", 2e-4),
        ("drum_tilt", 2e-4),
        ("bearing_force", 2e-4),
    ):
        size = float(np.abs(drake[variable]).max())
        np.testing.assert_allclose(
            compiled[variable], drake[variable], atol=largest * size, err_msg=variable
        )
    torque = float(np.abs(drake.motor_torque).max())
    np.testing.assert_allclose(compiled.motor_torque, drake.motor_torque, atol=1e-3 * torque)
