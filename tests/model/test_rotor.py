"""The rotor of a motor in the masses of tub and drum, against a plant in which it is a body of its own."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    RpyFloatingJoint,
    SpatialInertia,
    UnitInertia,
)

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, Unbalance, load_machine, with_values

LOAD = Load(unbalances=(Unbalance(mass=0.8, radius=0.24, y=-0.1, phase=0.7),))
PLACE = np.array([0.12, 0.09, -0.28])  # of the motor on the tub


@pytest.fixture(scope="module")
def driven(shipped):
    machine = shipped("motor")
    return machine, machine.set_up(LOAD)


def explicit_plant(setup):
    """Return a plant of tub group, drum and a rotor whose axis is parallel to the drum's."""
    plain = build_machine(load_machine("reference"))
    old = plain.set_up(LOAD)
    plant = MultibodyPlant(0.0)
    zero = np.zeros(plain.plant.num_positions())
    plain.plant.SetPositions(old.plant_context, zero)
    inertias = {}
    for name in ("tub", "drum"):
        body = plain.plant.GetBodyByName(name)
        group = [part.index() for part in plain.plant.GetBodiesWeldedTo(body)]
        inertias[name] = plain.plant.CalcSpatialInertia(
            old.plant_context, plain.plant.GetBodyByName("tub").body_frame(), group
        )
    j = setup.motor.rotor_inertia
    rotor = SpatialInertia.MakeFromCentralInertia(1.2, np.zeros(3), RotationalInertia(j, j, j))
    # the tub group contains the rotor that does not turn
    locked = SpatialInertia.MakeFromCentralInertia(1.2, PLACE, RotationalInertia(j, j, j))
    whole = inertias["tub"]
    central = (
        whole.CalcRotationalInertia().CopyToFullMatrix3()
        - locked.CalcRotationalInertia().CopyToFullMatrix3()
    )
    mass = whole.get_mass() - 1.2
    centre = (whole.get_mass() * whole.get_com() - 1.2 * PLACE) / mass
    about_origin = RotationalInertia(*np.diag(central), central[0, 1], central[0, 2], central[1, 2])
    rest = SpatialInertia(mass, centre, UnitInertia(about_origin / mass))
    tub, drum = plant.AddRigidBody("tub", rest), plant.AddRigidBody("drum", inertias["drum"])
    turning = plant.AddRigidBody("rotor", rotor)
    plant.AddJoint(RpyFloatingJoint("floating", plant.world_frame(), tub.body_frame()))
    plant.AddJoint(RevoluteJoint("drum", tub.body_frame(), drum.body_frame(), [0, 1, 0]))
    at = plant.AddFrame(FixedOffsetFrame("at", tub.body_frame(), RigidTransform(PLACE)))
    plant.AddJoint(RevoluteJoint("rotor", at, turning.body_frame(), [0, 1, 0]))
    plant.Finalize()
    return plant


def test_masses_and_velocity_terms_are_those_of_a_rotor_that_is_a_body(driven):
    """Compare M and C v with the plant whose belt turns the rotor n times as fast as the drum."""
    machine, setup = driven
    plant, n = explicit_plant(setup), setup.motor.belt_ratio
    tied = np.zeros((8, 7))
    tied[:7] = np.eye(7)
    tied[7, 6] = n
    rng, context = np.random.default_rng(3), plant.CreateDefaultContext()
    own, own_context = machine.plant, setup.plant_context
    for _ in range(5):
        q, v = rng.uniform(-0.5, 0.5, 7), rng.uniform(-5.0, 5.0, 7)
        plant.SetPositions(context, np.append(q, n * q[6]))
        plant.SetVelocities(context, tied @ v)
        own.SetPositions(own_context, q)
        own.SetVelocities(own_context, v)
        mass = tied.T @ plant.CalcMassMatrix(context) @ tied
        np.testing.assert_allclose(own.CalcMassMatrix(own_context), mass, rtol=1e-9, atol=1e-12)
        bias = tied.T @ plant.CalcBiasTerm(context)
        np.testing.assert_allclose(own.CalcBiasTerm(own_context), bias, rtol=1e-9, atol=1e-9)


def test_a_direct_drive_turns_with_the_drum(driven):
    machine, _ = driven
    direct = with_values(machine.parameters, {"drive.belt_ratio": 1.0})
    setup = machine.set_up(parameters=direct)
    index = machine.state_layout.drum
    found = machine.plant.CalcMassMatrix(setup.plant_context)[index, index]
    none = machine.set_up(
        parameters=with_values(direct, {"drive.rotor_inertia": 0.0}), context=setup.context
    )
    plain = machine.plant.CalcMassMatrix(none.plant_context)[index, index]
    assert found - plain == pytest.approx(machine.parameters.drive.rotor_inertia)


def test_a_rotor_that_is_no_part_of_the_tub_is_refused(driven):
    machine, _ = driven
    heavy = with_values(machine.parameters, {"drive.rotor_inertia": 1.0})
    with pytest.raises(InputError, match=r"drive\.rotor_inertia: 1 kg m\^2 .* too large"):
        machine.set_up(parameters=heavy)
