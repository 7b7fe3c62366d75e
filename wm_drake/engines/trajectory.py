"""What an engine hands over: the motion, sampled, and why it ended early if it did."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray

LARGEST_DISPLACEMENT = 0.5
"""Beyond this the motion is called divergent: no housing is that wide. [m]"""

LARGEST_ANGLE = 1.0
"""Beyond this tilt of the tub the motion is called divergent. [rad]"""

COORDINATES = ("roll", "pitch", "yaw", "x", "y", "z")
_BOUNDS = np.repeat([LARGEST_ANGLE, LARGEST_DISPLACEMENT], 3)


@dataclass(frozen=True)
class Divergence:
    """When and why a run stopped.

    Attributes:
        time: Simulated time of the first sample out of bounds. [s]
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
            velocity and velocity of To in W, drum rate. The drum's are against the tub; if its bearing gives, against what
            carries it there. [rad, m, rad/s, m/s]
        deformation: (n, number of dampers) deformation of each damper's sponge, those of telescopic ones last; 0 where it
            has none. [m]
        motor_torque: (n,) torque of the motor on the drum, its reaction on the tub. [N m]
        acceleration: (n, 6) angular acceleration of the tub and acceleration of To, in W. [rad/s^2, m/s^2]
        tubes: (n, number of telescopic dampers, 14) position of the outer tube and extension, their velocities; as `state`
            for tub and drum.
        carrier: (n, 12) position of what carries the drum in its bearing, and its velocity, as of the tub; (n, 0) if that
            does not give.
        divergence: None if the run came to its end.
    """

    time: FloatArray
    state: FloatArray
    deformation: FloatArray
    motor_torque: FloatArray
    acceleration: FloatArray
    tubes: FloatArray
    carrier: FloatArray
    divergence: Divergence | None = None


def ended_where_it_diverged(trajectory: Trajectory, failure: str = "") -> Trajectory:
    """Cuts a trajectory before its first sample out of bounds, and says why.

    Args:
        trajectory: As an engine sampled it; NaN where it did not come to.
        failure: What stopped the engine, if something did.
    """
    inside = np.abs(trajectory.state[:, :6]) <= _BOUNDS  # a NaN is not
    if inside.all():
        return trajectory
    index = int(np.argmin(inside.all(axis=1)))
    reason = diverging_coordinate(trajectory.state[index])
    assert reason is not None  # the same question, of this sample
    if (
        failure and np.isnan(trajectory.state[index]).all()
    ):  # from a good sample to no number within one output period
        reason = "state", failure
    return _cut(trajectory, index, Divergence(float(trajectory.time[index]), *reason))


def _cut(trajectory: Trajectory, length: int, divergence: Divergence) -> Trajectory:
    return Trajectory(
        trajectory.time[:length],
        trajectory.state[:length],
        trajectory.deformation[:length],
        trajectory.motor_torque[:length],
        trajectory.acceleration[:length],
        trajectory.tubes[:length],
        trajectory.carrier[:length],
        divergence,
    )


def diverging_coordinate(positions: FloatArray) -> tuple[str, str] | None:
    """Name of the first coordinate out of bounds and what is wrong with it; None while all is well.

    Args:
        positions: roll, pitch, yaw, x, y, z, (drum angle). [rad, m]
    """
    size = np.abs(positions[:6])
    bad = np.flatnonzero(~(size <= _BOUNDS))
    if not len(bad):
        return None
    index = int(bad[0])
    unit = "rad" if index < 3 else "m"
    return COORDINATES[
        index
    ], f"{COORDINATES[index]} = {positions[index]:.4g} {unit}, bound {_BOUNDS[index]:g} {unit}"


def divergence_text(divergence: Divergence | None, time: FloatArray, state: FloatArray) -> str:
    """When and why a run stopped, and its last good sample; "" for one that did not.

    Args:
        divergence: Of the run.
        time, state: Its good samples, (n,) [s] and (n, >= 6).
    """
    if divergence is None:
        return ""
    where = "no sample was good"
    if len(time):
        last = ", ".join(
            f"{name} {value:.4g}" for name, value in zip(COORDINATES, state[-1, :6], strict=True)
        )
        where = f"last good state at {time[-1]:.3f} s: {last} (rad, m)"
    return f"the run diverged at {divergence.time:.3f} s: {divergence.reason}; {where}"
