"""Outputs of a trajectory: motion of bodies and points and forces of elements, with units."""

import numpy as np

from wm_drake.elements.bearing import FORCE_SIZE as BEARING_FORCE_SIZE
from wm_drake.elements.bearing import drum_bearing_history
from wm_drake.elements.telescopic_damper import FORCE_SIZE, telescopic_damper_history
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters import Load
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cabinet import cabinet_variables
from wm_drake.simulation.histories import output_history, position_history
from wm_drake.simulation.mounts import mount_wrenches, mounts_along
from wm_drake.simulation.variables import Variables, declared


def variables_of(setup: Setup, trajectory: Trajectory) -> Variables:
    """Return all variables that a record holds of a trajectory."""
    displacements, *forces, outputs = tub_outputs(setup, trajectory)
    if setup.telescopes:
        forces = _with_telescopes(setup, trajectory, *forces)
    return (
        _tubes(trajectory)
        | _branches(setup, trajectory)
        | cabinet_variables(setup, trajectory)
        | _whirl(setup, trajectory)
        | _motion(setup, trajectory, displacements)
        | _forces(trajectory, *forces)
        | _current(setup, trajectory)
        | _outputs_of_others(setup, outputs)
        | _on_cabinet(mount_wrenches(setup, trajectory))
    )


def _motion(setup: Setup, trajectory: Trajectory, displacements: FloatArray) -> Variables:
    """Return the variables of the motion of tub, drum, sensor points and damper sponges.

    Args:
        displacements: (n, k) displacements at the `measured_points`. [m]
    """
    state, acceleration = trajectory.state, trajectory.acceleration
    points, accelerometers = (
        np.stack(list(places.values()))
        for places in (setup.sensor_points, setup.accelerometer_points)
    )
    sensors, detergent = np.split(displacements, [len(points)], axis=1)
    return declared(
        tub_angle=state[:, 0:3],
        tub_position=state[:, 3:6],
        tub_angular_velocity=state[:, 7:10],
        tub_velocity=state[:, 10:13],
        tub_angular_acceleration=acceleration[:, :3],
        tub_acceleration=acceleration[:, 3:],
        drum_angle=state[:, 6],
        drum_speed=state[:, 13],
        displacement=sensors,
        sensor_point=points,
        accelerometer_point=accelerometers,
        detergent_displacement=detergent,
        damper_deformation=trajectory.deformation,
    )


def _tubes(trajectory: Trajectory) -> Variables:
    """Return the variables of the tubes of telescopic dampers; none without such dampers."""
    tubes = trajectory.tubes
    if not tubes.shape[1]:
        return {}
    return declared(
        tube_angle=tubes[:, :, :3], tube_position=tubes[:, :, 3:6], tube_extension=tubes[:, :, 6]
    )


def _branches(setup: Setup, trajectory: Trajectory) -> Variables:
    """Return the stretches of the branches of rubber bushings; none without them."""
    if not branch_names(setup):
        return {}
    return declared(branch_stretch=trajectory.stretches)


def branch_names(setup: Setup) -> tuple[str, ...]:
    """Return the branches of rubber bushings by bushing and key, such as gasket.dahl_force_x."""
    return tuple(
        f"{name}.{key}"
        for name, bushing in setup.parameters.all_bushings().items()
        for key in bushing.stretched_branches
    )


def _whirl(setup: Setup, trajectory: Trajectory) -> Variables:
    """Return the variables of the drum's motion in a compliant bearing; none for a rigid one."""
    if setup.bearing is None:
        return {}
    carrier, zeros = trajectory.carrier, np.zeros((len(trajectory.time), 1))
    outputs = np.empty((len(carrier), BEARING_FORCE_SIZE))
    # the law takes the states of two trees, tub and carrier; each includes the position of a joint
    states = np.hstack([trajectory.state, carrier[:, :6], zeros, carrier[:, 6:], zeros])
    drum_bearing_history(states, np.empty((len(carrier), 0)), setup.bearing.packed(), outputs)
    return declared(
        drum_displacement=outputs[:, 0:3],
        drum_tilt=outputs[:, 3:6],
        bearing_force=outputs[:, 6:9],
        bearing_moment=outputs[:, 9:12],
    )


def _current(setup: Setup, trajectory: Trajectory) -> Variables:
    """Return the current of the motor; none without its torque constant."""
    factor = setup.motor.current_per_drum_torque if setup.motor else None
    if factor is None:
        return {}
    return declared(motor_current=factor * trajectory.motor_torque)


def masses_of(load: Load, trajectory: Trajectory) -> Variables:
    """Return the masses of a load that dries; none for one that stays."""
    if trajectory.water is None:
        return {}
    return declared(mass_left=load.masses(trajectory.water))


def _forces(
    trajectory: Trajectory, springs: FloatArray, dampers: FloatArray, bushings: FloatArray
) -> Variables:
    """Return the variables of the motor torque and of the forces of the elements.

    Args:
        springs: (n, springs) tensions. [N]
        dampers: (n, dampers) tensions. [N]
        bushings: (n, bushings, 6) force and moment on the housing. [N, N m]
    """
    return declared(
        motor_torque=trajectory.motor_torque,
        spring_tension=springs,
        damper_tension=dampers,
        bushing_force=bushings[:, :, :3],
        bushing_moment=bushings[:, :, 3:],
    )


def others_by_kind(setup: Setup) -> dict[str, list[str]]:
    """Return the names of the elements of registered kinds, by the name of their kind."""
    names: dict[str, list[str]] = {}
    for name, element in setup.elements.others.items():
        names.setdefault(element.kind.name, []).append(name)
    return names


def _outputs_of_others(setup: Setup, outputs: FloatArray) -> Variables:
    """Return the outputs of elements of other packages, a variable for each output of a kind.

    Args:
        outputs: Of all elements, one after the other. (n, k)
    """
    others, columns = setup.elements.others, dict[str, int]()
    end = 0
    for name, element in others.items():
        columns[name], end = end, end + element.kind.output_size
    variables: Variables = {}
    for kind_name, names in others_by_kind(setup).items():
        kinds = [others[name].kind for name in names]
        for number, output in enumerate(kinds[0].outputs):
            size = max(kind.outputs[number].size for kind in kinds)
            values = np.full((len(outputs), len(names), size), np.nan)
            for k, (name, kind) in enumerate(zip(names, kinds, strict=True)):
                part = kind.output_parts[output.name]
                begin = columns[name] + part.start
                values[:, k, : part.stop - part.start] = outputs[
                    :, begin : columns[name] + part.stop
                ]
            dims: tuple[str, ...] = ("time", kind_name, output.dim)
            if size == 1 and output.dim == "axis":
                dims, values = dims[:2], values[:, :, 0]
            words = output.words or output.name
            variables[f"{kind_name}_{output.name}"] = (dims, values, output.unit, words)
    return variables


def _on_cabinet(wrenches: FloatArray) -> Variables:
    """Return the variables of the forces of the mounts on the cabinet.

    Args:
        wrenches: (n, mounts, 6) from `mount_wrenches`. [N m, N]
    """
    resultant = wrenches.sum(axis=1)
    return declared(
        mount_force=wrenches[:, :, 3:],
        cabinet_force=resultant[:, 3:],
        cabinet_moment=resultant[:, :3],
    )


def tub_outputs(setup: Setup, trajectory: Trajectory) -> tuple[FloatArray, ...]:
    """Return the outputs that follow from the motion of the tub.

    Returns:
        Displacements at the `measured_points` (n, points) [m]; tensions of the springs (n, springs)
        and of the strut dampers (n, dampers) [N]; force and moment of the bushings on the housing
        (n, bushings, 6) [N, N m]; outputs of elements of other packages (n, k).
    """
    points, bushing_count = setup.measured_points, len(setup.bushings)
    sizes = [len(points), len(setup.springs), len(setup.dampers), 6 * bushing_count]
    sizes.append(sum(element.kind.output_size for element in setup.elements.others.values()))
    columns = np.empty((len(trajectory.time), sum(sizes)), order="F")
    states, p, mounts = mounts_along(setup, trajectory)
    output_history(states, points.ravel(), p, mounts, columns)
    displacements, springs, dampers, bushings, others = np.split(
        columns, np.cumsum(sizes)[:-1], axis=1
    )
    forces = bushings.reshape(len(columns), bushing_count, 6)
    return displacements, springs, dampers, forces, others


def _with_telescopes(
    setup: Setup,
    trajectory: Trajectory,
    springs: FloatArray,
    dampers: FloatArray,
    bushings: FloatArray,
) -> list[FloatArray]:
    """Return the forces of the elements with those of the telescopic dampers appended.

    A telescopic damper adds one damper tension and two bushings: the one at the tub, then the one
    at the housing.

    Args:
        springs: (n, springs) tensions. [N]
        dampers: (n, dampers) tensions of the strut dampers. [N]
        bushings: (n, bushings, 6) force and moment on the housing. [N, N m]

    Returns:
        The same three arrays; dampers and bushings have more columns.
    """
    for index, telescope in enumerate(setup.telescopes.values()):
        column = len(setup.dampers) + index
        states = np.hstack([trajectory.state, trajectory.tubes[:, index]])
        sponge = trajectory.deformation[:, column : column + 1]
        forces = np.empty((len(states), FORCE_SIZE))
        telescopic_damper_history(states, sponge, telescope.packed(), forces)
        dampers = np.hstack([dampers, forces[:, :1]])
        bushings = np.hstack([bushings, forces[:, 1:].reshape(-1, 2, 6)])
    return [springs, dampers, bushings]


def point_displacements(state: FloatArray, points: FloatArray, rest_pose: FloatArray) -> FloatArray:
    """Return the displacements of points of the tub from the rest pose.

    Args:
        state: (n, >= 6) roll, pitch, yaw, x, y, z of the tub. [rad, m]
        points: (k, 3) positions in T. [m]
        rest_pose: (6,) roll, pitch, yaw, x, y, z at rest. [rad, m]

    Returns:
        (n, k, 3) in W. [m]
    """
    displaced = point_positions(state, points)
    displaced -= point_positions(rest_pose[None, :], points)
    return displaced


def point_positions(state: FloatArray, points: FloatArray) -> FloatArray:
    """Return the positions of points of the tub.

    Args:
        state: (n, >= 6) roll, pitch, yaw, x, y, z of the tub. [rad, m]
        points: (k, 3) positions in T. [m]

    Returns:
        (n, k, 3) in W. [m]
    """
    positions = np.empty((len(state), 3 * len(points)))
    position_history(np.ascontiguousarray(state[:, :6]), np.ascontiguousarray(points), positions)
    return positions.reshape(len(state), len(points), 3)
