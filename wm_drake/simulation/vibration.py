"""Motion -> RMS displacement of three-axis sensors in the regions of a spin profile, taken directly and from acceleration.

An experiment measures acceleration and integrates it twice ([A] section 4.1), which brings drifts that must be removed; the
model has the displacement itself. Both go through the same filter here, so that they can be compared, with each other and with
a measurement.
"""

import functools

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.runs import Record, point_displacements

HIGH_PASS_HZ = 0.5
"""Slower motion is not vibration: the lower band edge of [B] section 2.2. There is no upper one: RMS sums up all speeds."""

DRIFT_HZ = 0.1
"""Corner below which what two integrations make of errors is taken out; a fifth of the band edge leaves that as it is."""

ORDER = 4
"""Of the Butterworth filters; run forwards and backwards, so that they shift nothing."""

FEWEST = 16
"""Samples; with fewer there is nothing to filter."""

PADDING_PERIODS = 2.5
"""By how much a record is made longer at both ends before filtering, in periods of the corner."""


def region_displacements(
    motion: FloatArray,
    acceleration: FloatArray,
    points: FloatArray,
    rest_pose: FloatArray,
    period: float,
    profile: SpinProfile,
) -> tuple[FloatArray, FloatArray]:
    """RMS displacement of points of the tub in each region of a profile.

    Args:
        motion: (n, >= 13) states of the plant: roll, pitch, yaw, x, y, z, drum angle, angular velocity, velocity of To.
        acceleration: (n, 6) angular acceleration of the tub and acceleration of To, in W. [rad/s^2, m/s^2]
        points: (k, 3) in T. [m]
        rest_pose: (6,) from which displacements count.
        period: Between samples. [s]
        profile: With regions.

    Returns:
        Taken directly, and by integrating the acceleration twice; each (regions, k, 3), NaN where the run did not get through
        the region. [m]
    """
    shape = (len(profile.regions), len(points), 3)
    direct = point_displacements(motion, points, rest_pose).reshape(len(motion), -1)
    integrated = integrated_twice(
        point_accelerations(motion, acceleration, points).reshape(len(motion), -1), period
    )
    both = (
        region_rms(high_passed(signal, period, HIGH_PASS_HZ), period, profile)
        for signal in (direct, integrated)
    )
    first, second = (rms.reshape(shape) for rms in both)
    return first, second


def record_region_displacements(
    record: Record, points: FloatArray, profile: SpinProfile
) -> tuple[FloatArray, FloatArray]:
    """`region_displacements` of a record."""
    angle = record.drum_angle.values[:, None]
    motion = [
        record.tub_angle.values,
        record.tub_position.values,
        angle,
        record.tub_angular_velocity.values,
    ]
    states = np.hstack([*motion, record.tub_velocity.values])
    acceleration = np.hstack(
        [record.tub_angular_acceleration.values, record.tub_acceleration.values]
    )
    time = record.time.values
    period = float(time[1] - time[0]) if len(time) > 1 else 1.0
    return region_displacements(
        states, acceleration, points, np.asarray(record.attrs["rest_pose"]), period, profile
    )


def point_accelerations(
    motion: FloatArray, acceleration: FloatArray, points: FloatArray
) -> FloatArray:
    """Accelerations in W of points of the tub, (n, k, 3); arguments as for `region_displacements`. [m/s^2]"""
    if not len(motion):
        return np.empty((0, len(points), 3))
    rotation = np.stack(generic(rotation_from_rpy)(*motion[:, :3].T), axis=1).reshape(-1, 3, 3)
    arms = np.einsum("nij,kj->nki", rotation, points)
    w, w_rate = motion[:, None, 7:10], acceleration[:, None, :3]
    return acceleration[:, None, 3:] + np.cross(w_rate, arms) + np.cross(w, np.cross(w, arms))


def integrated_twice(acceleration: FloatArray, period: float) -> FloatArray:
    """Displacements from accelerations (n, k), each integral of a cubic spline, with the drift taken out after each. [m]"""
    if len(acceleration) < FEWEST or not np.isfinite(acceleration).all():  # of a run that diverged
        return np.full(acceleration.shape, np.nan)
    velocity = high_passed(_integral(acceleration, period), period, DRIFT_HZ)
    return high_passed(_integral(velocity, period), period, DRIFT_HZ)


def _integral(signal: FloatArray, period: float) -> FloatArray:
    time = period * np.arange(len(signal))
    return np.asarray(CubicSpline(time, signal, axis=0).antiderivative()(time))


def high_passed(signal: FloatArray, period: float, corner_hz: float) -> FloatArray:
    """Signals (n, k) without what is slower than a corner; NaN if there are too few samples.

    Before the first sample there was rest. At the end the signal is mirrored: a record ends in full motion.
    """
    if len(signal) < FEWEST:
        return np.full(signal.shape, np.nan)
    padding = round(PADDING_PERIODS / corner_hz / period)
    mirrored = signal[::-1][1 : padding + 1]
    padded = np.concatenate([np.zeros((padding, signal.shape[1])), signal, mirrored])
    return np.asarray(
        sosfiltfilt(_high_pass(period, corner_hz), padded, axis=0)[padding : padding + len(signal)]
    )


@functools.cache
def _high_pass(period: float, corner_hz: float) -> FloatArray:
    return np.asarray(butter(ORDER, corner_hz, btype="highpass", fs=1.0 / period, output="sos"))


def region_rms(signal: FloatArray, period: float, profile: SpinProfile) -> FloatArray:
    """Root mean square of signals (n, k) in each region of a profile, (regions, k); NaN where they end before the region does.

    Args:
        signal: From time 0 on.
        period: Between samples. [s]
        profile: With regions.
    """
    rows = []
    for region in profile.regions:
        first, last = (
            int(np.ceil(time / period * (1.0 - 1e-12))) for time in (region.begin, region.end)
        )
        whole = last <= len(signal) and last > first
        rows.append(
            np.sqrt(np.mean(signal[first:last] ** 2, axis=0))
            if whole
            else np.full(signal.shape[1], np.nan)
        )
    return np.array(rows).reshape(len(profile.regions), signal.shape[1])


def relative_error(computed: FloatArray, measured: FloatArray) -> FloatArray:
    """Relative error of RMS displacements, over the last axis.

        |d_measured - d_computed| / |d_measured|        [A] Eq. (9), Euclidean norms

    Args:
        computed, measured: (..., k) of k sensors and axes, or of one. [m]

    Returns:
        (...) A fraction; NaN where there is nothing measured.
    """
    size = np.linalg.norm(measured, axis=-1)
    return np.linalg.norm(measured - computed, axis=-1) / np.where(size > 0.0, size, np.nan)
