"""Spin profile -> the steps of an integration and the drum's motion at them, in closed form."""

import functools
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.elements import FloatArray


@dataclass(frozen=True)
class Schedule:
    """Steps that end at every output time and at every corner of the profile, so that no step sees the acceleration jump.

    Attributes:
        step: (n,) length of each step. [s]
        acceleration: (n,) of the drum in each step. [rad/s^2]
        drum: (2 n + 1, 4) rate, cosine and sine of the angle, and the angle, at begin and middle of each step and at the
            end of the last. [rad/s, 1, 1, rad]
        row: (n,) number of the sample at the end of each step, or -1.
        time: (rows,) times of the samples, from 0. [s]
        sample_acceleration: (rows,) of the drum just after each sample. [rad/s^2]
    """

    step: FloatArray
    acceleration: FloatArray
    drum: FloatArray
    row: np.ndarray
    time: FloatArray
    sample_acceleration: FloatArray

    @property
    def steps(self) -> tuple[FloatArray, FloatArray, FloatArray, np.ndarray]:
        """As `wm_drake.kernel.integration` takes them."""
        return self.step, self.acceleration, self.drum, self.row


@functools.lru_cache(maxsize=8)
def schedule_of(profile: SpinProfile, step: float, period: float) -> Schedule:
    """Steps of at most `step` through a profile, sampled every `period`. [s]"""
    time: FloatArray = period * np.arange(int(profile.duration / period * (1.0 + 1e-12)) + 1, dtype=float)
    corners, acceleration = np.array(profile.time), np.array(profile.acceleration())
    marks = np.union1d(time, corners)
    marks = np.delete(marks, np.flatnonzero(np.diff(marks) < 1e-9 * period) + 1)  # a corner that is a sample, but for rounding
    pieces = np.ceil(np.diff(marks) / step * (1.0 - 1e-9)).astype(int)
    lengths = np.repeat(np.diff(marks) / pieces, pieces)
    number = np.arange(len(lengths)) - np.repeat(np.cumsum(pieces) - pieces, pieces)  # of a step between two marks
    begins = np.repeat(marks[:-1], pieces) + number * lengths
    middles = begins + 0.5 * lengths
    return Schedule(
        step=lengths,
        acceleration=acceleration[_piece(corners, middles)],
        drum=_drum_motion(profile, np.append(np.column_stack([begins, middles]).ravel(), marks[-1])),
        row=_rows(marks, pieces, period),
        time=time,
        sample_acceleration=acceleration[_piece(corners, time)],
    )


def _rows(marks: FloatArray, pieces: np.ndarray, period: float) -> np.ndarray:
    """Number of the sample that each step ends with, or -1."""
    row = np.full(np.sum(pieces), -1, dtype=np.int64)
    nearest = np.rint(marks[1:] / period).astype(int)
    sampled = np.abs(marks[1:] - period * nearest) < 1e-9 * period
    row[(np.cumsum(pieces) - 1)[sampled]] = nearest[sampled]
    return row


def _piece(corners: FloatArray, time: FloatArray) -> np.ndarray:
    """Number of the piece of the profile that holds just after each time."""
    return np.clip(np.searchsorted(corners, time, side="right") - 1, 0, len(corners) - 2)


def _drum_motion(profile: SpinProfile, time: FloatArray) -> FloatArray:
    corners, speed = np.array(profile.time), np.array(profile.speed)
    acceleration = np.array(profile.acceleration())
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(corners))])
    piece = _piece(corners, time)
    since = time - corners[piece]
    rate = speed[piece] + acceleration[piece] * since
    angle = turned[piece] + (speed[piece] + 0.5 * acceleration[piece] * since) * since
    return np.column_stack([rate, np.cos(angle), np.sin(angle), angle])
