"""State layout of a machine's plant: the index of each position and velocity.

This is the only description of the state; all other modules use it.
"""

import functools
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.parameters import MachineParameters

Indices = np.ndarray

CARRIER = "drum_carrier"
"""Name of the massless body that the drum turns in if its bearing is compliant."""

CABINET = "cabinet"
"""Name of the body of a cabinet that moves on its feet. Its frame coincides with W at rest."""


@dataclass(frozen=True)
class StateLayout:
    """Indices of the positions; a velocity has the index of its position, plus `size`.

    A tree is a floating body and a second body on one of its joints: tub and drum, or outer and
    inner tube of a damper. It has seven positions: roll, pitch, yaw, x, y, z and that of the joint.
    With a compliant bearing the drum turns in a floating carrier. The drum then belongs to two
    trees: tub and drum for all elements on the tub, carrier and drum for the bearing. In the same
    way the drum is added to a cabinet that moves, so that all trees are of one form.

    Attributes:
        size: Number of positions.
        tub: Indices of roll, pitch, yaw, x, y, z of the tub. (6,)
        drum: Index of the drum angle.
        tubes: Indices of the outer tube and of the extension. (telescopic dampers, 7)
        carrier: Indices of roll, pitch, yaw, x, y, z of the drum carrier with a compliant bearing,
            else empty. (6,)
        cabinet: Indices of roll, pitch, yaw, x, y, z of a cabinet that moves, else empty. (6,)
    """

    size: int
    tub: Indices
    drum: int
    tubes: Indices
    carrier: Indices
    cabinet: Indices

    @property
    def trees(self) -> list[Indices]:
        """Return the seven indices of each tree.

        The order is tub and drum, tubes of each telescopic damper, carrier and drum if there is a
        carrier, cabinet and drum if the cabinet moves.
        """
        others = [body for body in (self.carrier, self.cabinet) if body.size]
        with_drum = [np.append(body, self.drum) for body in (self.tub, *others)]
        return [with_drum[0], *self.tubes, *with_drum[1:]]

    @functools.cached_property
    def attached(self) -> Indices:
        """Return the indices of the bodies attached to the tub: tubes of dampers, drum carrier."""
        return np.setdiff1d(np.arange(self.size), [*self.tub, self.drum, *self.cabinet])

    def states(self) -> list[Indices]:
        """Return the indices in the state of each tree: 7 positions, then 7 velocities."""
        return [np.concatenate([tree, self.size + tree]) for tree in self.trees]


def state_layout_of(plant: MultibodyPlant, parameters: MachineParameters) -> StateLayout:
    """Return the state layout of a finalized plant.

    Args:
        plant: Plant with the joints that `wm_drake.model.bodies.add_bodies` adds.
    """

    def floating(body: str) -> Indices:
        return np.asarray(plant.GetJointByName(f"{body}_floating").position_start() + np.arange(6))

    tubes = np.zeros((len(parameters.telescopic_dampers), 7), dtype=int)
    for row, damper in zip(tubes, parameters.telescopic_dampers.values(), strict=True):
        joint = plant.GetJointByName(damper.joint)
        row[:] = *floating(joint.parent_body().name()), joint.position_start()
    drum = plant.GetJointByName(parameters.drive.joint).position_start()
    carrier = floating(CARRIER) if parameters.imperfections.bearing else np.zeros(0, dtype=int)
    cabinet = floating(CABINET) if parameters.cabinet_moves else np.zeros(0, dtype=int)
    return StateLayout(plant.num_positions(), floating("tub"), drum, tubes, carrier, cabinet)
