"""Spin profile -> the steps of an integration and the drum's motion at them, in closed form."""

import functools
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Schedule:
    """Steps that end at every output time and at every corner of the profile, so that no step sees the acceleration jump.

    Attributes:
        step: (n,) length of each step; the last is of no length, for the sample at the end. [s]
        acceleration: (n,) of the drum in each step. [rad/s^2]
        drum: (2 n + 1, 4) rate, cosine and sine of the angle, and the angle, at begin and middle of each step and at the
            end of the last. [rad/s, 1, 1, rad]
        row: (n,) number of the sample at the begin of each step, or -1.
        time: (rows,) times of the samples, from 0. [s]
    """

    step: FloatArray
    acceleration: FloatArray
    drum: FloatArray
    row: np.ndarray
    time: FloatArray

    @property
    def steps(self) -> tuple[FloatArray, FloatArray, FloatArray, np.ndarray]:
        """As `wm_drake.engines.compiled.integration` takes them."""
        return self.step, self.acceleration, self.drum, self.row


@functools.lru_cache(maxsize=8)
def schedule_of(profile: SpinProfile, step: float, period: float) -> Schedule:
    """Steps of at most `step` through a profile, sampled every `period`. [s]"""
    time: FloatArray = period * np.arange(
        int(profile.duration / period * (1.0 + 1e-12)) + 1, dtype=float
    )
    corners, acceleration = np.array(profile.time), np.array(profile.acceleration())
    marks = np.union1d(time, corners)
    marks = np.delete(
        marks, np.flatnonzero(np.diff(marks) < 1e-9 * period) + 1
    )  # a corner that is a sample, but for rounding
    pieces = np.append(np.ceil(np.diff(marks) / step * (1.0 - 1e-9)).astype(int), 1)
    lengths = np.repeat(np.diff(marks, append=marks[-1]) / pieces, pieces)
    first = np.cumsum(pieces) - pieces  # step from each mark
    begins = (
        np.repeat(marks, pieces) + (np.arange(len(lengths)) - np.repeat(first, pieces)) * lengths
    )
    middles = begins + 0.5 * lengths
    row = np.full(len(lengths), -1, dtype=np.int64)
    nearest = np.rint(marks / period).astype(int)
    sampled = np.abs(marks - period * nearest) < 1e-9 * period
    row[first[sampled]] = nearest[sampled]
    return Schedule(
        step=lengths,
        acceleration=acceleration[_piece(corners, middles)],
        drum=_drum_motion(
            profile, np.append(np.column_stack([begins, middles]).ravel(), marks[-1])
        ),
        row=row,
        time=time,
    )


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
