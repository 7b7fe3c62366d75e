"""A cabinet that moves: its motion in a record, the forces of the floor, how far it has walked."""

from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, rows_to_lanes, sine_cosine
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.elements.cabinet import FEET_COUNT, FLOOR_FORCE_SIZE, foot_of
from wm_drake.elements.motion import BODY_STATE_SIZE, read_body_state
from wm_drake.engines.compiled.bearing import carrier_motion
from wm_drake.engines.compiled.cabinet import SLIPS_BEGIN
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.variables import Variables, declared


@dataclass(frozen=True)
class Walk:
    """How a cabinet stands after a run, against where it stood before.

    Attributes:
        shift: How far the middle of its feet has moved on the floor, x and y. (2,) [m]
        turn: Angle about the vertical axis by which the feet have turned, counterclockwise from
            above. [rad]
    """

    shift: FloatArray
    turn: float

    @property
    def distance(self) -> float:
        """Return the length of the shift. [m]"""
        return float(np.hypot(*self.shift))


def walk(cabinet: Cabinet, slips: FloatArray) -> Walk:
    """Return shift and turn of a cabinet from how far each of its feet has slid.

    They are those of the rigid motion that is nearest to the four slips (least squares).

    Args:
        slips: (4, 2) how far the end of each pad has slid. [m]
    """
    feet = np.array([(cabinet.feet[name].x, cabinet.feet[name].y) for name in cabinet.corners])
    before = feet - feet.mean(axis=0)
    after = before + slips - slips.mean(axis=0)
    across = np.sum(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    return Walk(slips.mean(axis=0), float(np.arctan2(across, np.sum(before * after))))


def cabinet_variables(setup: Setup, trajectory: Trajectory) -> Variables:
    """Return the variables of the motion of a cabinet and of its feet; none if it is fixed."""
    if setup.cabinet is None or trajectory.cabinet is None:
        return {}
    states = trajectory.cabinet
    forces = floor_forces(states, setup.cabinet.packed())
    slips = states[:, BODY_STATE_SIZE:].reshape(-1, FEET_COUNT, 2)
    slips = np.concatenate([slips, np.zeros_like(slips[:, :, :1])], axis=2)
    return declared(
        cabinet_angle=states[:, :3],
        cabinet_position=states[:, 3:6],
        cabinet_angular_velocity=states[:, 6:9],
        cabinet_velocity=states[:, 9:12],
        floor_force=forces,
        foot_slip=slips,
    )


def floor_forces(states: FloatArray, p: FloatArray) -> FloatArray:
    """Return the force of the floor on each foot over time, in axes that turn with the cabinet.

    The third axis is vertical; the other two are those of W, turned by the yaw of the cabinet.

    Args:
        states: (n, 20) states of the cabinet, as in `Trajectory.cabinet`.
        p: Packed numbers of the feet.

    Returns:
        (n, 4, 3) [N]
    """
    forces = np.empty((len(states), FLOOR_FORCE_SIZE))
    floor_force_history(np.ascontiguousarray(states), p, forces)
    return forces.reshape(-1, FEET_COUNT, 3)


@long_running
def floor_force_history(states, p, forces):
    """Evaluate `floor_forces`.

    Args:
        states, p: As for `floor_forces`.
        forces: (n, 12), written: x, y, z of each foot.
    """
    align_stack()
    x_numbers, numbers = np.empty(states.shape[1] * WIDTH), np.empty(FLOOR_FORCE_SIZE * WIDTH)
    p_numbers = in_each_lane(p)
    x, q, answer = lane_array(x_numbers), lane_array(p_numbers), lane_array(numbers)
    for begin in range(0, len(states), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        motion, _ = carrier_motion(x, 0)
        s, c = sine_cosine(read_body_state(x, 0).angles[2])
        for i in range(FEET_COUNT):
            foot = foot_of(x, SLIPS_BEGIN, motion, q, 0, i)
            f_x, f_y, normal = foot.force
            answer[3 * i], answer[3 * i + 1] = c * f_x + s * f_y, c * f_y - s * f_x
            answer[3 * i + 2] = normal
        lanes_to_rows(numbers, begin, forces)
    keep(p_numbers)
