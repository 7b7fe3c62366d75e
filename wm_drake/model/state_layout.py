"""Where the plant of a machine keeps what: the one description of its state that all others go by."""

import functools
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from wm_drake.parameters import MachineParameters

Indices = np.ndarray

CARRIER = "drum_carrier"
"""Name of the massless body that the drum turns in where its bearing gives."""


@dataclass(frozen=True)
class StateLayout:
    """Indices of positions; velocities have the same ones, behind all positions.

    A tree is a body that floats and one on a joint of its: tub and drum, outer and inner tube of a damper. Each has seven
    positions: roll, pitch, yaw, x, y, z, and that of the joint. Where the drum's bearing gives, the drum turns in a carrier
    that floats too. Elements on the tub go on to see tub and drum; what holds the carrier sees carrier and drum besides.

    Attributes:
        size: How many positions there are.
        tub: Six: roll, pitch, yaw, x, y, z.
        drum: Of the drum angle.
        tubes: (telescopic dampers, 7)
        carrier: Six as of the tub, or none.
    """

    size: int
    tub: Indices
    drum: int
    tubes: Indices
    carrier: Indices

    @property
    def trees(self) -> list[Indices]:
        """Seven indices each: tub and drum, then each telescopic damper's tubes, then carrier and drum, if there is one."""
        carriers = [np.append(self.carrier, self.drum)] if self.carrier.size else []
        return [np.append(self.tub, self.drum), *self.tubes, *carriers]

    @functools.cached_property
    def hanging(self) -> Indices:
        """What hangs on the tub and finds its own place there: all but tub and drum angle."""
        return np.setdiff1d(np.arange(self.size), [*self.tub, self.drum])

    def states(self) -> list[Indices]:
        """Fourteen indices in the state of the plant for each tree: its positions, its velocities."""
        return [np.concatenate([tree, self.size + tree]) for tree in self.trees]


def state_layout_of(plant: MultibodyPlant, parameters: MachineParameters) -> StateLayout:
    """Of a finalized plant with the joints that `wm_drake.model.bodies.add_bodies` gives it."""

    def floating(body: str) -> Indices:
        return np.asarray(plant.GetJointByName(f"{body}_floating").position_start() + np.arange(6))

    tubes = np.zeros((len(parameters.telescopic_dampers), 7), dtype=int)
    for row, damper in zip(tubes, parameters.telescopic_dampers.values(), strict=True):
        joint = plant.GetJointByName(damper.joint)
        row[:] = *floating(joint.parent_body().name()), joint.position_start()
    drum = plant.GetJointByName(parameters.drive.joint).position_start()
    carrier = floating(CARRIER) if parameters.imperfections.bearing else np.zeros(0, dtype=int)
    return StateLayout(plant.num_positions(), floating("tub"), drum, tubes, carrier)
