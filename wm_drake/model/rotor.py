"""Inertia of the rotor of a motor that turns the drum through a belt.

Own derivation. The motor is fixed to the tub and turns parallel to the drum axis a, n times as fast
as the drum: its angular velocity along a is w . a + n r, with the angular velocity w of the tub and
the rate r of the drum against it. With the rotor's inertia J about its axis, its kinetic energy is

    1/2 J (w . a + n r)^2 = 1/2 J (w . a)^2 + n J (w . a) r + 1/2 n^2 J r^2

The tub's inertia contains the first term. The others are exactly those of

    1/2 (n J) (w . a + r)^2  -  1/2 (n J) (w . a)^2  +  1/2 (n^2 - n) J r^2

that is: an inertia n J about a at the drum, the same taken away from the tub, and a reflected
inertia (n^2 - n) J, which acts on the joint alone. Thus the reaction of the rotor on the tub and
its gyroscopic moment are represented without neglect, in the masses that both engines read. The
belt is rigid, without mass and without slip, and rotor and pulley are balanced.
"""

from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    JointActuator,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
)

from wm_drake.errors import input_error
from wm_drake.parameters import MotorDrive
from wm_drake.parameters.types import FloatArray


def set_rotor(plant: MultibodyPlant, context: Any, drive: MotorDrive) -> None:
    """Add the inertia of a rotor to drum, tub and actuator in a plant Context.

    Raises:
        InputError: the joint is not revolute, or the tub's inertia is too small.
    """
    joint = plant.GetJointByName(drive.joint)
    if not isinstance(joint, RevoluteJoint):
        raise input_error(
            f"a motor needs a revolute joint; '{joint.name()}' is {joint.type_name()}",
            key="drive.joint",
        )
    n, inertia = drive.belt_ratio, drive.rotor_inertia
    ends = {
        body.name(): frame.GetFixedPoseInBodyFrame().rotation() @ joint.revolute_axis()
        for body, frame in (
            (joint.parent_body(), joint.frame_on_parent()),
            (joint.child_body(), joint.frame_on_child()),
        )
    }
    try:
        for name, axis in ends.items():
            share = n * inertia if name == "drum" else -n * inertia
            _add_about_axis(plant.GetBodyByName(name), context, axis, share)
    except RuntimeError:  # Drake: the inertia of no body
        raise input_error(
            f"{inertia:g} kg m^2 with a belt ratio of {n:g} is too large for the inertia of the "
            "tub; allowed is the inertia of a rotor that is part of the tub",
            key="drive.rotor_inertia",
        ) from None
    actuator = actuator_of(plant, drive.joint)
    actuator.SetRotorInertia(context, inertia * (1.0 - 1.0 / n))
    actuator.SetGearRatio(context, n)


def actuator_of(plant: MultibodyPlant, joint: str) -> JointActuator:
    """Return the actuator of a joint."""
    actuators = map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
    return next(actuator for actuator in actuators if actuator.joint().name() == joint)


def _add_about_axis(body: RigidBody, context: Any, axis: FloatArray, inertia: float) -> None:
    """Add an inertia about an axis, without mass, to a body in a plant Context. [kg m^2]"""
    whole = body.CalcSpatialInertiaInBodyFrame(context)
    central = whole.Shift(whole.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    matrix = central + inertia * np.outer(axis, axis)
    body.SetSpatialInertiaInBodyFrame(
        context,
        SpatialInertia.MakeFromCentralInertia(
            whole.get_mass(),
            whole.get_com(),
            RotationalInertia(*np.diag(matrix), matrix[0, 1], matrix[0, 2], matrix[1, 2]),
        ),
    )
