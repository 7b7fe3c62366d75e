"""Smallest gaps of a recorded machine: the pose that displacement sensors tell."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from wm_drake.model.scene import Scene
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED, TIME, of_measure
from wm_drake.simulation.recorded_signal import sensor_axis
from wm_drake.simulation.records import rest_pose_of
from wm_drake.simulation.vibration import tub_motion_of
from wm_drake.studies.compare.pairs import Pair

LEAST_RANK = 5
"""Smallest number of motions of the tub that the sensors must tell: all but one."""

SMALLEST_PART = 1e-2
"""Singular value of a motion, by the largest one, below which the sensors do not tell it."""

GAP = of_measure("smallest_gap")


def gaps_of(
    pairs: Sequence[Pair],
    sensors: Mapping[str, RecordedSensor],
    points: Mapping[str, FloatArray],
    scene: Scene,
) -> xr.Dataset | None:
    """Return the smallest gaps between tub and housing, recorded and computed.

    The pose of a recording is that of its run, moved so that the displacement sensors measure what
    was recorded (linear in the motion; the smallest one). A motion that no sensor tells stays that
    of the run.

    Args:
        points: Positions of the sensors in T, (3,) each. [m]
        scene: Shapes of the machine.

    Returns:
        Over record: `measured` and `computed` gap [m], `time` [s] and `speed` [rad/s] of the
        measured one, its `parts`; None if the sensors tell less than five motions, or if the
        machine has no shapes.
    """
    numbers = [k for k, sensor in enumerate(sensors.values()) if _tells_displacement(sensor)]
    names = [name for name, sensor in sensors.items() if _tells_displacement(sensor)]
    rows = [_motion_row(sensors[name], points[name], pairs[0]) for name in names]
    if len(rows) < LEAST_RANK:
        return None
    moving = np.stack(rows)
    if np.linalg.matrix_rank(moving, tol=SMALLEST_PART * np.linalg.norm(moving, 2)) < LEAST_RANK:
        return None
    inverse = np.linalg.pinv(moving, rcond=SMALLEST_PART)
    gaps = []
    for pair in pairs:
        poses, rest = tub_motion_of(pair.run)[0][:, :6], rest_pose_of(pair.run)
        missing = pair.measured[:, numbers] - pair.predicted[:, numbers]
        valid = np.isfinite(missing).all(axis=1)
        time = pair.run.time.values
        moved = np.ascontiguousarray(poses[valid] + missing[valid] @ inverse.T)
        measured = scene.smallest_gap(time[valid], moved, rest)
        computed = scene.smallest_gap(time, np.ascontiguousarray(poses), rest)
        if measured is None or computed is None:
            return None
        speed = float(np.interp(measured.time, time, np.abs(pair.run.drum_speed.values)))
        gaps.append((measured.distance, computed.distance, measured.time, speed, measured.parts))
    measured_, computed_, time_, speed_, parts = zip(*gaps, strict=True)
    return xr.Dataset(
        {
            "measured": GAP.named("smallest gap, recorded").variable("record", measured_),
            "computed": GAP.named("computed").variable("record", computed_),
            "time": TIME.variable("record", time_),
            "speed": SPEED.variable("record", speed_),
            "between": ("record", list(parts)),
        },
        {"record": [pair.recording.path.name for pair in pairs]},
    )


def _tells_displacement(sensor: RecordedSensor) -> bool:
    filtered = sensor.ac_coupling is not None or sensor.low_pass is not None
    return sensor.quantity == "displacement" and not sensor.turns_with_tub and not filtered


def _motion_row(sensor: RecordedSensor, point: FloatArray, pair: Pair) -> FloatArray:
    """Return the displacement of a sensor for each small motion of the tub: angles, position."""
    angles = rest_pose_of(pair.run)[:3]
    axis = sensor_axis(sensor, angles[None], angles)[0]
    sign = -1.0 if sensor.polarity == "negative" else 1.0
    return sign * sensor.gain * np.concatenate([np.cross(point, axis), axis])
