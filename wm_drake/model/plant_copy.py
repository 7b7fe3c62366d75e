"""A plant whose default Context has the numbers that another plant has in a Context.

Drake takes default inertias and default poses of frames from the constructors of bodies and frames,
which a parser calls with the numbers of the SDF. Other defaults need bodies that are added anew.
"""

from collections.abc import Iterator

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    Frame,
    Joint,
    JointActuator,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RpyFloatingJoint,
    WeldJoint,
)
from pydrake.systems.framework import Context

from wm_drake.model.bodies import share_axis_pose


def plant_at(source: MultibodyPlant, context: Context) -> MultibodyPlant:
    """Return a finalized plant whose default Context has numbers and positions of a Context.

    Bodies, frames, joints and actuators have the names and the order of those of the source. The
    frames are attached to their bodies. Default velocities are zero: Drake has no others.

    Args:
        source: Plant of a machine, from `wm_drake.model.bodies.add_bodies`.
        context: A Context of it.
    """
    plant = MultibodyPlant(time_step=0.0)
    for index in range(plant.num_model_instances(), source.num_model_instances()):
        plant.AddModelInstance(source.GetModelInstanceName(ModelInstanceIndex(index)))
    for body in _bodies(source):
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        plant.AddRigidBody(body.name(), body.model_instance(), inertia)
    for frame in _offset_frames(source):
        body_frame = plant.get_body(frame.body().index()).body_frame()
        pose = frame.CalcPoseInBodyFrame(context)
        plant.AddFrame(FixedOffsetFrame(frame.name(), body_frame, pose, frame.model_instance()))
    for joint in map(source.get_joint, source.GetJointIndices()):
        plant.AddJoint(_copied_joint(plant, joint))
    for actuator in _actuators(source):
        copied = plant.AddJointActuator(
            actuator.name(), plant.GetJointByName(actuator.joint().name())
        )
        copied.set_default_rotor_inertia(actuator.rotor_inertia(context))
        copied.set_default_gear_ratio(actuator.gear_ratio(context))
    gravity = source.gravity_field().gravity_vector()
    plant.mutable_gravity_field().set_gravity_vector(gravity)
    plant.Finalize()
    plant.SetDefaultPositions(source.GetPositions(context))
    share_axis_pose(source, plant)
    return plant


def copy_numbers(
    source: MultibodyPlant, context: Context, plant: MultibodyPlant, target: Context
) -> None:
    """Set numbers and positions of a plant's Context in a Context of its copy, at rest.

    Args:
        source, context: The plant that was copied, and its Context.
        plant, target: Its copy from `plant_at`, and the Context that is changed.
    """
    for body in _bodies(source):
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        plant.get_body(body.index()).SetSpatialInertiaInBodyFrame(target, inertia)
    for frame in _offset_frames(source):
        copied = plant.GetFrameByName(frame.name(), frame.model_instance())
        copied.SetPoseInParentFrame(target, frame.CalcPoseInBodyFrame(context))
    for actuator in _actuators(source):
        copied = plant.GetJointActuatorByName(actuator.name())
        copied.SetRotorInertia(target, actuator.rotor_inertia(context))
        copied.SetGearRatio(target, actuator.gear_ratio(context))
    plant.SetPositions(target, source.GetPositions(context))
    plant.SetVelocities(target, source.GetVelocities(context))


def _bodies(plant: MultibodyPlant) -> Iterator[RigidBody]:
    """Yield all bodies but the world, in their order."""
    return map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies())))


def _offset_frames(plant: MultibodyPlant) -> Iterator[Frame]:
    """Yield all frames that are not those of bodies."""
    for instance in map(ModelInstanceIndex, range(plant.num_model_instances())):
        for frame in map(plant.get_frame, plant.GetFrameIndices(instance)):
            if not frame.is_body_frame():
                yield frame


def _actuators(plant: MultibodyPlant) -> Iterator[JointActuator]:
    """Yield all actuators."""
    return map(plant.get_joint_actuator, plant.GetJointActuatorIndices())


def _copied_joint(plant: MultibodyPlant, joint: Joint) -> Joint:
    """Return a joint as another one, between the frames of the same names in a plant."""
    frames = (
        plant.GetFrameByName(frame.name(), frame.model_instance())
        for frame in (joint.frame_on_parent(), joint.frame_on_child())
    )
    if isinstance(joint, WeldJoint):
        return WeldJoint(joint.name(), *frames, joint.X_FM())
    if isinstance(joint, RpyFloatingJoint):
        return RpyFloatingJoint(joint.name(), *frames)
    damping = joint.default_damping_vector()[0]
    if isinstance(joint, RevoluteJoint):
        return RevoluteJoint(joint.name(), *frames, joint.revolute_axis(), damping)
    assert isinstance(joint, PrismaticJoint)  # `check_elements` refuses other types
    return PrismaticJoint(joint.name(), *frames, joint.translation_axis(), damping=damping)
