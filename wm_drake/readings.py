"""What is read off a trajectory: motion of bodies and points, forces of elements, each with its unit and what it is."""

from typing import TypeAlias

import numpy as np

from wm_drake.kernel.histories import position_history
from wm_drake.machine import Setup
from wm_drake.parameters.elements import FloatArray
from wm_drake.systems.drum_bearing import FORCE_SIZE as BEARING_FORCE_SIZE
from wm_drake.systems.drum_bearing import drum_bearing_history
from wm_drake.systems.friction_damper import friction_damper_history
from wm_drake.systems.six_component_bushing import six_component_bushing_history
from wm_drake.systems.spring_strut import spring_strut_history
from wm_drake.systems.telescopic_damper import FORCE_SIZE, telescopic_damper_history
from wm_drake.trajectory import Trajectory

AXES = ("x", "y", "z")

Variables: TypeAlias = dict[str, tuple[tuple[str, ...], FloatArray, str, str]]
"""By name: dimensions, values, unit, what it is."""


def motion_variables(setup: Setup, trajectory: Trajectory) -> Variables:
    """Of tub, drum, sensors, and of bodies that only some machines have."""
    state = trajectory.state
    axes = [AXES.index(sensor.axis) for sensor in setup.sensors.values()]
    points = list(setup.sensor_points.values())
    accelerometers = np.stack(list(setup.accelerometer_points.values()))
    displaced = point_displacements(state, np.stack([*points, setup.detergent_point]), setup.rest_pose)
    moved = [displaced[:, index, axis] for index, axis in enumerate(axes)]
    detergent = displaced[:, -1]
    return (
        _tubes(trajectory)
        | _whirl(setup, trajectory)
        | {
            "tub_angle": (("time", "angle"), state[:, 0:3], "rad", "roll, pitch, yaw of T in W (3-2-1 Euler angles)"),
            "tub_position": (("time", "axis"), state[:, 3:6], "m", "position of To in W"),
            "tub_angular_velocity": (("time", "axis"), state[:, 7:10], "rad/s", "angular velocity of T in W"),
            "tub_velocity": (("time", "axis"), state[:, 10:13], "m/s", "velocity of To in W"),
            "tub_angular_acceleration": (("time", "axis"), trajectory.acceleration[:, :3], "rad/s^2", "rate of it in W"),
            "tub_acceleration": (("time", "axis"), trajectory.acceleration[:, 3:], "m/s^2", "acceleration of To in W"),
            "drum_angle": (("time",), state[:, 6], "rad", "angle of the drum against the tub"),
            "drum_speed": (("time",), state[:, 13], "rad/s", "speed of the drum against the tub"),
            "displacement": (("time", "sensor"), np.stack(moved, axis=1), "m", "displacement at the sensors, along their axes"),
            "sensor_point": (("sensor", "axis"), np.stack(points), "m", "points of the sensors in T"),
            "accelerometer_point": (("accelerometer", "axis"), accelerometers, "m", "points of the vibration sensors in T"),
            "detergent_displacement": (("time", "axis"), detergent, "m", "displacement of the point nearest the detergent box"),
            "damper_deformation": (("time", "damper"), trajectory.deformation, "m", "deformation of the damper's sponge"),
        }
    )


def _tubes(trajectory: Trajectory) -> Variables:
    """Of machines whose damper tubes are bodies."""
    tubes = trajectory.tubes
    if not tubes.shape[1]:
        return {}
    return {
        "tube_angle": (("time", "tube", "angle"), tubes[:, :, :3], "rad", "roll, pitch, yaw of the outer tubes in W"),
        "tube_position": (("time", "tube", "axis"), tubes[:, :, 3:6], "m", "displacement of their link frames in W"),
        "tube_extension": (("time", "tube"), tubes[:, :, 6], "m", "by how much the damper is longer than drawn"),
    }


def _whirl(setup: Setup, trajectory: Trajectory) -> Variables:
    """Of machines whose drum can whirl in its bearing."""
    if setup.bearing is None:
        return {}
    carrier, none = trajectory.carrier, np.zeros((len(trajectory.time), 1))
    own = np.empty((len(carrier), BEARING_FORCE_SIZE))
    both = np.hstack([trajectory.state, carrier[:, :6], none, carrier[:, 6:], none])
    drum_bearing_history(both, np.empty((len(carrier), 0)), setup.bearing.packed(), own)
    dims, where = ("time", "axis"), "in the tub's frame, y along the drum axis"
    return {
        "drum_displacement": (dims, own[:, 0:3], "m", f"displacement of the drum axis in the bearing, {where}"),
        "drum_tilt": (dims, own[:, 3:6], "rad", f"rotation vector of the drum's bearing against the tub, {where}"),
        "bearing_force": (dims, own[:, 6:9], "N", f"force of the drum on the tub in the bearing, {where}"),
        "bearing_moment": (dims, own[:, 9:12], "N m", f"moment of the drum on the tub in the bearing, {where}"),
    }


def force_variables(setup: Setup, trajectory: Trajectory) -> Variables:
    """Of the motor and the elements."""
    springs, dampers, bushings = element_forces(setup, trajectory)
    dims = ("time", "bushing", "axis")
    return {
        "motor_torque": (("time",), trajectory.motor_torque, "N m", "torque of the motor on the drum"),
        "spring_tension": (("time", "spring"), springs, "N", "spring tension"),
        "damper_tension": (("time", "damper"), dampers, "N", "damper tension"),
        "bushing_force": (dims, bushings[:, :, :3], "N", "force of gasket and bushings on the housing"),
        "bushing_moment": (dims, bushings[:, :, 3:], "N m", "moment of gasket and bushings on the housing"),
    }


def element_forces(setup: Setup, trajectory: Trajectory) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Own forces of the elements along a trajectory.

    Returns:
        Spring tensions (n, springs), damper tensions (n, dampers) [N], and force and moment of the bushings on the housing
        (n, bushings, 6) [N, N m]. Of a telescopic damper, its bushing at the tub (on the outer tube), that at the housing.
    """
    states, none = trajectory.state, np.empty((len(trajectory.time), 0))
    springs = np.empty((len(states), len(setup.springs)))
    dampers = np.empty((len(states), len(setup.dampers) + len(setup.telescopes)))
    bushings = np.empty((len(states), len(setup.bushings) + 2 * len(setup.telescopes), 6))
    for index, spring in enumerate(setup.springs.values()):
        spring_strut_history(states, none, spring.packed(), springs[:, index : index + 1])
    for index, damper in enumerate(setup.dampers.values()):
        own = trajectory.deformation[:, index : index + 1]
        friction_damper_history(states, own, damper.packed(), dampers[:, index : index + 1])
    for index, bushing in enumerate(setup.bushings.values()):
        six_component_bushing_history(states, none, bushing.packed(), bushings[:, index])
    for index, telescope in enumerate(setup.telescopes.values()):
        column, first = len(setup.dampers) + index, len(setup.bushings) + 2 * index
        forces, both = np.empty((len(states), FORCE_SIZE)), np.hstack([states, trajectory.tubes[:, index]])
        telescopic_damper_history(both, trajectory.deformation[:, column : column + 1], telescope.packed(), forces)
        dampers[:, column] = forces[:, 0]
        bushings[:, first : first + 2] = forces[:, 1:].reshape(-1, 2, 6)
    return springs, dampers, bushings


def point_displacements(state: FloatArray, points: FloatArray, rest_pose: FloatArray) -> FloatArray:
    """Displacements from the rest pose of points of the tub.

    Args:
        state: (n, >= 6) roll, pitch, yaw, x, y, z. [rad, m]
        points: (k, 3) in T. [m]
        rest_pose: (6,) the same coordinates at rest.

    Returns:
        (n, k, 3) in W. [m]
    """
    displaced = point_positions(state, points)
    displaced -= point_positions(rest_pose[None, :], points)
    return displaced


def point_positions(state: FloatArray, points: FloatArray) -> FloatArray:
    """Positions in W of points of the tub; arguments as in `point_displacements`. (n, k, 3) [m]"""
    positions = np.empty((len(state), 3 * len(points)))
    position_history(np.ascontiguousarray(state[:, :6]), np.ascontiguousarray(points), positions)
    return positions.reshape(len(state), len(points), 3)
