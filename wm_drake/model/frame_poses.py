"""Poses of the frames of the SDF, under the overrides of a machine file."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.parameters import FrameOverride
from wm_drake.parameters.types import FloatArray


class FramePoses:
    """Poses of frames in the frame of a body, under one set of overrides; each is computed once."""

    def __init__(
        self, plant: MultibodyPlant, frames: dict[str, FrameOverride], context: Context
    ) -> None:
        """Start without any pose.

        Args:
            plant: The plant.
            frames: The overrides.
            context: A plant Context in which the overrides are set.
        """
        self.frames, self.context, self._plant = frames, context, plant
        self._known: dict[tuple[str, str], tuple[FloatArray, FloatArray]] = {}

    def __call__(self, body: str, frame: str) -> tuple[FloatArray, FloatArray]:
        """Return position (3,) [m] and rotation (3, 3) of a frame in the frame of a body."""
        if (body, frame) not in self._known:
            body_frame = self._plant.GetBodyByName(body).body_frame()
            pose = self._plant.CalcRelativeTransform(
                self.context, body_frame, self._plant.GetFrameByName(frame)
            )
            self._known[body, frame] = (
                np.array(pose.translation()),
                np.array(pose.rotation().matrix()),
            )
        return self._known[body, frame]
