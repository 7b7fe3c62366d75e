"""Points of the tub that are measured."""

import functools
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
        axes: Numbers of the axes of W along which the sensors measure.
    """

    sensors: dict[str, FloatArray]
    detergent: FloatArray
    accelerometers: dict[str, FloatArray]
    axes: tuple[int, ...]

    @functools.cached_property
    def measured(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions in T and directions in W of all measured points; packed, with zero at rest."""
        positions = np.array([*self.sensors.values(), *[self.detergent] * 3])
        directions = np.eye(3)[[*self.axes, 0, 1, 2]]
        packed = MEASURED_POINT.pack_rows(
            p_ToM_T=positions, direction_W=directions, at_rest=np.zeros((len(positions), 1))
        )
        return positions, directions, packed


def tub_points(poses: FramePoses, parameters: MachineParameters) -> TubPoints:
    """Return the measured points of the tub."""
    sensors = {name: poses("tub", sensor.frame)[0] for name, sensor in parameters.sensors.items()}
    detergent = poses("tub", parameters.clearance_frame)[0]
    frames = parameters.accelerometer_frames()
    accelerometers = {name: poses("tub", frame)[0] for name, frame in frames.items()}
    axes = tuple(AXES.index(sensor.axis) for sensor in parameters.sensors.values())
    return TubPoints(sensors, detergent, accelerometers, axes)


def measured_points(points: TubPoints, rest: FloatArray) -> FloatArray:
    """Return the measured points: the sensors, then the detergent point along x, y, z.

    Args:
        rest: Rest pose: roll, pitch, yaw, x, y, z. (6,) [rad, m]

    Returns:
        (sensors + 3, `elements.sensor.POINT_SIZE`)
    """
    positions, directions, packed = points.measured
    rotation = np.reshape(rotation_from_rpy(*rest[:3].tolist()), (3, 3))
    moved = packed.copy()
    at_rest = directions * (positions @ rotation.T + rest[3:6])
    moved[:, MEASURED_POINT.offsets["at_rest"]] = at_rest.sum(axis=1)
    return moved
