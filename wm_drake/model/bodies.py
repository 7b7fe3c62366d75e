"""Bodies of a machine: the plant built from its SDF, with overrides and load set in a Context."""

import copy
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    JointActuator,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    RpyFloatingJoint,
    SpatialInertia,
    UnitInertia,
)

from wm_drake.errors import InputError, Problem, check_known, input_error, nearest_names, shortened
from wm_drake.model.rotor import set_rotor
from wm_drake.model.sdf_files import (
    LARGEST_SDF,
    PACKAGE,
    check_elements,
    check_mass_properties,
    readable,
    sdf_roots,
)
from wm_drake.model.sdf_names import frame_problems, sdf_names
from wm_drake.model.sdf_text import Node
from wm_drake.model.state_layout import CABINET, CARRIER
from wm_drake.parameters import BodyOverride, InertiaMatrix, Load, MachineParameters, with_value
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.inertia import fault_of_mass_properties
from wm_drake.parameters.text_files import check_regular, is_file
from wm_drake.systems.speed_source import REFLECTED_INERTIA

_PACKAGE = Path(__file__).parents[1]
SDF_FOLDER = _PACKAGE / "sdf" if (_PACKAGE / "sdf").is_dir() else _PACKAGE.parent / "sdf"
"""Folder of the SDF models: in an installed package inside it, in a checkout beside it."""

LONGEST_REASON = 200
"""Largest number of characters of Drake's reason in a message."""


def sdf_path(model: str) -> Path:
    """Return the path of an SDF file.

    Args:
        model: Name of a shipped SDF file, or an absolute path.
    """
    path = Path(model) if Path(model).is_absolute() else SDF_FOLDER / model
    if not is_file(path):
        known = [shipped.name for shipped in SDF_FOLDER.glob("*.sdf")]
        raise input_error(f"no SDF file '{model}'{nearest_names(model, known)}", key="model")
    check_regular(path, key="model", largest=LARGEST_SDF)
    return path


def unusable(path: Path, error: BaseException) -> InputError:
    """Return the error of an SDF file that Drake refuses, with Drake's reason."""
    reason = " ".join(
        str(error).replace(f"{path.parent}/", "").replace(f"/{path.name}", path.name).split()
    )
    return input_error(
        f"SDF '{path.name}' cannot be read: {shortened(reason, LONGEST_REASON)}", key="model"
    )


DRUM = "drum"
"""Name of the link that carries the load."""


def add_bodies(plant: MultibodyPlant, parameters: MachineParameters) -> None:
    """Add the bodies of a machine to a plant and finalize it. The SDF is parsed strictly.

    The tub gets an RpyFloatingJoint, which an SDF file cannot contain; tub and drum then have 7
    positions and 7 velocities. The outer tubes of telescopic dampers get one too. The reflected
    inertia of a prescribed drive makes the drum follow its speed source
    (`wm_drake.systems.speed_source`); `set_bodies` replaces it by that of a motor.
    With a compliant bearing the drum turns in a massless floating body, the drum carrier
    (`wm_drake.model.state_layout.CARRIER`). Its frame coincides with T in the drawn pose. A cabinet
    that moves is a floating body too; the housing of the SDF stays where it is drawn, and gives the
    mounting points in the frame of the cabinet.

    Raises:
        InputError: there is no such file, it is not valid SDF, it lacks a body or a joint, or a new
            frame cannot be added.
    """
    path = sdf_path(parameters.model)
    roots = sdf_roots(path)
    check_elements(roots)
    try:
        _add_bodies(plant, parameters, path, roots)
    except (RuntimeError, ValueError, SystemExit) as error:
        # Drake refuses what it reads or joins; it turns failed assertions into exits
        raise unusable(path, error) from None
    fixed = plant.GetBodiesWeldedTo(plant.world_body())
    check_mass_properties(roots, [body.name() for body in fixed])


def _add_bodies(
    plant: MultibodyPlant, parameters: MachineParameters, path: Path, roots: dict[Path, Node]
) -> None:
    """Add the bodies of a checked SDF to a plant and finalize it, as `add_bodies` describes."""
    parser = Parser(plant)
    parser.SetStrictParsing()
    with readable(path, roots) as (file, folder):
        parser.package_map().Add(PACKAGE, str(folder))
        parser.AddModels(str(file))
    missing = [
        f"link '{name}'" for name in ("housing", "tub", "drum") if not plant.HasBodyNamed(name)
    ]
    if (
        not plant.HasJointNamed(parameters.drive.joint)
        or not plant.GetJointByName(parameters.drive.joint).num_velocities()
    ):
        joints = [
            joint.name()
            for joint in map(plant.get_joint, plant.GetJointIndices())
            if joint.num_velocities()
        ]
        hint = nearest_names(parameters.drive.joint, joints)
        raise input_error(
            f"no moving joint '{parameters.drive.joint}' in the SDF{hint}", key="drive.joint"
        )
    if missing:
        raise input_error(
            f"SDF '{parameters.model}' has no {' and no '.join(missing)}", key="model"
        )
    floating = [
        plant.GetBodyByName("tub"),
        *(outer_tube(plant, parameters, name) for name in parameters.telescopic_dampers),
    ]
    for body in floating:
        frame = _add_drawn_frame(plant, body)
        plant.AddJoint(RpyFloatingJoint(f"{body.name()}_floating", plant.world_frame(), frame))
    actuator = _drive_actuator(plant, parameters.drive.joint)
    if parameters.imperfections.bearing:
        actuator = _attach_drum_to_carrier(plant, actuator)
    if parameters.cabinet_moves:
        _add_cabinet(plant)
    actuator.set_default_rotor_inertia(REFLECTED_INERTIA)
    actuator.set_default_gear_ratio(1.0)
    _add_frames(plant, parameters)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -parameters.gravity])
    plant.Finalize()
    _check_degrees_of_freedom(plant, parameters)
    _check_axis(plant, parameters.drive.joint, path.name)


_DRAWN = "as_drawn"
"""Model instance of the frames at the places of bodies whose links have a pose in the SDF."""


def _add_drawn_frame(plant: MultibodyPlant, body: RigidBody) -> Frame:
    """Return the frame of a floating body that coincides with W as drawn; add it if needed.

    A link without a pose has its own frame there. The coordinates of the tub are those of this
    frame, so that all of them are 0 as drawn, wherever the SDF has the frame of the link.
    """
    X_WB = plant.GetDefaultFloatingBaseBodyPose(body)
    if X_WB.IsExactlyIdentity():
        return body.body_frame()
    if not plant.HasModelInstanceNamed(_DRAWN):
        plant.AddModelInstance(_DRAWN)
    instance = plant.GetModelInstanceByName(_DRAWN)
    return plant.AddFrame(
        FixedOffsetFrame(f"{body.name()}_{_DRAWN}", body.body_frame(), X_WB.inverse(), instance)
    )


def drawn_frame(plant: MultibodyPlant, body: RigidBody) -> Frame:
    """Return the frame of a floating body that coincides with W as drawn: T, of the tub."""
    name = f"{body.name()}_{_DRAWN}"
    return plant.GetFrameByName(name) if plant.HasFrameNamed(name) else body.body_frame()


def drawn_pose(plant: MultibodyPlant, frame: Frame) -> RigidTransform:
    """Return the pose of a frame in the `drawn_frame` of its body."""
    X_BT = drawn_frame(plant, frame.body()).GetFixedPoseInBodyFrame()
    return X_BT.inverse() @ frame.GetFixedPoseInBodyFrame()


_ROUNDING = 1e-9
"""Largest difference of an axis from the y axis of its link that is rounding. [rad, m]"""

_AXIS_POSES: WeakKeyDictionary[MultibodyPlant, RigidTransform] = WeakKeyDictionary()


def axis_pose(plant: MultibodyPlant) -> RigidTransform:
    """Return the pose of D, in which loads are given, in the frame of the link of the drum.

    D is the link frame if the axis of the drum is its y axis. Otherwise the origin of D is the
    point of the axis nearest to that of the link, y is along the axis, and z points up as drawn.
    It is computed once for each plant.
    """
    pose = _AXIS_POSES.get(plant)
    if pose is None:
        pose = _AXIS_POSES[plant] = _axis_pose(plant)
    return pose


def share_axis_pose(plant: MultibodyPlant, copy: MultibodyPlant) -> None:
    """Make the `axis_pose` of a plant that of its copy, which by default is not as drawn."""
    _AXIS_POSES[copy] = axis_pose(plant)


def _axis_pose(plant: MultibodyPlant) -> RigidTransform:
    joint = plant.get_joint_actuator(plant.GetJointActuatorIndices()[0]).joint()
    if not isinstance(joint, RevoluteJoint):
        return RigidTransform()
    context, drum = plant.CreateDefaultContext(), plant.GetBodyByName(DRUM).body_frame()
    X_BF = plant.CalcRelativeTransform(context, drum, joint.frame_on_child())
    axis, point = X_BF.rotation() @ joint.revolute_axis(), X_BF.translation()
    origin = point - (axis @ point) * axis
    if np.abs(axis - [0.0, 1.0, 0.0]).max() < _ROUNDING and np.abs(origin).max() < _ROUNDING:
        return RigidTransform()
    R_BW = plant.CalcRelativeRotationMatrix(context, drum, plant.world_frame())
    up = R_BW @ np.array([0.0, 0.0, 1.0])
    z = up - (axis @ up) * axis
    z /= np.linalg.norm(z)
    return RigidTransform(RotationMatrix(np.column_stack([np.cross(axis, z), axis, z])), origin)


LARGEST_TILT_DEG = 45.0
"""Largest angle between the drum axis and y: a front loader's drum is tilted by up to 20 deg."""


def _check_axis(plant: MultibodyPlant, joint_name: str, file: str) -> None:
    """Check that the drum of a finalized plant turns about an axis that points to the rear.

    Raises:
        InputError: it points elsewhere; the message says how to turn the model.
    """
    joint = plant.GetJointByName(joint_name)
    if not isinstance(joint, RevoluteJoint):
        return
    frame = joint.frame_on_parent()
    R_WF = frame.CalcPoseInWorld(plant.CreateDefaultContext()).rotation()
    x, y, z = R_WF @ joint.revolute_axis()
    if y >= np.cos(np.radians(LARGEST_TILT_DEG)):
        return
    way = f"{x:.3g} {y:.3g} {z:.3g} of the model"
    if y <= -np.cos(np.radians(LARGEST_TILT_DEG)):
        how = "write the opposite <xyz>, and the speeds of the profile below 0"
    else:
        turn = f"0 0 {np.sign(x) * 90:g}" if abs(x) > abs(z) else f"{np.sign(z) * -90:g} 0 0"
        how = (
            "x points to the right, y from the door to the rear, z up. To turn the model write "
            f'<pose degrees="true">0 0 0 {turn}</pose> into <model>; if only the axis is wrong, '
            "write <xyz>0 1 0</xyz>"
        )
    raise input_error(
        f"SDF '{file}': joint '{joint_name}' turns the drum about {way}; allowed is y, from the "
        f"front to the rear: {how}",
        key="model",
    )


def outer_tube(plant: MultibodyPlant, parameters: MachineParameters, name: str) -> RigidBody:
    """Return the outer tube of a telescopic damper, the parent of its joint.

    Raises:
        InputError: there is no such joint, or it is not prismatic.
    """
    key, joint_name = f"telescopic_dampers.{name}.joint", parameters.telescopic_dampers[name].joint
    joints = [joint.name() for joint in map(plant.get_joint, plant.GetJointIndices())]
    check_known(joint_name, joints, f"no joint '{joint_name}' in the SDF", key=key)
    joint = plant.GetJointByName(joint_name)
    if not isinstance(joint, PrismaticJoint):
        raise input_error(f"joint '{joint_name}' is {joint.type_name()}, not prismatic", key=key)
    return joint.parent_body()


def _drive_actuator(plant: MultibodyPlant, joint_name: str) -> JointActuator:
    """Return the actuator of the drive's joint.

    Drake's parser adds an actuator to every moving joint whose effort limit is not 0.

    Raises:
        InputError: another joint has an actuator, or the drive's joint has an effort limit.
    """
    actuators = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    if [actuator.joint().name() for actuator in actuators] != [joint_name] or np.isfinite(
        actuators[0].effort_limit()
    ):
        raise input_error(
            f"joint '{joint_name}' must be the only one with an actuator and must have no effort "
            "limit; give every other moving joint <effort>0</effort>",
            key="drive.joint",
        )
    return actuators[0]


def _attach_drum_to_carrier(plant: MultibodyPlant, actuator: JointActuator) -> JointActuator:
    """Replace the tub by a massless floating body, the carrier, as the parent of the drum's joint.

    Args:
        actuator: Actuator of the drum's joint; it is removed together with the joint.

    Returns:
        The actuator of the new joint.

    Raises:
        InputError: the joint is not a revolute joint from tub to drum.
    """
    joint, key = actuator.joint(), "imperfections.bearing"
    if not isinstance(joint, RevoluteJoint) or joint.parent_body().name() != "tub":
        raise input_error(
            "a compliant bearing needs a revolute joint from 'tub' to 'drum'; joint "
            f"'{joint.name()}' is {joint.type_name()}, from '{joint.parent_body().name()}'",
            key=key,
        )
    name, axis, damping = joint.name(), joint.revolute_axis(), joint.default_damping_vector()[0]
    X_TF, on_drum = drawn_pose(plant, joint.frame_on_parent()), joint.frame_on_child()
    plant.RemoveJointActuator(actuator)
    plant.RemoveJoint(joint)
    carrier = plant.AddRigidBody(CARRIER, plant.AddModelInstance("bearing"), SpatialInertia.Zero())
    frame = plant.AddFrame(FixedOffsetFrame(f"{CARRIER}_axis", carrier.body_frame(), X_TF))
    plant.AddJoint(
        RpyFloatingJoint(f"{CARRIER}_floating", plant.world_frame(), carrier.body_frame())
    )
    return plant.AddJointActuator(
        name, plant.AddJoint(RevoluteJoint(name, frame, on_drum, axis, damping))
    )


def _add_cabinet(plant: MultibodyPlant) -> None:
    """Add the body of a cabinet that moves; `set_bodies` sets its mass properties."""
    body = plant.AddRigidBody(CABINET, plant.AddModelInstance(CABINET), SpatialInertia.Zero())
    plant.AddJoint(RpyFloatingJoint(f"{CABINET}_floating", plant.world_frame(), body.body_frame()))


def cabinet_inertia(cabinet: Cabinet) -> SpatialInertia:
    """Return the spatial inertia of a cabinet about the origin of its frame."""
    assert cabinet.inertia is not None  # a cabinet that moves has it
    return SpatialInertia.MakeFromCentralInertia(
        cabinet.mass, np.array(cabinet.centre_of_mass), rotational_inertia(cabinet.inertia)
    )


def _add_frames(plant: MultibodyPlant, parameters: MachineParameters) -> None:
    """Add the frames that a machine attaches to links of its SDF.

    Raises:
        InputError: the SDF has such a frame already, or has no such link.
    """
    problems = []
    instance = plant.GetBodyByName("tub").model_instance()
    links = [plant.get_body(index).name() for index in plant.GetBodyIndices(instance)]
    for name, frame in parameters.frames.items():
        if frame.attached_to is None:
            continue
        if plant.HasFrameNamed(name):
            message = "is a frame of the SDF; leave attached_to and angles out, or rename it"
            problems.append(Problem("", f"frames.{name}", message))
        elif frame.attached_to not in links:
            message = f"no link '{frame.attached_to}' in the SDF"
            message += nearest_names(frame.attached_to, links)
            problems.append(Problem("", f"frames.{name}.attached_to", message))
        else:
            pose = RigidTransform(RollPitchYaw(frame.angles or np.zeros(3)), frame.position)
            body = plant.GetBodyByName(frame.attached_to).body_frame()
            plant.AddFrame(FixedOffsetFrame(name, body, pose, instance))
    if problems:
        raise InputError(problems)


def _check_degrees_of_freedom(plant: MultibodyPlant, parameters: MachineParameters) -> None:
    """Raise InputError if the plant has other degrees of freedom than its floating trees."""
    dampers, carriers, cabinets = (
        len(parameters.telescopic_dampers),
        1 if parameters.imperfections.bearing else 0,
        1 if parameters.cabinet_moves else 0,
    )
    if (
        plant.num_velocities() != 7 + 7 * dampers + 6 * (carriers + cabinets)
        or plant.num_positions() != plant.num_velocities()
    ):
        more = ", 7 for each telescopic damper" if dampers else ""
        more += ", 6 for the drum carrier" if carriers else ""
        more += ", 6 for the cabinet" if cabinets else ""
        size = plant.num_velocities()
        raise input_error(
            f"SDF '{parameters.model}' has {size} degrees of freedom; allowed are 6 for the tub, "
            f"1 for the drum{more}; {_loose(plant, parameters)}attach all other links by fixed "
            "joints",
            key="model",
        )


def _loose(plant: MultibodyPlant, parameters: MachineParameters) -> str:
    """Return which links are attached to nothing, as part of a message; "" if none is."""
    allowed = {"tub", CARRIER, CABINET}
    allowed |= {outer_tube(plant, parameters, n).name() for n in parameters.telescopic_dampers}
    loose = [plant.get_body(i).name() for i in sorted(plant.GetFloatingBaseBodies())]
    loose = [name for name in loose if name not in allowed]
    if "housing" in loose:
        return (
            "link 'housing' is not fixed to world: add <joint name=\"housing_to_floor\" "
            'type="fixed"><parent>world</parent><child>housing</child></joint>; '
        )
    return f"nothing holds {', '.join(repr(name) for name in loose)}; " if loose else ""


def oscillating_bodies(plant: MultibodyPlant) -> list[RigidBody]:
    """Return the tub and the drum, each with the bodies that are welded to it."""
    return [
        body
        for name in ("tub", DRUM)
        for body in plant.GetBodiesWeldedTo(plant.GetBodyByName(name))
    ]


def set_bodies(plant: MultibodyPlant, context: Any, parameters: MachineParameters) -> None:
    """Set the overrides of the machine file in a plant Context.

    Raises:
        InputError: the SDF does not have a body or frame of that name.
    """
    problems = frame_problems(plant, parameters)
    if problems:
        raise InputError(problems)
    for name, override in parameters.bodies.items():
        body = plant.GetBodyByName(name)
        body.SetSpatialInertiaInBodyFrame(
            context, _overridden(name, body.default_spatial_inertia(), override)
        )
    if parameters.cabinet is not None and parameters.cabinet.moves:
        body = plant.GetBodyByName(CABINET)
        body.SetSpatialInertiaInBodyFrame(context, cabinet_inertia(parameters.cabinet))
    for name, frame_override in parameters.frames.items():
        frame = plant.GetFrameByName(name)
        rotation = frame.GetFixedPoseInBodyFrame().rotation()
        frame.SetPoseInParentFrame(context, RigidTransform(rotation, frame_override.position))
    if drive := motor_of(parameters.drive):
        set_rotor(plant, context, drive)
    if masses := parameters.masses_on_drum:
        add_load(plant, context, Load(unbalances=masses))


def add_load(plant: MultibodyPlant, context: Any, load: Load) -> None:
    """Add the point masses of a load to the drum in a plant Context."""
    set_drum(plant, context, drum_inertia(plant, context), (load,))


def drum_inertia(plant: MultibodyPlant, context: Any) -> SpatialInertia:
    """Return the inertia of the drum about Do in D, in a plant Context."""
    drum = plant.GetBodyByName(DRUM)
    return moved_to(drum.CalcSpatialInertiaInBodyFrame(context), axis_pose(plant))


def set_drum(
    plant: MultibodyPlant, context: Any, inertia: SpatialInertia, loads: Iterable[Load]
) -> None:
    """Set the inertia of the drum, about Do in D, with loads in it, in a plant Context."""
    for load in loads:
        inertia = with_load(inertia, load)
    drum = plant.GetBodyByName(DRUM)
    drum.SetSpatialInertiaInBodyFrame(context, moved_to(inertia, axis_pose(plant).inverse()))


def moved_to(inertia: SpatialInertia, pose: RigidTransform) -> SpatialInertia:
    """Return a spatial inertia about the origin and in the axes of another frame.

    Args:
        pose: Pose of that frame in the frame in which the inertia is given.
    """
    if pose.IsExactlyIdentity():
        return inertia
    return inertia.Shift(pose.translation()).ReExpress(pose.rotation().inverse())


def with_load(drum: SpatialInertia, load: Load) -> SpatialInertia:
    """Return the inertia of the drum about Do in D with the point masses of a load."""
    loaded = copy.copy(drum)
    for unbalance in load.unbalances:
        p_DoU_D = unbalance.position()
        loaded += SpatialInertia(unbalance.mass, p_DoU_D, UnitInertia.PointMass(p_DoU_D))
    return _unbalanced(loaded, load) if load.static or load.couple else loaded


def _unbalanced(drum: SpatialInertia, load: Load) -> SpatialInertia:
    """Return the inertia of the drum about Do in D with static and couple unbalance.

    Raises:
        InputError: no body with the inertia of the drum can have this unbalance.
    """
    mass, moment = drum.get_mass(), drum.get_mass() * drum.get_com()
    inertia = drum.CalcRotationalInertia().CopyToFullMatrix3()
    products = np.zeros(2)  # of m x y and m z y
    if load.static:
        first = load.static.vector()
        moment = moment + first
        products += [first[0] * load.static.y, first[2] * load.static.y]
    if load.couple:
        products += load.couple.products()
    try:
        unit = UnitInertia(
            *np.diag(inertia) / mass,
            (inertia[0, 1] - products[0]) / mass,
            inertia[0, 2] / mass,
            (inertia[1, 2] - products[1]) / mass,
        )
        return SpatialInertia(mass, moment / mass, unit)
    except RuntimeError:  # Drake: the inertia of no body
        raise input_error(
            "static or couple unbalance is too large for mass and inertia of the drum", key="loads"
        ) from None


def _overridden(name: str, inertia: SpatialInertia, override: BodyOverride) -> SpatialInertia:
    """Return a spatial inertia with the parts of an override; a new mass scales the inertia.

    Raises:
        InputError: no part of a machine has such an inertia for its mass.
    """
    mass = inertia.get_mass() if override.mass is None else override.mass
    centre = (
        inertia.get_com() if override.centre_of_mass is None else np.array(override.centre_of_mass)
    )
    if override.inertia is None:
        central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
        about_centre = central * (mass / inertia.get_mass())
    else:
        about_centre = rotational_inertia(override.inertia)
        if fault := fault_of_mass_properties(mass, override.inertia.matrix):
            raise input_error(fault, key=f"bodies.{name}.inertia")
    return SpatialInertia.MakeFromCentralInertia(mass, centre, about_centre)


def rotational_inertia(matrix: InertiaMatrix) -> RotationalInertia:
    """Return an inertia matrix in the form of Drake."""
    return RotationalInertia(matrix.xx, matrix.yy, matrix.zz, matrix.xy, matrix.xz, matrix.yz)


def with_sdf_values(
    plant: MultibodyPlant, parameters: MachineParameters, keys: Iterable[str]
) -> MachineParameters:
    """Return the parameters with overrides that contain the values of the SDF.

    `with_value` can then change a part of such a value, for example one coordinate of a frame.

    Args:
        keys: Key paths; each path below `frames` or `bodies` adds an override.
    """
    changed = parameters
    for table, name, part in dict.fromkeys(tuple([*key.split("."), "", ""][:3]) for key in keys):
        if table == "frames" and name not in changed.frames:
            names = sdf_names(plant)
            if name not in names.movable_frames:
                raise input_error(
                    f"no frame '{name}' in the SDF{nearest_names(name, names.frames)}",
                    key=f"frames.{name}",
                )
            position = plant.GetFrameByName(name).GetFixedPoseInBodyFrame().translation()
            changed = with_value(changed, f"frames.{name}.position", tuple(map(float, position)))
        if table == "bodies" and part in BodyOverride.model_fields:
            value = _mass_properties(plant, name, changed.bodies.get(name, BodyOverride()))[part]
            changed = with_value(changed, f"bodies.{name}.{part}", value)
    return changed


def _mass_properties(plant: MultibodyPlant, name: str, override: BodyOverride) -> dict[str, Any]:
    """Return mass, centre of mass and central inertia of a body, by the keys of an override.

    Parts that `override` has replace those of the SDF.
    """
    if not plant.HasBodyNamed(name):
        links = [
            plant.get_body(index).name()
            for index in plant.GetBodyIndices(plant.GetBodyByName("tub").model_instance())
        ]
        check_known(name, links, f"no link '{name}' in the SDF", key=f"bodies.{name}")
    inertia = _overridden(name, plant.GetBodyByName(name).default_spatial_inertia(), override)
    matrix = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    indices = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
    return {
        "mass": float(inertia.get_mass()),
        "centre_of_mass": tuple(map(float, inertia.get_com())),
        "inertia": {axis: float(matrix[index]) for axis, index in indices.items()},
    }
