"""RMS displacement of three-axis sensors in the regions of a spin profile.

It is computed in two ways: directly, and from the acceleration. An experiment measures acceleration
and integrates it twice ([A] section 4.1). The integration causes drift, which must be removed. The
model has the displacement itself. Both signals pass the same filter here, so that they can be
compared with each other and with a measurement.
"""

import functools
from collections.abc import Mapping

import numpy as np
import xarray as xr

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.parameters import Sensor, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import HIGH_PASS_HZ, PADDING_PERIODS, RMS_FILTER_ORDER
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.records import Record

DRIFT_HZ = 0.1
"""Corner frequency of the filter that removes the drift after each integration.

It is a fifth of `HIGH_PASS_HZ`, so that it does not change the motion above that frequency.
"""

MOST_MISSING = 0.01
"""Largest part of a region that a record may lack at its end."""

FEWEST = 16
"""Smallest number of samples that is filtered; results for fewer samples are NaN."""


def region_displacements(
    motion: FloatArray,
    acceleration: FloatArray,
    points: FloatArray,
    rest_pose: FloatArray,
    period: float,
    profile: SpinProfile,
) -> tuple[FloatArray, FloatArray]:
    """Return the RMS displacement of points of the tub in each region of a profile.

    Args:
        motion: (n, >= 13) states of the plant: roll, pitch, yaw, x, y, z of the tub, drum angle,
            angular velocity of the tub and velocity of To in W. [rad, m, rad/s, m/s]
        acceleration: (n, 6) angular acceleration of the tub and acceleration of To, in W.
            [rad/s^2, m/s^2]
        points: (k, 3) positions in T. [m]
        rest_pose: (6,) roll, pitch, yaw, x, y, z from which displacements count. [rad, m]
        period: Time between samples. [s]

    Returns:
        Two arrays (regions, k, 3) in W: from the displacement itself, and from the acceleration
        integrated twice. NaN for regions without `region_samples`. [m]
    """

    def rms(signal: FloatArray) -> FloatArray:
        return region_rms(high_passed(signal, period, HIGH_PASS_HZ), period, profile)

    # one point after the other: splines and filters take 30 times the memory of their signal
    direct, integrated = [], []
    for point in points[:, None]:
        direct.append(rms(point_displacements(motion, point, rest_pose)[:, 0]))
        at_point = point_accelerations(motion, acceleration, point)[:, 0]
        integrated.append(rms(integrated_twice(at_point, period)))
    return np.stack(direct, axis=1), np.stack(integrated, axis=1)


def specific_forces(
    motion: FloatArray,
    acceleration: FloatArray,
    points: FloatArray,
    rest_pose: FloatArray,
    gravity: float,
) -> FloatArray:
    """Return what accelerometers glued to the tub record: a_Q - g, along axes that turn with it.

    The axes are those of W at rest. Where the tub tilts, gravity is in the signals, which an
    integration takes for a motion.

    Args:
        motion, acceleration, points, rest_pose: As for `region_displacements`.
        gravity: Acceleration of free fall. [m/s^2]

    Returns:
        (n, k, 3) [m/s^2]
    """
    turned = np.stack(generic(rotation_from_rpy)(*motion[:, :3].T), axis=1).reshape(-1, 3, 3)
    rest = np.array(generic(rotation_from_rpy)(*rest_pose[:3])).reshape(3, 3)
    force = point_accelerations(motion, acceleration, points) + np.array([0.0, 0.0, gravity])
    return np.asarray(np.einsum("ij,nkj,npk->npi", rest, turned, force))


def displacement_of(acceleration: FloatArray, period: float) -> FloatArray:
    """Return the high-passed displacements [m] of recorded accelerations [m/s^2] (n, k).

    The bias of a sensor is a mean with a Hann window: a plain mean would include the velocity at
    the end of the record divided by its duration.
    """
    if not len(acceleration):
        return acceleration
    bias = np.average(acceleration, axis=0, weights=np.hanning(len(acceleration) + 2)[1:-1])
    return high_passed(integrated_twice(acceleration - bias, period), period, HIGH_PASS_HZ)


def tub_motion_of(record: Record) -> tuple[FloatArray, FloatArray]:
    """Return states (n, 13) and accelerations (n, 6) of the tub in the form of this module."""
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
    return states, acceleration


def sensor_accelerations(record: Record, sensors: Mapping[str, Sensor]) -> xr.DataArray:
    """Return the accelerations at the points of displacement sensors, along their axes in W.

    Gravity is not included: an accelerometer that measures down to 0 Hz shows it in addition.

    Returns:
        (time, sensor) with the sensors of the record. [m/s^2]
    """
    names = [str(name) for name in record.sensor.values]
    axes = ["xyz".index(sensors[name].axis) for name in names]
    at_points = point_accelerations(*tub_motion_of(record), record.sensor_point.values)
    along = np.stack([at_points[:, k, axis] for k, axis in enumerate(axes)], axis=1)
    return record.displacement.copy(data=along).assign_attrs(
        units="m/s^2", long_name="acceleration at the sensors, along their axes"
    )


def point_accelerations(
    motion: FloatArray, acceleration: FloatArray, points: FloatArray
) -> FloatArray:
    """Return the accelerations of points of the tub.

        a_Q = a_To + alpha x r + w x (w x r),   r = R_WT p_Q

    Args:
        motion: (n, >= 13) states of the plant as in `region_displacements`.
        acceleration: (n, 6) angular acceleration of the tub and acceleration of To, in W.
            [rad/s^2, m/s^2]
        points: (k, 3) positions in T. [m]

    Returns:
        (n, k, 3) in W. [m/s^2]
    """
    if not len(motion):
        return np.empty((0, len(points), 3))
    rotation = np.stack(generic(rotation_from_rpy)(*motion[:, :3].T), axis=1).reshape(-1, 3, 3)
    arms = np.einsum("nij,kj->nki", rotation, points)
    w, w_rate = motion[:, None, 7:10], acceleration[:, None, :3]
    return acceleration[:, None, 3:] + np.cross(w_rate, arms) + np.cross(w, np.cross(w, arms))


def integrated_twice(acceleration: FloatArray, period: float) -> FloatArray:
    """Return displacements from accelerations, integrated twice.

    Each integral is that of a cubic spline through the samples. The drift is removed after each
    integration.

    Args:
        acceleration: (n, k) one column per signal. [m/s^2]
        period: Time between samples. [s]

    Returns:
        (n, k) displacements. [m] NaN if there are too few samples or if one of them is not finite.
    """
    if len(acceleration) < FEWEST or not np.isfinite(acceleration).all():  # the run diverged
        return np.full(acceleration.shape, np.nan)
    velocity = high_passed(_integral(acceleration, period), period, DRIFT_HZ)
    return high_passed(_integral(velocity, period), period, DRIFT_HZ)


def _integral(signal: FloatArray, period: float) -> FloatArray:
    from scipy.interpolate import CubicSpline  # slow to import: accelerations

    time = period * np.arange(len(signal))
    return np.asarray(CubicSpline(time, signal, axis=0).antiderivative()(time))


def high_passed(signal: FloatArray, period: float, corner_hz: float) -> FloatArray:
    """Return signals after a high-pass filter without phase shift.

    The signals are padded before filtering: by zeros before the first sample, because the machine
    was at rest, and by mirrored samples after the last one, because a record ends in full motion.

    Args:
        signal: (n, k) one column per signal.
        period: Time between samples. [s]
        corner_hz: Corner frequency. [Hz]

    Returns:
        (n, k) in the unit of the signals. NaN if there are fewer than `FEWEST` samples.
    """
    from scipy.signal import sosfiltfilt  # slow to import: accelerations

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
    from scipy.signal import butter  # slow to import: accelerations

    return np.asarray(
        butter(RMS_FILTER_ORDER, corner_hz, btype="highpass", fs=1.0 / period, output="sos")
    )


def region_rms(signal: FloatArray, period: float, profile: SpinProfile) -> FloatArray:
    """Return the root mean square of signals in each region of a profile.

    Args:
        signal: (n, k) one column per signal; the first sample is at time 0.
        period: Time between samples. [s]

    Returns:
        (regions, k) in the unit of the signals. NaN for regions without `region_samples`.
    """
    parts = [signal[part] for part in region_samples(profile, period, len(signal))]
    missing = np.full(signal.shape[1], np.nan)
    rows = [np.sqrt(np.mean(part**2, axis=0)) if len(part) else missing for part in parts]
    return np.array(rows).reshape(len(profile.regions), signal.shape[1])


def region_samples(profile: SpinProfile, period: float, count: int) -> list[slice]:
    """Return the samples of each region of a profile; none of a region that the samples lack.

    A record may end a sample or `MOST_MISSING` before a region does.

    Args:
        period: Time between samples; the first is at time 0. [s]
        count: Number of samples.
    """

    def first_at(time: float) -> int:
        return int(np.ceil(time / period * (1.0 - 1e-12)))

    parts = []
    for region in profile.regions:
        first, last = first_at(region.begin), first_at(region.end)
        is_there = last - count <= max(1.0, MOST_MISSING * (last - first))
        parts.append(slice(first, min(last, count) if is_there else first))
    return parts


def relative_error(computed: FloatArray, measured: FloatArray) -> FloatArray:
    """Return the relative error of RMS displacements, with norms over the last axis.

        |d_measured - d_computed| / |d_measured|        [A] Eq. (9), Euclidean norms

    Args:
        computed, measured: (..., k) displacements of k pairs of sensor and axis. [m]

    Returns:
        (...) relative error as a fraction; NaN where the norm of the measured values is zero.
    """
    size = np.linalg.norm(measured, axis=-1)
    return np.linalg.norm(measured - computed, axis=-1) / np.where(size > 0.0, size, np.nan)
