"""What the set-ups and runs of one built machine share, since it depends on few of its numbers."""

from collections.abc import Callable
from typing import Any

from pydrake.multibody.plant import MultibodyPlant

from wm_drake.model.frame_poses import FramePoses
from wm_drake.model.same_elements import check_same_elements
from wm_drake.model.scene import Scene
from wm_drake.model.tub_statics import Weight
from wm_drake.parameters import MachineParameters


class SetUpCache:
    """Parameters, frame poses and weight of the last set-up, and scenes that no thread uses.

    Threads may share it: each value is replaced as a whole, and a thread that misses computes it.

    Attributes:
        scenes: Scenes to take from and to give back; many short batches share them.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.scenes: list[Scene] = []
        self._poses: FramePoses | None = None
        self._weight: tuple[Any, Weight] | None = None
        self._checked: MachineParameters | None = None

    def check(self, built: MachineParameters, requested: MachineParameters) -> None:
        """Check that a machine has the elements of the built one; see `check_same_elements`."""
        check_same_elements(built, requested, self._checked)
        self._checked = requested

    def frame_poses(self, plant: MultibodyPlant, parameters: MachineParameters) -> FramePoses:
        """Return the frame poses; those of the last set-up if its overrides were the same."""
        poses = self._poses
        if poses is None or poses.frames != parameters.frames:
            poses = self._poses = FramePoses(plant, parameters)
        return poses

    def weight(self, parameters: MachineParameters, compute: Callable[[], Weight]) -> Weight:
        """Return the weight on the springs; that of the last set-up if its bodies were the same."""
        bodies, last = (parameters.bodies, parameters.frames), self._weight
        if last is None or last[0] != bodies:
            last = self._weight = bodies, compute()
        return last[1]
