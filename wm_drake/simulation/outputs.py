"""What is read off a trajectory: motion of bodies and points, forces of elements, each with its unit and what it is."""

from typing import TypeAlias

import numpy as np

from wm_drake.elements.bearing import FORCE_SIZE as BEARING_FORCE_SIZE
from wm_drake.elements.bearing import drum_bearing_history
from wm_drake.elements.telescopic_damper import FORCE_SIZE, telescopic_damper_history
from wm_drake.engines.compiled.packing import pack_on_tub
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.histories import MEASURED_POINT, position_history, reading_history

AXES = ("x", "y", "z")

Variables: TypeAlias = dict[str, tuple[tuple[str, ...], FloatArray, str, str]]
"""By name: dimensions, values, unit, what it is."""


def variables_of(setup: Setup, trajectory: Trajectory) -> Variables:
    """All that a record holds of a motion."""
    displacements, *forces = readings(setup, trajectory)
    if setup.telescopes:
        forces = _with_telescopes(setup, trajectory, *forces)
    return (
        _tubes(trajectory)
        | _whirl(setup, trajectory)
        | _motion(setup, trajectory, displacements)
        | _forces(trajectory, *forces)
    )


def _motion(setup: Setup, trajectory: Trajectory, displacements: FloatArray) -> Variables:
    """Of tub, drum and sensors; `displacements` of `measured_points`."""
    state, acceleration, deformation = (
        trajectory.state,
        trajectory.acceleration,
        trajectory.deformation,
    )
    points, accelerometers = (
        np.stack(list(places.values()))
        for places in (setup.sensor_points, setup.accelerometer_points)
    )
    sensors, detergent = np.split(displacements, [len(points)], axis=1)
    return {
        "tub_angle": (
            ("time", "angle"),
            state[:, 0:3],
            "rad",
            "roll, pitch, yaw of T in W (3-2-1 Euler angles)",
        ),
        "tub_position": (("time", "axis"), state[:, 3:6], "m", "position of To in W"),
        "tub_angular_velocity": (
            ("time", "axis"),
            state[:, 7:10],
            "rad/s",
            "angular velocity of T in W",
        ),
        "tub_velocity": (("time", "axis"), state[:, 10:13], "m/s", "velocity of To in W"),
        "tub_angular_acceleration": (
            ("time", "axis"),
            acceleration[:, :3],
            "rad/s^2",
            "rate of it in W",
        ),
        "tub_acceleration": (
            ("time", "axis"),
            acceleration[:, 3:],
            "m/s^2",
            "acceleration of To in W",
        ),
        "drum_angle": (("time",), state[:, 6], "rad", "angle of the drum against the tub"),
        "drum_speed": (("time",), state[:, 13], "rad/s", "speed of the drum against the tub"),
        "displacement": (
            ("time", "sensor"),
            sensors,
            "m",
            "displacement at the sensors, along their axes",
        ),
        "sensor_point": (("sensor", "axis"), points, "m", "points of the sensors in T"),
        "accelerometer_point": (
            ("accelerometer", "axis"),
            accelerometers,
            "m",
            "points of the vibration sensors in T",
        ),
        "detergent_displacement": (
            ("time", "axis"),
            detergent,
            "m",
            "displacement of the point nearest the detergent box",
        ),
        "damper_deformation": (
            ("time", "damper"),
            deformation,
            "m",
            "deformation of the damper's sponge",
        ),
    }


def _tubes(trajectory: Trajectory) -> Variables:
    """Of machines whose damper tubes are bodies."""
    tubes = trajectory.tubes
    if not tubes.shape[1]:
        return {}
    return {
        "tube_angle": (
            ("time", "tube", "angle"),
            tubes[:, :, :3],
            "rad",
            "roll, pitch, yaw of the outer tubes in W",
        ),
        "tube_position": (
            ("time", "tube", "axis"),
            tubes[:, :, 3:6],
            "m",
            "displacement of their link frames in W",
        ),
        "tube_extension": (
            ("time", "tube"),
            tubes[:, :, 6],
            "m",
            "by how much the damper is longer than drawn",
        ),
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
        "drum_displacement": (
            dims,
            own[:, 0:3],
            "m",
            f"displacement of the drum axis in the bearing, {where}",
        ),
        "drum_tilt": (
            dims,
            own[:, 3:6],
            "rad",
            f"rotation vector of the drum's bearing against the tub, {where}",
        ),
        "bearing_force": (
            dims,
            own[:, 6:9],
            "N",
            f"force of the drum on the tub in the bearing, {where}",
        ),
        "bearing_moment": (
            dims,
            own[:, 9:12],
            "N m",
            f"moment of the drum on the tub in the bearing, {where}",
        ),
    }


def _forces(
    trajectory: Trajectory, springs: FloatArray, dampers: FloatArray, bushings: FloatArray
) -> Variables:
    """Of the motor and the elements."""
    dims = ("time", "bushing", "axis")
    return {
        "motor_torque": (
            ("time",),
            trajectory.motor_torque,
            "N m",
            "torque of the motor on the drum",
        ),
        "spring_tension": (("time", "spring"), springs, "N", "spring tension"),
        "damper_tension": (("time", "damper"), dampers, "N", "damper tension"),
        "bushing_force": (
            dims,
            bushings[:, :, :3],
            "N",
            "force of gasket and bushings on the housing",
        ),
        "bushing_moment": (
            dims,
            bushings[:, :, 3:],
            "N m",
            "moment of gasket and bushings on the housing",
        ),
    }


def readings(setup: Setup, trajectory: Trajectory) -> tuple[FloatArray, ...]:
    """What is read off the motion of the tub.

    Returns:
        Displacements at `measured_points` (n, points) [m]; tensions of the springs (n, springs) and of the strut dampers
        (n, dampers) [N]; force and moment of the bushings on the housing (n, bushings, 6) [N, N m].
    """
    points, (p, indices) = measured_points(setup), pack_on_tub(setup)
    begins = [np.array(of_kind, dtype=np.int64) for of_kind in indices.values()]
    sizes = [len(points), len(begins[0]), len(begins[1]), 6 * len(begins[2])]
    columns = np.empty((len(trajectory.time), sum(sizes)), order="F")
    reading_history(trajectory.state, trajectory.deformation, points.ravel(), p, *begins, columns)
    displacements, springs, dampers, bushings = np.split(columns, np.cumsum(sizes)[:-1], axis=1)
    return displacements, springs, dampers, bushings.reshape(len(columns), len(begins[2]), 6)


def _with_telescopes(
    setup: Setup,
    trajectory: Trajectory,
    springs: FloatArray,
    dampers: FloatArray,
    bushings: FloatArray,
) -> list[FloatArray]:
    """Forces of the elements, and behind them those of telescopic dampers: bushings of each at the tub, then at the housing."""
    for index, telescope in enumerate(setup.telescopes.values()):
        column = len(setup.dampers) + index
        both, own = (
            np.hstack([trajectory.state, trajectory.tubes[:, index]]),
            trajectory.deformation[:, column : column + 1],
        )
        forces = np.empty((len(both), FORCE_SIZE))
        telescopic_damper_history(both, own, telescope.packed(), forces)
        dampers = np.hstack([dampers, forces[:, :1]])
        bushings = np.hstack([bushings, forces[:, 1:].reshape(-1, 2, 6)])
    return [springs, dampers, bushings]


def measured_points(setup: Setup) -> FloatArray:
    """Points that are measured, packed for `kernel.histories`: the sensors, then the detergent point along x, y, z. (k, 7)"""
    places = np.array([*setup.sensor_points.values(), *[setup.detergent_point] * 3])
    axes = [*(AXES.index(sensor.axis) for sensor in setup.sensors.values()), 0, 1, 2]
    at_rest = point_positions(setup.rest_pose[None, :], places)[0, range(len(axes)), axes]
    return np.array(
        [
            MEASURED_POINT.pack(p_ToM_T=place, direction_W=np.eye(3)[axis], at_rest=rest)
            for place, axis, rest in zip(places, axes, at_rest, strict=True)
        ]
    )


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
