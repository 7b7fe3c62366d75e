"""Steps of an integration through a spin profile, and the prescribed motion of the drum at them."""

import functools
import threading
from dataclasses import dataclass

import numpy as np

from wm_drake.elements.spin_profile import drum_acceleration, drum_motion
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Schedule:
    """Steps that end at every output time and at every corner of the profile.

    No step contains a jump of the drum's acceleration.

    Attributes:
        step: (n,) length of each step; the last has length zero, for the sample at the end. [s]
        acceleration: (n,) of the drum in each step. [rad/s^2]
        drum: (2 n + 1, 4) speed, cosine and sine of the angle, and the angle, at the start and the
            middle of each step and at the end of the last. [rad/s, 1, 1, rad]
        row: (n,) number of the sample at the start of each step, or -1.
        time: (rows,) times of the samples, from 0. [s]
        controls: (n,) bool, whether a sampled controller acts at the start of each step.
        alike: (n,) number of steps just before each one that have its length and its acceleration.
    """

    step: FloatArray
    acceleration: FloatArray
    drum: FloatArray
    row: np.ndarray
    time: FloatArray
    controls: np.ndarray
    alike: np.ndarray

    @property
    def steps(self) -> tuple[FloatArray, FloatArray, FloatArray, np.ndarray, np.ndarray]:
        """Return the five arrays that `wm_drake.engines.compiled.integration` reads."""
        return self.step, self.acceleration, self.drum, self.row, self.controls


MOST_NODES = 65536
"""Number of nodes whose drum motion is computed at once; a run may have millions of them."""

_ONE_AT_A_TIME = threading.Lock()


def schedule_of(
    profile: SpinProfile, step: float, period: float, control_period: float = 0.0
) -> Schedule:
    """Return the steps through a profile.

    Args:
        profile: Drum speed over time.
        step: Largest step. [s]
        period: Time between samples. [s]
        control_period: Time between samples of a sampled controller, 0 for none. [s] Steps end at
            them, too.
    """
    with _ONE_AT_A_TIME:  # threads that need the same schedule share it
        return _schedule_of(profile, step, period, control_period)


@functools.lru_cache(maxsize=8)
def _schedule_of(
    profile: SpinProfile, step: float, period: float, control_period: float
) -> Schedule:
    time, corners = output_times(profile, period), np.array(profile.time)
    marks = np.union1d(time, corners)
    if control_period:
        marks = np.union1d(marks, output_times(profile, control_period))
    # a corner that differs from a sample by rounding only is that sample
    marks = np.delete(marks, np.flatnonzero(np.diff(marks) < 1e-9 * period) + 1)
    pieces = np.append(np.ceil(np.diff(marks) / step * (1.0 - 1e-9)).astype(int), 1)
    lengths = np.repeat(np.diff(marks, append=marks[-1]) / pieces, pieces)
    first = np.cumsum(pieces) - pieces  # step from each mark
    since_mark = (np.arange(len(lengths)) - np.repeat(first, pieces)) * lengths
    begins = np.repeat(marks, pieces) + since_mark
    middles = begins + 0.5 * lengths
    row = np.full(len(lengths), -1, dtype=np.int64)
    sampled, nearest = _multiples(marks, period)
    row[first[sampled]] = nearest[sampled]
    controls = np.zeros(len(lengths), dtype=bool)
    if control_period:
        controls[first[_multiples(marks, control_period)[0]]] = True
    nodes = np.append(np.column_stack([begins, middles]).ravel(), marks[-1])
    acceleration = drum_acceleration(profile, np.minimum(middles, marks[-1]))
    return Schedule(
        step=lengths,
        acceleration=acceleration,
        drum=_drum_at(profile, nodes),
        row=row,
        time=time,
        controls=controls,
        alike=_alike(lengths, acceleration),
    )


def _drum_at(profile: SpinProfile, nodes: FloatArray) -> FloatArray:
    """Return speed, cosine and sine of the angle, and the angle of the drum at times. (n, 4)"""
    drum = np.empty((len(nodes), 4))
    for begin in range(0, len(nodes), MOST_NODES):
        speed, angle = drum_motion(profile, nodes[begin : begin + MOST_NODES])
        drum[begin : begin + MOST_NODES] = np.column_stack(
            [speed, np.cos(angle), np.sin(angle), angle]
        )
    return drum


def _multiples(marks: FloatArray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which times are whole multiples of a period, and the nearest multiple of each."""
    nearest = np.rint(marks / period).astype(int)
    return np.abs(marks - period * nearest) < 1e-9 * period, nearest


def _alike(lengths: FloatArray, acceleration: FloatArray) -> np.ndarray:
    """Return how many steps just before each one have its length and its acceleration."""
    # lengths that differ by rounding only are equal
    change = np.abs(np.diff(lengths)) > 1e-9 * lengths[:-1]
    change |= np.diff(acceleration) != 0.0
    numbers = np.arange(len(lengths))
    last_change = np.maximum.accumulate(np.where(np.append(True, change), numbers, 0))
    return numbers - last_change


def output_times(profile: SpinProfile, period: float) -> FloatArray:
    """Return the times of the samples of a run over a profile, from 0. [s]"""
    last = int(profile.duration / period * (1.0 + 1e-12))
    return period * np.arange(last + 1, dtype=float)
