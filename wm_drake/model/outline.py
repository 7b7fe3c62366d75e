"""Bounds of distances: support functions of cylinders and boxes that are fixed to a moving body."""

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import lanes_to_rows, rows_to_lanes, sqrt, where
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array, lanes_any
from wm_drake.compiler.vectors import dot, rotate_back, rotation_from_rpy


@law
def lowest_point(in_body, shape, is_round):
    """Return the smallest coordinate of a shape along a direction, from the origin of its body. [m]

    It is minus the support function of the shape for the opposite direction.

    Args:
        in_body: The direction in the frame of the body, a unit vector (three numbers).
        shape: Numbers of a `wm_drake.model.scene.Outline`: centre, axes by rows, half widths.
        is_round: Whether it is a cylinder.
    """
    x, y = (shape[3], shape[4], shape[5]), (shape[6], shape[7], shape[8])
    z = (shape[9], shape[10], shape[11])
    along = (dot(x, in_body), dot(y, in_body), dot(z, in_body))
    if is_round:
        across = 1.0 - along[2] * along[2]
        reach = shape[14] * abs(along[2])
        reach = reach + shape[12] * sqrt(where(across > 0.0, across, 0.0 * across))
    else:
        reach = shape[12] * abs(along[0]) + shape[13] * abs(along[1]) + shape[14] * abs(along[2])
    return dot(in_body, (shape[0], shape[1], shape[2])) - reach


@long_running
def lowest_points(poses, direction, shape, is_round, nearest):
    """Compute the smallest coordinate of a shape along a direction, in each pose of its body.

    Args:
        poses: Poses of the body: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
        direction: Unit vector in W. (3,)
        shape, is_round: See `lowest_point`.
        nearest: Smallest coordinate of any point of the shape, written. (n, 1) [m]
    """
    align_stack()
    x_numbers, numbers = np.empty(6 * WIDTH), np.empty(WIDTH)
    x, answer = lane_array(x_numbers), lane_array(numbers)
    d = (direction[0], direction[1], direction[2])
    for begin in range(0, len(poses), WIDTH):
        rows_to_lanes(poses, begin, x_numbers)
        in_body = rotate_back(rotation_from_rpy(x[0], x[1], x[2]), d)
        answer[0] = dot((x[3], x[4], x[5]), d) + lowest_point(in_body, shape, is_round)
        lanes_to_rows(numbers, begin, nearest)
    keep(x_numbers)


@long_running
def raise_bounds(poses, direction, moving, fixed, are_round, bound):
    """Raise lower bounds of the distance of two shapes at poses of the body that carries the first.

    The gap between the support functions of two convex shapes along any direction is such a bound.

    Args:
        poses: Poses of the body: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
        direction: Unit vector in W along which the first shape moves away from the second. (3,)
        moving, fixed: Numbers of the two shapes, see `lowest_point`; the second is fixed to W.
        are_round: Whether each is a cylinder.
        bound: Bounds, raised where this direction has a larger one. (n,) [m]

    Returns:
        The first pose with the smallest bound.
    """
    align_stack()
    x_numbers, numbers = np.empty(6 * WIDTH), np.empty(WIDTH)
    x, answer = lane_array(x_numbers), lane_array(numbers)
    d = (direction[0], direction[1], direction[2])
    opposite = lowest_point((-d[0], -d[1], -d[2]), fixed, are_round[1])
    least = 0
    for begin in range(0, len(poses), WIDTH):
        rows_to_lanes(poses, begin, x_numbers)
        in_body = rotate_back(rotation_from_rpy(x[0], x[1], x[2]), d)
        lowest = dot((x[3], x[4], x[5]), d) + lowest_point(in_body, moving, are_round[0])
        answer[0] = lowest + opposite
        for lane in range(min(WIDTH, len(poses) - begin)):
            index = begin + lane
            bound[index] = max(bound[index], numbers[lane])
            if bound[index] < bound[least]:
                least = index
    keep(x_numbers)
    return least


@long_running
def measure_motion(poses, reference, reach, motion):
    """Compute how far the tub moves from a reference pose.

    Args:
        poses: Poses of the tub: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
        reference: The same of the reference pose. (6,)
        reach: Largest distance of a point of the tub group from To. [m]
        motion: Written, a flat array of lanes: for each `lanes.WIDTH` poses the translation x, y, z
            and the largest displacement of a point of the tub group by the rotation. The last
            entries repeat the last pose. [m]

    Returns:
        The first pose with the largest displacement of any point, and this displacement. [m]
    """
    align_stack()
    x_numbers, numbers = np.empty(6 * WIDTH), np.empty(WIDTH)
    x, answer, displacements = lane_array(x_numbers), lane_array(numbers), lane_array(motion)
    farthest, shift = 0, -1.0
    for begin in range(0, len(poses), WIDTH):
        rows_to_lanes(poses, begin, x_numbers)
        turned = abs(x[0] - reference[0]) + abs(x[1] - reference[1]) + abs(x[2] - reference[2])
        turned = turned * reach
        moved = (x[3] - reference[3], x[4] - reference[4], x[5] - reference[5])
        at = begin // WIDTH * 4
        displacements[at], displacements[at + 1], displacements[at + 2] = moved
        displacements[at + 3] = turned
        answer[0] = sqrt(dot(moved, moved)) + turned
        for lane in range(min(WIDTH, len(poses) - begin)):
            if numbers[lane] > shift:
                farthest, shift = begin + lane, numbers[lane]
    keep(x_numbers)
    return farthest, shift


@long_running
def find_near(motion, count, direction, limit, stride, near):
    """Find the poses at which the lower bound of the change of a distance is below a limit.

    Args:
        motion: From `measure_motion`.
        count: Number of poses.
        direction: Unit vector along which the distance is measured. (3,)
        limit: The limit. [m]
        stride: 1, or a multiple of `lanes.WIDTH`: only every pose of this stride is looked at, from
            the first one.
        near: Their numbers, written. (count,)

    Returns:
        How many they are.
    """
    align_stack()
    numbers = np.empty(WIDTH)
    answer, moved = lane_array(numbers), lane_array(motion)
    lanes = WIDTH if stride == 1 else 1
    near_count = 0
    for begin in range(0, count, max(stride, WIDTH)):
        at = begin // WIDTH * 4
        along = direction[0] * moved[at] + direction[1] * moved[at + 1]
        answer[0] = along + direction[2] * moved[at + 2] - moved[at + 3]
        if lanes_any(answer[0] < limit):
            for lane in range(min(lanes, count - begin)):
                if numbers[lane] < limit:
                    near[near_count] = begin + lane
                    near_count += 1
    return near_count
