"""Prescribed motion of the drum in closed form: the speed of a spin profile is piecewise linear."""

from bisect import bisect_right

import numpy as np

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray


def drum_acceleration(profile: SpinProfile, time: FloatArray) -> FloatArray:
    """Return the prescribed angular acceleration of the drum.

    At a corner it is that of the piece that begins there.

    Args:
        profile: Drum speed over time.
        time: Any shape. [s] After the end of the profile the speed is constant.

    Returns:
        Same shape. [rad/s^2]
    """
    time = np.asarray(time, dtype=float)
    corners = np.array(profile.time)
    prescribed = np.array(profile.acceleration())[_piece(corners, time)]
    return np.where(time > corners[-1], 0.0, prescribed)


def drum_at(profile: SpinProfile, time: float) -> tuple[float, float]:
    """Return the prescribed angular acceleration and speed of the drum at one time.

    A simulation calls it at each stage of each step, so it makes no arrays. The numbers are those
    of `drum_acceleration` and `drum_motion`.

    Args:
        profile: Drum speed over time.
        time: [s] After the end of the profile the speed is constant.

    Returns:
        Acceleration [rad/s^2] and speed [rad/s].
    """
    corners, speed = profile.time, profile.speed
    if time > corners[-1]:
        return 0.0, speed[-1]
    piece = min(max(bisect_right(corners, time) - 1, 0), len(corners) - 2)
    acceleration = (speed[piece + 1] - speed[piece]) / (corners[piece + 1] - corners[piece])
    return acceleration, speed[piece] + acceleration * (time - corners[piece])


def drum_motion(profile: SpinProfile, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the prescribed speed and angle of the drum, integrated exactly from angle 0 at time 0.

    Args:
        profile: Drum speed over time.
        time: (n,) within the profile. [s]

    Returns:
        Speed (n,) [rad/s] and angle (n,) [rad].
    """
    corners, speed = np.array(profile.time), np.array(profile.speed)
    acceleration = np.array(profile.acceleration())
    pieces = 0.5 * (speed[1:] + speed[:-1]) * np.diff(corners)
    angle_at_corners = np.concatenate([[0.0], np.cumsum(pieces)])
    piece = _piece(corners, time)
    since = time - corners[piece]
    rate = speed[piece] + acceleration[piece] * since
    return rate, angle_at_corners[piece] + (
        speed[piece] + 0.5 * acceleration[piece] * since
    ) * since


def _piece(corners: FloatArray, time: FloatArray) -> np.ndarray:
    """Return the number of the linear piece that is in force just after each time."""
    return np.clip(np.searchsorted(corners, time, side="right") - 1, 0, len(corners) - 2)
