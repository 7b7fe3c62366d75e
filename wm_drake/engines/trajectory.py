"""Result of an engine: the sampled motion, and the reason if the run diverged."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wm_drake.parameters.types import FloatArray

LARGEST_DISPLACEMENT = 0.5
"""Bound of each displacement of the tub, wider than any housing; a run beyond it diverged. [m]"""

LARGEST_ANGLE = 1.0
"""Bound of each angle of the tub; a run beyond it diverged. [rad]"""

LARGEST_TILT = 0.5
"""Bound of roll and pitch of a cabinet that moves; beyond it, it has tipped over. [rad]"""

COORDINATES = ("roll", "pitch", "yaw", "x", "y", "z")
_BOUNDS = np.repeat([LARGEST_ANGLE, LARGEST_DISPLACEMENT], 3)


@dataclass(frozen=True)
class Divergence:
    """Time and reason of the divergence of a run.

    Attributes:
        time: Simulated time of the first sample out of bounds. [s]
        coordinate: Coordinate of the tub that is out of bounds, one of `COORDINATES`; "cabinet" if
            a cabinet that moves tipped over; "state" if the engine failed.
        reason: Value and bound of the coordinate, or the message of the engine.
    """

    time: float
    coordinate: str
    reason: str


@dataclass(frozen=True)
class Estimates:
    """Estimated errors of a run.

    Attributes:
        steps: Error of the motion by the steps, relative to its largest velocity.
        samples: Part of the largest acceleration that lies between the samples.
    """

    steps: float
    samples: float


@dataclass(frozen=True)
class Trajectory:
    """Motion of a machine.

    Attributes:
        time: (n,) [s]
        state: (n, 14) Positions and velocities of the plant: roll, pitch, yaw, x, y, z of T in W,
            drum angle; angular velocity and velocity of To in W, drum speed. Drum angle and speed
            are against the tub, with a compliant bearing against the drum carrier. Of a cabinet
            that moves, W is here and below its frame. [rad, m, rad/s, m/s]
        deformation: (n, dampers) Deformation of the sponge of each damper, telescopic dampers last;
            0 for a damper without a sponge. [m]
        motor_torque: (n,) Torque of the motor on the drum; its reaction acts on the tub. [N m]
        acceleration: (n, 6) Angular acceleration of the tub and acceleration of To, in W.
            [rad/s^2, m/s^2]
        tubes: (n, telescopic dampers, 14) Positions and velocities of the tubes of each telescopic
            damper, in the order of `state`: outer tube for the tub, extension for the drum angle.
        carrier: (n, 12) Positions and velocities of the drum carrier, in the order of those of the
            tub in `state`; (n, 0) with a rigid bearing.
        stretches: (n, branches) Stretch of each branch of rubber bushings in use, (n, 0) without
            them. [m or rad]
        divergence: None if the run reached the end of its profile.
        cabinet: (n, 20) Positions and velocities in W of a cabinet that moves, in the order of
            those of the tub in `state`, then how far each foot has slid, x and y [m]; None for a
            fixed one.
        element_states: (n, k) States of elements of other packages; None without any.
        water: (n, wet) Share of water that is left in each wet mass of the load; None if it stays.
        estimates: Errors by steps and samples; None if the engine controls its error.
    """

    time: FloatArray
    state: FloatArray
    deformation: FloatArray
    motor_torque: FloatArray
    acceleration: FloatArray
    tubes: FloatArray
    carrier: FloatArray
    stretches: FloatArray
    divergence: Divergence | None = None
    cabinet: FloatArray | None = None
    element_states: FloatArray | None = None
    water: FloatArray | None = None
    estimates: Estimates | None = None

    def part(self, rows: slice) -> "Trajectory":
        """Return some of the samples."""
        arrays: dict[str, Any] = {
            name: values[rows]
            for name, values in vars(self).items()
            if isinstance(values, np.ndarray)
        }
        return replace(self, **arrays)


def cut_at_divergence(trajectory: Trajectory, failure: str = "") -> Trajectory:
    """Return a trajectory cut before its first sample out of bounds, with the `Divergence`.

    A trajectory without such a sample is returned unchanged.

    Args:
        trajectory: Samples of an engine; NaN behind the last sample that it reached.
        failure: Message of the engine if it failed, else "".
    """
    cabinet = trajectory.cabinet
    inside = (np.abs(trajectory.state[:, :6]) <= _BOUNDS).all(axis=1)  # false for NaN
    if cabinet is not None:
        inside &= (np.abs(cabinet[:, :2]) <= LARGEST_TILT).all(axis=1)
    if inside.all():
        return trajectory
    index = int(np.argmin(inside))
    tilt = None if cabinet is None else cabinet[index, :2]
    reason = diverging_coordinate(trajectory.state[index], tilt)
    assert reason is not None  # this sample is out of bounds
    if failure and np.isnan(trajectory.state[index]).all():  # the engine took no such sample
        reason = "state", failure
    divergence = Divergence(float(trajectory.time[index]), *reason)
    return replace(trajectory.part(slice(index)), divergence=divergence)


def diverging_coordinate(
    positions: FloatArray, tilt: FloatArray | None = None
) -> tuple[str, str] | None:
    """Return name of the first coordinate out of bounds and the reason; None if all are in bounds.

    Args:
        positions: At least roll, pitch, yaw, x, y, z of the tub. [rad, m]
        tilt: Roll and pitch of a cabinet that moves; None for a fixed one. [rad]
    """
    if tilt is not None and np.any(np.abs(tilt) > LARGEST_TILT):
        return "cabinet", _tipping(*map(float, tilt))
    size = np.abs(positions[:6])
    bad = np.flatnonzero(~(size <= _BOUNDS))
    if not len(bad):
        return None
    index = int(bad[0])
    unit = "rad" if index < 3 else "m"
    name = COORDINATES[index]
    return name, f"{name} = {positions[index]:.4g} {unit}, bound {_BOUNDS[index]:g} {unit}"


def _tipping(roll: float, pitch: float) -> str:
    """Return how a cabinet tips over, from its roll and pitch. [rad]"""
    side = "front" if roll > 0.0 else "rear"
    if abs(pitch) > abs(roll):
        side = "right" if pitch > 0.0 else "left"
    angle = np.rad2deg(max(abs(roll), abs(pitch)))
    return (
        f"the cabinet tips over to its {side}, tilted by {angle:.0f} deg, "
        f"bound {np.rad2deg(LARGEST_TILT):.0f} deg"
    )


def divergence_text(divergence: Divergence | None, time: FloatArray, state: FloatArray) -> str:
    """Return a message with time and reason of a divergence and the last good sample.

    The message is "" for a run without divergence.

    Args:
        divergence: Divergence of the run, if any.
        time, state: Good samples of the run, (n,) [s] and (n, >= 6) [rad, m].
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
