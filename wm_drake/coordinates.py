"""Where the plant of a machine keeps what: the one description of its state that all others go by."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.parameters import MachineParameters

Indices = np.ndarray


@dataclass(frozen=True)
class Coordinates:
    """Indices of positions; velocities have the same ones, behind all positions.

    A tree is a body that floats and the one on its joint: tub and drum, outer and inner tube of a damper. Each has seven
    positions: roll, pitch, yaw, x, y, z, and that of its joint.

    Attributes:
        size: How many positions there are.
        trees: Seven indices for each tree: tub and drum, then each telescopic damper's tubes.
    """

    size: int
    trees: tuple[Indices, ...]

    @property
    def tub(self) -> Indices:
        """Six: roll, pitch, yaw, x, y, z."""
        return self.trees[0][:6]

    @property
    def drum(self) -> int:
        """Of the drum angle."""
        return int(self.trees[0][6])

    @property
    def tubes(self) -> Indices:
        """(telescopic dampers, 7)"""
        return np.array(self.trees[1:], dtype=int).reshape(-1, 7)

    @property
    def hanging(self) -> Indices:
        """What hangs on the tub and finds its own place there: all but tub and drum angle."""
        return np.setdiff1d(np.arange(self.size), self.trees[0])

    def states(self) -> list[Indices]:
        """Fourteen indices in the state of the plant for each tree: its positions, its velocities."""
        return [np.concatenate([tree, self.size + tree]) for tree in self.trees]


def coordinates_of(plant: MultibodyPlant, parameters: MachineParameters) -> Coordinates:
    """Of a finalized plant with the joints that `wm_drake.bodies.add_bodies` gives it."""

    def tree(floating: str, joint: str) -> Indices:
        begin = plant.GetJointByName(floating).position_start()
        return np.append(begin + np.arange(6), plant.GetJointByName(joint).position_start())

    trees = [tree("tub_floating", parameters.drive.joint)]
    for damper in parameters.telescopic_dampers.values():
        outer = plant.GetJointByName(damper.joint).parent_body().name()
        trees.append(tree(f"{outer}_floating", damper.joint))
    return Coordinates(plant.num_positions(), tuple(trees))
