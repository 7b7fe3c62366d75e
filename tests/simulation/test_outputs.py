"""Outputs of a record for each element, by name, against the port of that element in Drake."""

import numpy as np
import pytest
from element_ports import own_outputs
from machines_of_each_kind import machines_of_each_kind

from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate


def test_record_of_each_element_equals_its_port():
    parameters = machines_of_each_kind()["two bushings, five dampers of three laws"]
    machine = build_machine(parameters)
    load = Load(unbalances=(Unbalance(mass=0.8, radius=0.25, y=-0.1),))
    record = simulate(machine, Case("one", load, SpinProfile(time=(0.0, 2.0), speed=(4.0, 30.0))))
    setup = machine.set_up(load)
    sponges = [name for name, damper in setup.dampers.items() if damper.has_sponge]
    for index in (37, 211, 400):
        sample = record.isel(time=index)
        plant = [
            sample.tub_angle,
            sample.tub_position,
            [sample.drum_angle],
            sample.tub_angular_velocity,
        ]
        plant += [
            sample.tub_velocity,
            [sample.drum_speed],
            sample.damper_deformation.sel(damper=sponges),
        ]
        setup.context.SetContinuousState(np.concatenate(plant))

        def port(element):
            return own_outputs(element, element.GetMyContextFromRoot(setup.context))

        for name, spring in machine.springs.items():
            assert float(sample.spring_tension.sel(spring=name)) == pytest.approx(
                port(spring)[0], rel=1e-12
            )
        for name, damper in machine.dampers.items():
            assert float(sample.damper_tension.sel(damper=name)) == pytest.approx(
                port(damper)[0], rel=1e-9
            )
        for name, bushing in machine.bushings.items():
            recorded = np.concatenate(
                [sample[f"bushing_{kind}"].sel(bushing=name) for kind in ("force", "moment")]
            )
            np.testing.assert_allclose(recorded, port(bushing), rtol=1e-9, atol=1e-9)
        for name, sensor in parameters.sensors.items():
            poses = np.concatenate([sample.tub_angle, sample.tub_position]), setup.rest_pose
            now, at_rest = (position(machine, pose, setup.sensor_points[name]) for pose in poses)
            expected = (now - at_rest)["xyz".index(sensor.axis)]
            assert float(sample.displacement.sel(sensor=name)) == pytest.approx(expected, abs=1e-12)


def position(machine, pose, point):
    """Return the position in W of a point of the tub, computed by Drake's plant."""
    context = machine.plant.CreateDefaultContext()
    positions = machine.plant.GetPositions(context)
    positions[machine.state_layout.tub] = pose
    machine.plant.SetPositions(context, positions)
    tub, world = machine.plant.GetFrameByName("tub"), machine.plant.world_frame()
    return machine.plant.CalcPointsPositions(context, tub, point[:, None], world)[:, 0]
