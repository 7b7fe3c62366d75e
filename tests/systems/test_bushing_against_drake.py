"""Six-component bushing against Drake's LinearBushingRollPitchYaw, with which it agrees to first order in the amplitude.

Drake's stiffness lives in a frame halfway between the two ends and counts roll, pitch and yaw; ours lives in the ground-side
frame and counts the rotation vector. Both differences are of second order.
"""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    LinearBushingRollPitchYaw,
    MultibodyForces,
    RpyFloatingJoint,
    SpatialInertia,
)

from wm_drake.elements.bushing import (
    SIX_COMPONENT_BUSHING,
    SixComponentBushingParameters,
    packed_bushing_law,
)
from wm_drake.parameters.elements import Bushing
from wm_drake.systems.element_system import element_system

STIFFNESS = np.array([8e3, 3e3, 6e3])  # N/m
ROTATIONAL_STIFFNESS = np.array([73.0, 890.0, 150.0])  # N m/rad
DAMPING = np.array([50.0, 10.0, 40.0])  # N s/m
ROTATIONAL_DAMPING = np.array([3.0, 5.0, 4.0])  # N m s/rad
P_WG = np.array([0.02, -0.16, 0.05])  # m; both frames at rest
R_WG = RotationMatrix(RollPitchYaw([0.2, -0.1, 0.6]))


def drake_plant(stiffness_only):
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    tub = plant.AddRigidBody("tub", SpatialInertia.SolidSphereWithMass(40.0, 0.3))
    plant.AddJoint(RpyFloatingJoint("tub_floats", plant.world_frame(), tub.body_frame()))
    X = RigidTransform(R_WG, P_WG)
    ground = plant.AddFrame(FixedOffsetFrame("ground_side", plant.world_frame(), X))
    tub_side = plant.AddFrame(FixedOffsetFrame("tub_side", tub.body_frame(), X))
    damping = 0.0 if stiffness_only else 1.0
    plant.AddForceElement(
        LinearBushingRollPitchYaw(
            ground,
            tub_side,
            ROTATIONAL_STIFFNESS,
            damping * ROTATIONAL_DAMPING,
            STIFFNESS,
            damping * DAMPING,
        )
    )
    plant.Finalize()
    return plant


def wrench_of_drake(plant, x):
    """Return moment about To and force of Drake's bushing on the tub, in W."""
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, np.delete(x, [6, 13]))
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    return plant.CalcGeneralizedForces(context, forces)


def our_bushing(stiffness_only):
    damping = 0.0 if stiffness_only else 1.0
    numbers = {}
    for i, axis in enumerate("xyz"):
        numbers[f"stiffness_{axis}"] = STIFFNESS[i]
        numbers[f"rotational_stiffness_{axis}"] = ROTATIONAL_STIFFNESS[i]
        numbers[f"damping_{axis}"] = damping * DAMPING[i]
        numbers[f"rotational_damping_{axis}"] = damping * ROTATIONAL_DAMPING[i]
    law = packed_bushing_law(Bushing(tub_frame="tub_side", housing_frame="ground_side", **numbers))
    return element_system(
        SIX_COMPONENT_BUSHING,
        SixComponentBushingParameters(P_WG, R_WG.matrix(), P_WG, R_WG.matrix(), law).packed(),
    )


def our_wrench(bushing, x):
    context = bushing.CreateDefaultContext()
    bushing.GetInputPort("plant_state").FixValue(context, x)
    return bushing.GetOutputPort("generalized_force").Eval(context)[:6]


def relative_difference(amplitude, stiffness_only):
    """Return the largest of ten random motions with angles [rad] and displacements [10 cm] of it."""
    rng = np.random.default_rng(41)
    # rad, m, rad/s, m/s
    sizes = np.array([1.0] * 3 + [0.1] * 3 + [0.0] + [1.0] * 3 + [0.1] * 3 + [0.0])
    plant, bushing = drake_plant(stiffness_only), our_bushing(stiffness_only)
    states = amplitude * rng.uniform(-1.0, 1.0, (10, 14)) * sizes
    ours, theirs = (
        np.array([w(s, x) for x in states])
        for w, s in ((our_wrench, bushing), (wrench_of_drake, plant))
    )
    ours, theirs = ours.reshape(20, 3), theirs.reshape(20, 3)  # moments and forces, one by one
    return np.max(np.linalg.norm(ours - theirs, axis=1) / np.linalg.norm(theirs, axis=1))


@pytest.mark.parametrize(
    "stiffness_only", [True, False], ids=["stiffness", "stiffness and damping"]
)
def test_the_difference_shrinks_with_the_amplitude(stiffness_only):
    amplitudes = np.array([1e-2, 1e-3, 1e-4, 1e-5])
    differences = np.array([relative_difference(a, stiffness_only) for a in amplitudes])
    assert np.all(differences < amplitudes)
    assert differences[:-1] / differences[1:] == pytest.approx([10.0] * 3, rel=0.1)


def test_along_one_axis_without_rotation_they_are_equal():
    plant, bushing = drake_plant(False), our_bushing(False)
    along = R_WG.matrix() @ [0.0, 0.01, 0.0]  # m
    x = np.concatenate([[0.0] * 3, along, [0.0] * 4, 3.0 * along, [0.0]])
    np.testing.assert_allclose(
        our_wrench(bushing, x), wrench_of_drake(plant, x), rtol=1e-12, atol=1e-12
    )
    force = -(3e3 * 0.01 + 10.0 * 0.03)  # N
    np.testing.assert_allclose(
        our_wrench(bushing, x)[3:], R_WG.matrix() @ [0.0, force, 0.0], rtol=1e-12, atol=1e-12
    )
