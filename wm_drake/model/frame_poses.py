"""Poses of the frames of the SDF as drawn, under overrides; points of the tub that are measured."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.bushing import AXES
from wm_drake.elements.kind import Ends
from wm_drake.elements.sensor import MEASURED_POINT
from wm_drake.errors import check_known, input_error
from wm_drake.model.bodies import DRUM, axis_pose, drawn_frame, set_bodies
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.element_kinds import SHAPE
from wm_drake.parameters.types import FloatArray

Placed = TypeVar("Placed")


class FramePoses:
    """Poses of frames in the frame of a body, as drawn; each is computed once.

    Attributes:
        frames: The overrides of the machine file.
    """

    def __init__(self, plant: MultibodyPlant, parameters: MachineParameters) -> None:
        """Set the overrides in a Context of its own.

        Raises:
            InputError: names unknown to the SDF.
        """
        self.frames, self._plant, self._parameters = parameters.frames, plant, parameters
        self._context = plant.CreateDefaultContext()
        set_bodies(plant, self._context, parameters)
        self._known: dict[tuple[str, str], tuple[FloatArray, FloatArray]] = {}
        self._placed: dict[str, tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, body: str, frame: str) -> tuple[FloatArray, FloatArray]:
        """Return position (3,) [m] and rotation (3, 3) of a frame in the frame of a body."""
        if (body, frame) not in self._known:
            pose = self._plant.CalcRelativeTransform(
                self._context,
                drawn_frame(self._plant, self._plant.GetBodyByName(body)),
                self._plant.GetFrameByName(frame),
            )
            self._known[body, frame] = (
                np.array(pose.translation()),
                np.array(pose.rotation().matrix()),
            )
        return self._known[body, frame]

    def ends(self, tub_frame: str, housing_frame: str) -> Ends:
        """Return the ends of an element between two frames, or between two shapes.

        Those of shapes are their nearest points, without a rotation.

        Raises:
            InputError: only one is a shape, there is no such pair of shapes, or they overlap.
        """
        names = [frame.removeprefix(SHAPE) for frame in (tub_frame, housing_frame)]
        are_shapes = [frame.startswith(SHAPE) for frame in (tub_frame, housing_frame)]
        if not any(are_shapes):
            return Ends(*self("tub", tub_frame), *self("world", housing_frame))
        if not all(are_shapes):
            raise input_error(
                f"'{tub_frame}' and '{housing_frame}' are a shape and a frame; allowed are two "
                "shapes or two frames"
            )
        scene = Scene(self._parameters)
        pair = "|".join(names)
        check_known(pair, scene.pair_names(), f"no pair of shapes '{pair}'")
        distance, (tub_point, housing_point) = scene.nearest_points(np.zeros(6), *names)
        if not distance > 0.0:
            raise input_error(f"shapes '{pair}' overlap; as drawn they must be apart")
        return Ends(tub_point, np.eye(3), housing_point, np.eye(3))

    @property
    def gravity(self) -> FloatArray:
        """Return the acceleration of free fall in W. (3,) [m/s^2]"""
        return np.array(self._plant.gravity_field().gravity_vector())

    def on_drum(self, y: float) -> tuple[FloatArray, FloatArray]:
        """Return position and rotation, in T, of a frame at a place of the drum axis.

        Its y axis is that axis, its z axis points to the top of the drum, z of D at angle 0.

        Args:
            y: Position along the axis from the origin of D. [m]
        """
        position, rotation = self("tub", self._plant.GetBodyByName(DRUM).body_frame().name())
        X_TB = RigidTransform(RotationMatrix(rotation), position)
        X_TD = X_TB @ axis_pose(self._plant)
        return np.asarray(X_TD @ np.array([0.0, y, 0.0])), X_TD.rotation().matrix()

    def placed(self, key: str, parts: tuple[Any, ...], place: Callable[[], Placed]) -> Placed:
        """Return an element placed at these frames; that of the last call, if its parts were these.

        Cases of a design share what their parameters do not change.

        Args:
            parts: Frozen parameters that the element is made of, always as many, or numbers as
                bytes.
        """
        known = self._placed.get(key)
        if known is None or not all(map(_are_same, known[0], parts)):
            known = self._placed[key] = parts, place()
        placed: Placed = known[1]
        return placed


def _are_same(a: Any, b: Any) -> bool:
    return a is b or (type(a) is bytes and a == b)


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
