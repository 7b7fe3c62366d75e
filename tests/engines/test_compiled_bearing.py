"""A drum that whirls in its bearing: the compiled machine against the Drake diagram, at random states and along a run."""

import numpy as np
import pytest
from both_engines import LOAD, check_alike, difference, redrawn
from machine_with_bearing import with_bearing

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate

SDF = "oscillating_group.sdf"
OTHER_NUMBERS = {
    "radial_stiffness": 3e5,
    "torsional_stiffness": 7e3,
    "torsional_damping": 1.0,
    "y": -0.07,
}


WHIRLING = with_bearing(load_machine("reference"))


def test_they_agree_without_load_gasket_and_dampers_and_with_other_numbers():
    machine = build_machine(WHIRLING)
    other = with_bearing(load_machine("reference"), **OTHER_NUMBERS)
    assert difference(machine, load=None) < 1e-10
    assert difference(machine, gasket=False, dampers=False) < 1e-10
    assert difference(machine, parameters=other) < 1e-10


LOOSE = {
    "radial_stiffness": 2e4,
    "clearance": 2e-4,
    "contact_stiffness": 4e6,
    "contact_damping": 600.0,
}


def test_they_agree_in_and_beyond_a_clearance():
    assert difference(build_machine(with_bearing(load_machine("reference"), **LOOSE))) < 1e-10


@pytest.mark.slow
def test_a_drum_that_hits_its_bearing_moves_as_in_drake():
    machine = build_machine(with_bearing(load_machine("reference"), step=1e-4, **LOOSE))
    case = Case("two", LOAD, SpinProfile(time=(0.0, 0.301, 1.0), speed=(8.0, 30.0, 60.0)))
    drake = simulate(machine, case, "drake-accurate")
    compiled = simulate(machine, case)
    x, z = drake.drum_displacement.sel(axis=["x", "z"]).values.T
    assert np.hypot(x, z).max() > LOOSE["clearance"]
    assert np.ptp(np.unwrap(np.arctan2(x, z))) > 2.0 * np.pi  # it is pulled out and goes round
    check_alike(compiled, drake, ("displacement", "drum_displacement"), 1e-2)


def machine_of(sdf):
    return MachineParameters.model_validate(WHIRLING.model_dump() | {"model": sdf})


def test_a_drum_that_turns_about_another_axis_is_represented(tmp_path):
    pattern = r'(<joint name="drum_axis" type="revolute">)(.*?)<xyz>0 1 0</xyz>(<limit>.*?</limit>)'
    changed = r"\1<pose>0.02 0.1 -0.03 0.2 0.1 -0.3</pose>\2<xyz>0.1 0.9 -0.2</xyz>\3<dynamics><damping>0.3</damping></dynamics>"
    machine = build_machine(machine_of(redrawn(tmp_path, SDF, (pattern, changed))))
    assert difference(machine) < 1e-10
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


@pytest.mark.parametrize(
    ("change", "joint"),
    [
        ((r'"drum_axis" type="revolute"', '"drum_axis" type="prismatic"'), "prismatic, from 'tub'"),
        ((r'("drum_axis".*?<parent>)tub<', r"\1motor<"), "revolute, from 'motor'"),
    ],
    ids=["slides", "of the motor"],
)
def test_a_joint_that_is_no_revolute_one_from_the_tub_is_refused(change, joint, tmp_path):
    other = machine_of(redrawn(tmp_path, SDF, change))
    message = rf"imperfections.bearing: .* needs a revolute joint .* joint 'drum_axis' is {joint}"
    with pytest.raises(InputError, match=message):
        build_machine(other)


@pytest.mark.parametrize("name", ["reference", pytest.param("free_stroke", marks=pytest.mark.slow)])
def test_a_run_moves_as_in_drake(name):
    machine = build_machine(with_bearing(load_machine(name)))
    case = Case("two", LOAD, SpinProfile(time=(0.0, 0.301, 1.0), speed=(8.0, 16.0, 40.0)))
    drake = simulate(machine, case, "drake-accurate")
    compiled = simulate(machine, case, step=machine.parameters.step / 4)
    variables = "displacement", "drum_displacement", "drum_tilt", "bearing_force"
    check_alike(compiled, drake, variables, 2e-4)
    check_alike(compiled, drake, ("motor_torque",), 1e-3)
