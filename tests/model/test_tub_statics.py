"""Forces on a tub at rest: the compiled mounts and the weight against Drake's gravity."""

import numpy as np
from applied_force import elastic_and_gravity_force

from wm_drake import with_values
from wm_drake.model.tub_statics import TubStatics, about_tub, weight_of


def test_wrench_is_that_of_drake_at_any_pose(machine):
    """Elements one by one and Drake's generalized force of gravity are the other way to it."""
    setup = machine.set_up()
    weight = weight_of(machine.plant, setup.plant_context)
    statics = TubStatics(setup.elements, weight)
    rng = np.random.default_rng(0)
    for pose in rng.uniform(-1.0, 1.0, (5, 6)) * [0.02, 0.02, 0.02, 0.01, 0.01, 0.01]:
        q = machine.plant.GetPositions(setup.plant_context)
        q[machine.state_layout.tub] = pose
        machine.plant.SetPositions(setup.plant_context, q)
        expected = elastic_and_gravity_force(machine, setup)
        found = about_tub(statics.wrench(pose), pose)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10)  # N and N m


def test_rest_pose_is_one_of_drake(machine):
    """Drake's gravity and the elements one by one leave nothing at the rest pose."""
    for values in ({}, {"bodies.motor.mass": 7.0}, {"gasket.damping_x": 30.0}):
        changed = with_values(machine.parameters, values)
        setup = machine.set_up(parameters=changed)
        assert np.abs(elastic_and_gravity_force(machine, setup)).max() < 1e-9  # N and N m


def test_setup_for_the_compiled_engine_has_the_same_numbers(machine):
    """Compare what the compiled engine reads, with and without changes to the diagram."""
    changed = with_values(machine.parameters, {"gasket.damping_x": 30.0})
    whole, lean = (machine.set_up(parameters=changed, systems=systems) for systems in (True, False))
    np.testing.assert_array_equal(lean.rest_pose, whole.rest_pose)
    np.testing.assert_array_equal(lean.measured_points, whole.measured_points)
    packed = [setup.elements.packed_on_tub()[0] for setup in (lean, whole)]
    np.testing.assert_array_equal(*packed)
