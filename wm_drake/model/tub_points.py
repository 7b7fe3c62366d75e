"""Points of the tub that are measured."""

from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.sensor import MEASURED_POINT
from wm_drake.model.frame_poses import FramePoses
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class TubPoints:
    """Points of the tub that are measured, by name, in T. [m]

    Attributes:
        sensors: Points of the displacement sensors, (3,) each.
        detergent: Point nearest the detergent box. (3,)
        accelerometers: Points of the vibration sensors, (3,) each.
    """

    sensors: dict[str, FloatArray]
    detergent: FloatArray
    accelerometers: dict[str, FloatArray]


def tub_points(poses: FramePoses, parameters: MachineParameters) -> TubPoints:
    """Return the measured points of the tub."""
    sensors = {name: poses("tub", sensor.frame)[0] for name, sensor in parameters.sensors.items()}
    detergent = poses("tub", parameters.clearance.detergent_frame)[0]
    frames = parameters.accelerometer_frames()
    accelerometers = {name: poses("tub", frame)[0] for name, frame in frames.items()}
    return TubPoints(sensors, detergent, accelerometers)


def measured_points(
    parameters: MachineParameters, points: TubPoints, rest: FloatArray
) -> FloatArray:
    """Return the measured points: the sensors, then the detergent point along x, y, z.

    Args:
        parameters: The machine, for the axes of its sensors.
        points: Points of the tub.
        rest: Rest pose: roll, pitch, yaw, x, y, z. (6,) [rad, m]

    Returns:
        (sensors + 3, `elements.sensor.POINT_SIZE`)
    """
    positions = np.array([*points.sensors.values(), *[points.detergent] * 3])
    axes = [*(AXES.index(sensor.axis) for sensor in parameters.sensors.values()), 0, 1, 2]
    rotation = np.reshape(rotation_from_rpy(*map(float, rest[:3])), (3, 3))
    at_rest = (positions @ rotation.T + rest[3:6])[range(len(axes)), axes]
    return MEASURED_POINT.pack_rows(
        p_ToM_T=positions, direction_W=np.eye(3)[axes], at_rest=at_rest[:, None]
    )
