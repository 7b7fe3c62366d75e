"""Forces on the cabinet: balance of momentum, hand values, batch against record, definitions."""

import numpy as np
import pytest
from machines_of_each_kind import machines_of_each_kind
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation
from tube_energy import dense_run

from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance
from wm_drake.simulation.cases import Case
from wm_drake.simulation.mounts import force_measures, mount_names, mount_wrenches
from wm_drake.simulation.runs import simulate

LOAD = Load(unbalances=(Unbalance(mass=0.9, radius=0.24, y=-0.1),))
RUN_UP = SpinProfile(time=(0.0, 2.0), speed=(4.0, 30.0))
VIOLENT = Load(unbalances=(Unbalance(mass=60.0, radius=0.3, y=0.1),))


@pytest.fixture(scope="module")
def many_mounts():
    """Build a machine with two bushings and five dampers of three laws."""
    return build_machine(machines_of_each_kind()["two bushings, five dampers of three laws"])


def set_sample(machine, plant_context, trajectory, index):
    """Set the state of the plant to a sample of a trajectory."""
    parts = [trajectory.state[index], *trajectory.tubes[index]]
    states = np.zeros(2 * machine.state_layout.size)
    for where, values in zip(machine.state_layout.states(), parts, strict=True):
        states[where] = values
    machine.plant.SetPositionsAndVelocities(plant_context, states)


def balances(machine, trajectory, setup):
    """Return momentum and gravity of all bodies about the origin of W, computed by Drake.

    Returns:
        (n, 6) angular momentum and momentum, (n, 6) moment and force of gravity. SI.
    """
    plant, context = machine.plant, setup.plant_context
    momentum, gravity = np.empty((2, len(trajectory.time), 6))
    g = plant.gravity_field().gravity_vector()
    moving = [
        plant.get_body(index)
        for index in plant.GetBodyIndices(
            plant.GetModelInstanceByName(machine.parameters.model[:-4])
        )
        if not plant.IsAnchored(plant.get_body(index))
    ]
    for index in range(len(trajectory.time)):
        set_sample(machine, context, trajectory, index)
        momentum[index] = plant.CalcSpatialMomentumInWorldAboutPoint(
            context, np.zeros(3)
        ).get_coeffs()
        gravity[index] = 0.0
        for body in moving:
            mass = body.get_mass(context)
            centre = body.EvalPoseInWorld(context) @ body.CalcCenterOfMassInBodyFrame(context)
            gravity[index, :3] += np.cross(centre, mass * g)
            gravity[index, 3:] += mass * g
    return momentum, gravity


@pytest.mark.parametrize("kind", ["struts", "tubes"])
def test_forces_on_cabinet_balance_momentum_and_gravity(kind, shipped):
    """Check Newton and Euler for all moving bodies: dP/dt = gravity - force on the cabinet."""
    built = shipped("reference" if kind == "struts" else "free_stroke")
    setup = built.set_up(LOAD)
    trajectory = dense_run(setup, SpinProfile(time=(0.0, 0.5), speed=(15.0, 25.0)), 5e-4)
    on_cabinet = mount_wrenches(setup, trajectory).sum(axis=1)
    momentum, gravity = balances(built, trajectory, built.set_up(LOAD))
    impulse = cumulative_simpson(gravity - on_cabinet, x=trajectory.time, axis=0, initial=0.0)
    change = momentum - momentum[0]
    size = np.abs(change).max(axis=0)
    assert np.all(size > 0.1)  # N m s, N s
    np.testing.assert_allclose((change - impulse) / size, 0.0, atol=2e-4)


def test_machine_at_rest_puts_its_weight_on_the_cabinet(machine, upright):
    still = SpinProfile(time=(0.0, 0.1), speed=(0.0, 0.0))
    record = simulate(machine, Case("empty", Load(unbalances=()), still, parameters=upright))
    plant, context = machine.plant, machine.set_up().plant_context
    tub = plant.GetBodiesWeldedTo(plant.GetBodyByName("tub"))
    weight = 9.81 * sum(body.get_mass(context) for body in (*tub, plant.GetBodyByName("drum")))
    np.testing.assert_allclose(record.cabinet_force.values[-1], [0.0, 0.0, -weight], atol=1e-6)
    for name in machine.springs:  # they hang straight down from the cabinet
        force = record.mount_force.sel(mount=f"springs.{name}").values[-1]
        tension = float(record.spring_tension.sel(spring=name)[-1])
        np.testing.assert_allclose(force, [0.0, 0.0, -tension], atol=0.01 * tension)


def test_force_of_each_mount_is_that_of_its_element(many_mounts):
    record = simulate(many_mounts, Case("one", LOAD, RUN_UP))
    names = mount_names(many_mounts.parameters)
    assert list(record.mount.values) == list(names)
    for name in many_mounts.springs:
        size = np.linalg.norm(record.mount_force.sel(mount=f"springs.{name}"), axis=1)
        np.testing.assert_allclose(size, abs(record.spring_tension.sel(spring=name)), rtol=1e-12)
    for name in many_mounts.bushings:  # the axes of its frame on the cabinet are those of W
        mount = name if name == "gasket" else f"bushings.{name}"
        np.testing.assert_allclose(
            record.mount_force.sel(mount=mount), record.bushing_force.sel(bushing=name), atol=1e-9
        )
    for name, damper in many_mounts.set_up(LOAD).dampers.items():
        force = record.mount_force.sel(mount=f"dampers.{name}").values
        end = record.tub_position.values + turned(record, damper.p_ToA_T)
        line = end - damper.p_WH
        pull = np.einsum("ij,ij->i", force, line) / np.linalg.norm(line, axis=1)
        np.testing.assert_allclose(pull, record.damper_tension.sel(damper=name), atol=1e-9)


def turned(record, point):
    """Return a vector of T in W at all samples of a record."""
    return Rotation.from_euler("xyz", record.tub_angle.values).apply(point)


def test_definitions_of_the_measures():
    time = np.arange(1000) / 1000.0
    wave = np.sin(2.0 * np.pi * 5.0 * time)
    vectors = np.stack([np.stack([3.0 * wave, 0.0 * wave, 4.0 + 0.0 * wave], axis=1)], axis=1)
    peak, rms, dynamic = force_measures(vectors)
    assert (peak[0], rms[0], dynamic[0]) == pytest.approx(
        (5.0, np.sqrt(4.5 + 16.0), np.sqrt(4.5)), rel=1e-12
    )
    peak, rms, dynamic = force_measures((2.0 - 3.0 * wave)[:, None])
    assert (peak[0], rms[0], dynamic[0]) == pytest.approx(
        (5.0, np.sqrt(4.0 + 4.5), np.sqrt(4.5)), rel=1e-12
    )
    assert np.isnan(force_measures(np.zeros((0, 2, 3)))).all()
