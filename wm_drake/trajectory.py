"""What an engine hands over: the motion, sampled, and why it ended early if it did."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.elements import FloatArray

LARGEST_DISPLACEMENT = 0.5
"""Beyond this the motion is called divergent: no housing is that wide. [m]"""

LARGEST_ANGLE = 1.0
"""Beyond this tilt of the tub the motion is called divergent. [rad]"""

COORDINATES = ("roll", "pitch", "yaw", "x", "y", "z")


@dataclass(frozen=True)
class Divergence:
    """When and why a run stopped.

    Attributes:
        time: Simulated time of the first step out of bounds. [s]
        coordinate: Coordinate of the tub that left its bounds.
        reason: Its value and the bound.
    """

    time: float
    coordinate: str
    reason: str


@dataclass(frozen=True)
class Trajectory:
    """Motion of a machine.

    Attributes:
        time: (n,) [s]
        state: (n, 14) positions and velocities of the plant: roll, pitch, yaw, x, y, z of T in W, drum angle; angular
            velocity and velocity of To in W, drum rate. [rad, m, rad/s, m/s]
        motor_torque: (n,) torque of the motor on the drum, its reaction on the tub. [N m]
        forces: By element label (``spring_left``, ``damper_left``, ``gasket``, ``bushing_...``), (n, 1) tension or
            (n, 6) force and moment on the housing. [N, N m]
        divergence: None if the run came to its end.
    """

    time: FloatArray
    state: FloatArray
    motor_torque: FloatArray
    forces: dict[str, FloatArray]
    divergence: Divergence | None


def diverging_coordinate(positions: FloatArray) -> tuple[str, str] | None:
    """Name of the first coordinate out of bounds and what is wrong with it; None while all is well.

    Args:
        positions: roll, pitch, yaw, x, y, z, (drum angle). [rad, m]
    """
    size = np.abs(positions[:6])
    if size[:3].max() <= LARGEST_ANGLE and size[3:].max() <= LARGEST_DISPLACEMENT:
        return None  # a NaN is not <= anything
    bounds = np.repeat([LARGEST_ANGLE, LARGEST_DISPLACEMENT], 3)
    index = int(np.flatnonzero(~(size <= bounds))[0])
    unit = "rad" if index < 3 else "m"
    return COORDINATES[index], f"{COORDINATES[index]} = {positions[index]:.4g} {unit}, bound {bounds[index]:g} {unit}"
