"""Support functions of cylinders and boxes that are fixed to a moving body."""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import lanes_to_rows, rows_to_lanes, sqrt, where
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.compiler.vectors import dot, rotate, rotate_back, rotation_from_rpy


@long_running
def support_history(poses, direction, centre, axes, half, is_round, nearest):
    """Compute the smallest coordinate of a shape along a direction, in each pose of its body.

    It is minus the support function of the shape for the opposite direction.

    Args:
        poses: Poses of the body: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
        direction: Unit vector in W. (3,)
        centre, axes, half, is_round: Attributes of a `wm_drake.model.scene.Outline`; the axes by
            rows. (3,), (9,), (3,) [m]
        nearest: Smallest coordinate of any point of the shape, written. (n, 1) [m]
    """
    align_stack()
    x_numbers, numbers = np.empty(6 * WIDTH), np.empty(WIDTH)
    x, answer = lane_array(x_numbers), lane_array(numbers)
    d, c, h = (
        (direction[0], direction[1], direction[2]),
        (centre[0], centre[1], centre[2]),
        (half[0], half[1], half[2]),
    )
    a = (axes[0], axes[1], axes[2], axes[3], axes[4], axes[5], axes[6], axes[7], axes[8])
    for begin in range(0, len(poses), WIDTH):
        rows_to_lanes(poses, begin, x_numbers)
        in_body = rotate_back(rotation_from_rpy(x[0], x[1], x[2]), d)
        along = rotate(a, in_body)
        if is_round:
            across = 1.0 - along[2] * along[2]
            reach = h[2] * abs(along[2]) + h[0] * sqrt(where(across > 0.0, across, 0.0 * across))
        else:
            reach = h[0] * abs(along[0]) + h[1] * abs(along[1]) + h[2] * abs(along[2])
        answer[0] = dot((x[3], x[4], x[5]), d) + dot(in_body, c) - reach
        lanes_to_rows(numbers, begin, nearest)
