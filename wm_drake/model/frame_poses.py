"""Poses of the frames of the SDF as drawn, under the overrides of a machine file."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.model.bodies import DRUM, set_bodies
from wm_drake.parameters import MachineParameters
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
        self.frames, self._plant, self._drive = parameters.frames, plant, parameters.drive.joint
        self._context = plant.CreateDefaultContext()
        set_bodies(plant, self._context, parameters)
        self._known: dict[tuple[str, str], tuple[FloatArray, FloatArray]] = {}
        self._placed: dict[str, tuple[tuple[Any, ...], Any]] = {}

    def __call__(self, body: str, frame: str) -> tuple[FloatArray, FloatArray]:
        """Return position (3,) [m] and rotation (3, 3) of a frame in the frame of a body."""
        if (body, frame) not in self._known:
            body_frame = self._plant.GetBodyByName(body).body_frame()
            pose = self._plant.CalcRelativeTransform(
                self._context, body_frame, self._plant.GetFrameByName(frame)
            )
            self._known[body, frame] = (
                np.array(pose.translation()),
                np.array(pose.rotation().matrix()),
            )
        return self._known[body, frame]

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
        joint = self._plant.GetJointByName(self._drive)
        frame = joint.frame_on_parent()
        X_TF = self._plant.CalcRelativeTransform(
            self._context, self._plant.GetBodyByName("tub").body_frame(), frame
        )
        axis = X_TF.rotation() @ joint.revolute_axis()
        origin = X_TF.translation()
        centre = origin + (axis @ (position - origin) + y) * axis
        top = rotation[:, 2] - (axis @ rotation[:, 2]) * axis
        top /= np.linalg.norm(top)
        return centre, np.column_stack([np.cross(axis, top), axis, top])

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
