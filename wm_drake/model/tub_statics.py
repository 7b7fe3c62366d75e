"""Forces of gravity and massless elements on a tub at rest, and the pose at which they balance.

The elements are evaluated by the compiled laws of the mounts, for eight poses side by side: a pose
and six that are moved a little along each coordinate give the force and its slopes.
"""

import functools
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.compiler.lanes import WIDTH
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.mount import WRENCH_SIZE, mount_wrench_history
from wm_drake.elements.state_map import ELEMENT
from wm_drake.model.bodies import drawn_frame
from wm_drake.model.placed_elements import PlacedElements
from wm_drake.model.state_layout import CABINET
from wm_drake.parameters.types import FloatArray

POSE_STEP = 1e-6
"""Step of the differences of the slopes. [rad, m]"""

MOST_STEPS = 20
"""Steps of Newton's method; springs are nearly linear, and three or four suffice."""

_MOVED = np.zeros((WIDTH, 6))
_MOVED[1:7] = POSE_STEP * np.eye(6)


@dataclass(frozen=True)
class Weight:
    """Gravity on tub and drum.

    Attributes:
        force: In W. (3,) [N]
        centre: Centre of mass in T, with the drum as drawn. (3,) [m]
    """

    force: FloatArray
    centre: FloatArray

    @functools.cached_property
    def slopes(self) -> FloatArray:
        """Slopes of its wrench about the origin of W by roll, pitch, yaw, x, y, z, near T = W.

        (6, 6) moment and force by rows. [N m, N by rad, m]
        """
        moved = np.vstack([np.cross(np.eye(3), self.centre), np.eye(3)])
        return np.vstack([np.cross(moved, self.force).T, np.zeros((3, 6))])

    def wrench(self, pose: FloatArray) -> FloatArray:
        """Return moment about the origin of W and force at a pose of the tub. (6,) [N m, N]"""
        roll, pitch, yaw, *position = pose.tolist()
        rotation = np.reshape(rotation_from_rpy(roll, pitch, yaw), (3, 3))
        x, y, z = (rotation @ self.centre + position).tolist()
        f_x, f_y, f_z = self.force.tolist()
        return np.array([y * f_z - z * f_y, z * f_x - x * f_z, x * f_y - y * f_x, f_x, f_y, f_z])


def weight_of(plant: MultibodyPlant, context: Context) -> Weight:
    """Return the weight of all bodies that are fixed neither to the housing nor to a cabinet.

    Args:
        plant: Plant of a machine without bodies between tub and housing.
    """
    grounds = [plant.world_body()]
    if plant.HasBodyNamed(CABINET):
        grounds.append(plant.GetBodyByName(CABINET))
    fixed = {int(body.index()) for ground in grounds for body in plant.GetBodiesWeldedTo(ground)}
    tub = plant.GetBodyByName("tub")
    links = plant.GetBodyIndices(tub.model_instance())
    moving = [index for index in links if int(index) not in fixed]
    inertia = plant.CalcSpatialInertia(context, drawn_frame(plant, tub), moving)
    gravity = np.array(plant.gravity_field().gravity_vector())
    return Weight(inertia.get_mass() * gravity, np.array(inertia.get_com()))


class TubStatics:
    """Wrench of gravity and of the elements on the tub, all at rest, with relaxed sponges.

    Moments are about the origin of W.
    """

    def __init__(self, elements: PlacedElements, weight: Weight) -> None:
        """Pack the elements, none of which has bodies of its own."""
        self._weight = weight
        self._packed, begins = elements.packed_on_tub()
        states = elements.states()
        self._mounts = elements.mounts(begins, states)
        self._states = np.zeros((WIDTH, states.size))
        if elements.others:
            self._states[:, states.span(ELEMENT)] = elements.initial_of_others()
        count = sum(map(len, begins.values()))
        self._wrenches = np.empty((WIDTH, count * WRENCH_SIZE), order="F")

    def wrench(self, pose: FloatArray) -> FloatArray:
        """Return moment and force at a pose: roll, pitch, yaw, x, y, z. (6,) [N m, N]"""
        return self.with_slopes(pose)[0]

    def with_slopes(self, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return moment and force (6,) at a pose, and their slopes by its coordinates (6, 6)."""
        self._states[:, :6] = pose + _MOVED
        mount_wrench_history(self._states, self._packed, self._mounts, self._wrenches)
        on_tub = -self._wrenches.T.reshape(-1, WRENCH_SIZE, WIDTH).sum(axis=0)
        slopes = (on_tub[:, 1:7] - on_tub[:, :1]) / POSE_STEP
        return on_tub[:, 0] + self._weight.wrench(pose), slopes + self._weight.slopes

    def balance(self, pose: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
        """Look for the pose at which the wrench vanishes, by Newton's method.

        Args:
            pose: Where it begins.
            tolerance: Largest force or moment that may remain. [N, N m]

        Returns:
            The last pose and the wrench there, which is larger if there is no such pose near.
        """
        wrench, slopes = self.with_slopes(pose)
        for _ in range(MOST_STEPS):
            if not tolerance < np.abs(wrench).max() < np.inf:
                break
            try:
                pose = pose - np.linalg.solve(slopes, wrench)
            except np.linalg.LinAlgError:
                break
            wrench, slopes = self.with_slopes(pose)
        return pose, wrench


def about_tub(wrench: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a wrench with its moment about To in place of the origin of W. (6,) [N m, N]"""
    m_x, m_y, m_z, f_x, f_y, f_z = wrench.tolist()
    x, y, z = pose[3:].tolist()
    moment = m_x - y * f_z + z * f_y, m_y - z * f_x + x * f_z, m_z - x * f_y + y * f_x
    return np.array([*moment, f_x, f_y, f_z])
