"""Forces of gravity and massless elements on a tub at rest, and the pose at which they balance.

Engine and exported page find the pose by the same compiled function, `balance_tub`.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.compiler.matrices import plus, scaled, six, solve
from wm_drake.compiler.vectors import add, cross, rotate
from wm_drake.elements.motion import tub_motion
from wm_drake.elements.mount import WRENCH_SIZE, write_mount_wrenches
from wm_drake.elements.state_map import ELEMENT
from wm_drake.model.bodies import drawn_frame
from wm_drake.model.placed_elements import PlacedElements
from wm_drake.model.state_layout import CABINET
from wm_drake.parameters.types import FloatArray

POSE_STEP = 1e-6
"""Step of the differences of the slopes. [rad, m]"""

POSES = 7
"""Poses of a step of Newton's method: one, and six that are moved in one coordinate each."""

MOST_STEPS = 20
"""Steps of Newton's method; springs are nearly linear, and three or four suffice."""


@dataclass(frozen=True)
class Weight:
    """Gravity on tub and drum.

    Attributes:
        force: In W. (3,) [N]
        centre: Centre of mass in T, with the drum as drawn. (3,) [m]
    """

    force: FloatArray
    centre: FloatArray


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


@law
def weight_wrench(motion, weight):
    """Return moment about the origin of W and force of a weight, six numbers. [N m, N]

    Args:
        motion: `TubMotion`.
        weight: Force in W and centre of mass in T, as of `Weight`. [N, m]
    """
    force, centre = weight
    m = cross(add(motion.position, rotate(motion.rotation, centre)), force)
    return (m[0], m[1], m[2], force[0], force[1], force[2])


@long_running
def wrenches_on_tub(states, p, mounts, weight, wrenches):
    """Write moment about the origin of W and force on a tub at rest, at `WIDTH` states. [N m, N]

    All arrays are flat arrays of lanes.

    Args:
        states: States at rest: pose of the tub, and what the mounts read beside it.
        p, mounts: Packed numbers, and the `Mounts` that act at rest.
        weight: As for `weight_wrench`.
        wrenches: Written: the six numbers, behind the `WRENCH_SIZE` numbers of each mount.
    """
    align_stack()
    x, answer = lane_array(states), lane_array(wrenches)
    write_mount_wrenches(x, lane_array(p), mounts, answer)
    total, end = weight_wrench(tub_motion(x), weight), len(wrenches) // WIDTH - 6
    for at in range(0, end, WRENCH_SIZE):
        total = plus(total, scaled(-1.0, six(answer, at)))
    for k in range(6):
        answer[end + k] = total[k] + 0.0 * x[0]


@long_running
def balance_tub(x, p, mounts, weight, tolerance, wrenches, left):
    """Look for the pose at which gravity and mounts balance, by Newton's method.

    Args:
        x: State at rest, of which the pose of the tub is moved from where it begins.
        p, mounts, weight, wrenches: As for `wrenches_on_tub`.
        tolerance: Largest force or moment that may remain. [N, N m]
        left: Moment and force that remain, written; larger ones if there is no such pose near.
    """
    states, totals = np.empty(len(x) * WIDTH), wrenches[len(wrenches) - 6 * WIDTH :]
    slopes, step = np.empty(36), np.empty(6)
    for _ in range(MOST_STEPS):
        for begin in range(0, POSES, WIDTH):
            write_poses(x, begin, WIDTH, states)
            wrenches_on_tub(states, p, mounts, weight, wrenches)
            if begin == 0:
                largest = 0.0
                for i in range(6):
                    left[i] = totals[i * WIDTH]
                    step[i], largest = left[i], max(largest, abs(left[i]))
                if not tolerance < largest < np.inf:
                    return
            write_slopes(totals, begin, WIDTH, left, slopes)
        if not solve(slopes, step, 6):
            return
        for k in range(6):
            x[k] = x[k] - step[k]


@law
def write_poses(x, begin, width, states):
    """Write a state into lanes: the first of `POSES` as it is, each other moved in one coordinate.

    Args:
        x: State.
        begin, width: Number of the first lane among all, and how many there are.
        states: Flat array of lanes, written.
    """
    for k in range(len(x)):
        for lane in range(width):
            states[k * width + lane] = x[k]
            if k < 6 and begin + lane == k + 1:
                states[k * width + lane] = x[k] + POSE_STEP


@law
def write_slopes(totals, begin, width, left, slopes):
    """Write the slopes of moment and force along the coordinates that are moved in these lanes.

    Args:
        totals: Flat array of lanes: moment and force at the poses of `write_poses`.
        begin, width: Number of the first lane among all, and how many there are.
        left: Moment and force at the first pose.
        slopes: (36,), by rows, written.
    """
    for lane in range(width):
        k = begin + lane - 1
        if 0 <= k < 6:
            for i in range(6):
                slopes[6 * i + k] = (totals[i * width + lane] - left[i]) / POSE_STEP


class TubStatics:
    """Gravity and the elements on the tub, all at rest, with relaxed sponges.

    Moments are about the origin of W.
    """

    def __init__(self, elements: PlacedElements, weight: Weight) -> None:
        """Pack the elements, none of which has bodies of its own."""
        packed, begins = elements.packed_on_tub()
        states = elements.states()
        self._states = np.zeros(states.size)
        if elements.others:
            self._states[states.span(ELEMENT)] = elements.initial_of_others()
        numbers = tuple(weight.force.tolist()), tuple(weight.centre.tolist())
        lanes = fill_lanes(aligned(len(packed) * WIDTH), [packed])
        self._numbers = lanes, elements.mounts(begins, states), numbers
        self._wrenches = aligned((sum(map(len, begins.values())) + 1) * WRENCH_SIZE * WIDTH)

    def wrench(self, pose: FloatArray) -> FloatArray:
        """Return moment and force at a pose: roll, pitch, yaw, x, y, z. (6,) [N m, N]"""
        self._states[:6] = pose
        states = fill_lanes(aligned(len(self._states) * WIDTH), [self._states])
        wrenches_on_tub(states, *self._numbers, self._wrenches)
        return self._wrenches[-6 * WIDTH :: WIDTH].copy()

    def balance(self, tolerance: float) -> tuple[FloatArray, FloatArray]:
        """Return the pose at rest near the drawn one, and the wrench there; see `balance_tub`."""
        self._states[:6] = 0.0
        left = np.empty(6)
        balance_tub(self._states, *self._numbers, tolerance, self._wrenches, left)
        return self._states[:6].copy(), left


def about_tub(wrench: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a wrench with its moment about To in place of the origin of W. (6,) [N m, N]"""
    m_x, m_y, m_z, f_x, f_y, f_z = wrench.tolist()
    x, y, z = pose[3:].tolist()
    moment = m_x - y * f_z + z * f_y, m_y - z * f_x + x * f_z, m_z - x * f_y + y * f_x
    return np.array([*moment, f_x, f_y, f_z])
