"""The signal that a sensor on the tub records in a run.

A measurement is compared with what its recorder would have written of the computed motion. Nothing
measured is corrected: gravity, axes that turn with the tub, AC coupling and filters are computed.
"""

import json
from collections.abc import Mapping

import numpy as np

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.records import Record, rest_pose_of, sample_period
from wm_drake.simulation.vibration import point_accelerations, tub_motion_of

OVERSAMPLED = 20.0
"""Smallest ratio of the sampling rate of a low-pass filter to its corner frequency."""

LEAST_OVERSAMPLED = 8
"""Smallest ratio of the sampling rate of a low-pass filter to that of the record.

The frequencies of a bilinear filter are off by (pi f / rate)^2 / 3: 0.02 % at two drum orders of a
record with 30 samples in a turn.
"""


def recorded_signal(record: Record, sensor: RecordedSensor, point: FloatArray) -> FloatArray:
    """Return what the recorder of a sensor writes.

        displacement   e . (p_Q - p_Q0)
        velocity       e . (v_To + w x r)
        acceleration   e . (a_Q - g),   the specific force; without g if gravity is removed

    with r = R_WT p_ToQ_T, the axis e of the sensor and the position p_Q0 of its point at rest. The
    result passes the high-pass of an AC coupling and the low-pass of the recorder, both causal and
    settled at the first sample, and is multiplied by gain and polarity.

    Args:
        record: Record of a run whose cabinet does not move.
        point: Position p_ToQ_T of the sensor in T. (3,) [m]

    Returns:
        (n,) at the samples of the record, in SI units of the quantity.
    """
    return _along(record, tub_motion_of(record), sensor, point, sensor.axis)[0]


def _along(
    record: Record,
    tub: tuple[FloatArray, FloatArray],
    sensor: RecordedSensor,
    point: FloatArray,
    axes: str,
) -> list[FloatArray]:
    """Return what the recorder of a sensor writes if its axis is that of each letter.

    Args:
        tub: States and accelerations of the tub, from `tub_motion_of`.
        point: Position p_ToQ_T of the sensor in T. (3,) [m]
    """
    motion, acceleration = tub
    rest = rest_pose_of(record)
    if sensor.quantity == "displacement":
        vectors = point_displacements(motion, point[None], rest)[:, 0]
    elif sensor.quantity == "velocity":
        arm = _rotations(motion[:, :3]) @ point
        vectors = motion[:, 10:13] + np.cross(motion[:, 7:10], arm)
    else:
        vectors = point_accelerations(motion, acceleration, point[None])[:, 0]
        if sensor.gravity == "included":
            vectors[:, 2] += gravity_of(record)
    sign, signals = -1.0 if sensor.polarity == "negative" else 1.0, []
    for axis in axes:
        turned = sensor.model_copy(update={"axis": axis})
        true = np.einsum("ni,ni->n", vectors, sensor_axis(turned, motion[:, :3], rest[:3]))
        signals.append(sign * sensor.gain * _through_recorder(true, sample_period(record), sensor))
    return signals


def turned_signals(
    record: Record, sensors: Mapping[str, RecordedSensor], points: Mapping[str, FloatArray]
) -> FloatArray:
    """Return the signals of sensors, and those of sensors along two other axes. (n, sensor, 3)

    A sensor that is off by small angles records the first one, and the others times these angles.

    Args:
        points: Positions of the sensors in T, (3,) each. [m]
    """
    tub, columns = tub_motion_of(record), list[FloatArray]()
    for name, sensor in sensors.items():
        axes = sensor.axis + "xyz".replace(sensor.axis, "")
        columns += _along(record, tub, sensor, points[name], axes)
    return np.stack(columns, axis=1).reshape(len(record.time), len(sensors), 3)


def gravity_of(record: Record) -> float:
    """Return the acceleration of free fall of the machine of a record. [m/s^2]"""
    return float(json.loads(record.attrs["parameters"])["gravity"])


def sensor_axis(sensor: RecordedSensor, angles: FloatArray, rest: FloatArray) -> FloatArray:
    """Return the axis of a sensor in W over time. (n, 3)

    Args:
        angles: Roll, pitch, yaw of the tub (n, 3). [rad]
        rest: Those at rest (3,). [rad]
    """
    tilted = _rotations(np.array([sensor.tilt]))[0][:, "xyz".index(sensor.axis)]
    if not sensor.turns_with_tub:
        return np.broadcast_to(tilted, (len(angles), 3))
    axis_T = _rotations(rest[None])[0].T @ tilted
    return np.asarray(_rotations(angles) @ axis_T)


def _rotations(angles: FloatArray) -> FloatArray:
    """Return the rotation matrices (n, 3, 3) of roll, pitch and yaw (n, 3)."""
    return np.stack(generic(rotation_from_rpy)(*angles.T), axis=1).reshape(-1, 3, 3)


def _through_recorder(signal: FloatArray, period: float, sensor: RecordedSensor) -> FloatArray:
    """Return a signal behind the filters of a sensor and its recorder."""
    if sensor.ac_coupling is not None:
        signal = _filtered(signal, 1.0 / period, ("highpass", 1, sensor.ac_coupling))
    if sensor.low_pass is None or len(signal) < 2:
        return signal
    from scipy.interpolate import CubicSpline  # slow to import: low-pass filters

    factor = max(LEAST_OVERSAMPLED, int(np.ceil(OVERSAMPLED * sensor.low_pass * period)))
    places = np.arange((len(signal) - 1) * factor + 1) / factor
    fine = CubicSpline(np.arange(len(signal)), signal)(places)
    kind = "lowpass", sensor.low_pass_order, sensor.low_pass
    return _filtered(fine, factor / period, kind)[::factor]


def _filtered(signal: FloatArray, rate: float, kind: tuple[str, int, float]) -> FloatArray:
    """Return a signal behind a causal Butterworth filter that is settled at the first sample.

    Args:
        rate: Sampling rate. [Hz]
        kind: Kind of the filter, order, and corner frequency. [Hz]
    """
    from scipy.signal import butter, sosfilt, sosfilt_zi  # slow to import: filters of recorders

    form, order, corner = kind
    sections = butter(order, corner, form, fs=rate, output="sos")
    return np.asarray(sosfilt(sections, signal, zi=sosfilt_zi(sections) * signal[0])[0])
