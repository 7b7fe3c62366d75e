"""Distances of cylinders and boxes that are fixed to a moving body, and their lower bounds."""

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import lanes_to_rows, rows_to_lanes, sine_cosine, sqrt, where
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.vectors import (
    add,
    cross,
    dot,
    rotate,
    rotate_back,
    rotation_from_rpy,
    scale,
    subtract,
)

BLOCK = 16
"""Number of samples whose bounds of distances are kept as one."""

MOST_PROJECTIONS = 20000
"""Projections after which the nearest points of two shapes count as found."""
TOUCHING = 1e-7
"""Accuracy of a distance of two shapes. [m]"""


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


@law
def nearest_in(shape, is_round, q):
    """Return the point of a shape nearest a point, both in the frame of its body. [m]

    Args:
        shape, is_round: As for `lowest_point`.
        q: The point.
    """
    x, y = (shape[3], shape[4], shape[5]), (shape[6], shape[7], shape[8])
    z, centre = (shape[9], shape[10], shape[11]), (shape[0], shape[1], shape[2])
    r = subtract(q, centre)
    a, b, along = dot(x, r), dot(y, r), dot(z, r)
    if is_round:
        away = sqrt(a * a + b * b)
        inside = shape[12] / away if away > shape[12] else 1.0
        a, b = a * inside, b * inside
    else:
        a, b = min(max(a, -shape[12]), shape[12]), min(max(b, -shape[13]), shape[13])
    along = min(max(along, -shape[14]), shape[14])
    return add(centre, add(scale(a, x), add(scale(b, y), scale(along, z))))


@law
def separation(motion, moving, fixed, rounds, d):
    """Return the gap of two shapes along a direction: a lower bound of their distance. [m]

    Args:
        motion: Rotation and position of the body of the first shape.
        moving, fixed: Numbers of the shapes.
        rounds: Whether each is a cylinder.
        d: Unit vector in W along which the first moves away from the second.
    """
    bound = lowest_point(rotate_back(motion[0], d), moving, rounds[0]) + dot(motion[1], d)
    return bound + lowest_point((-d[0], -d[1], -d[2]), fixed, rounds[1])


@law
def distance_of(motion, moving, fixed, rounds, d):
    """Return the distance of two shapes, the direction that separates them, and nearest points.

    A point is projected onto one shape and the other in turn. If the shapes overlap, the distance
    is the largest `separation` near the last direction: minus the depth of the overlap.

    Args:
        motion, moving, fixed, rounds: As for `separation`.
        d: Direction in which the search for shapes that overlap begins.
    """
    x = add(motion[1], rotate(motion[0], (moving[0], moving[1], moving[2])))
    y = x
    gap = 0.0
    for k in range(MOST_PROJECTIONS):
        y = nearest_in(fixed, rounds[1], x)
        q = nearest_in(moving, rounds[0], rotate_back(motion[0], subtract(y, motion[1])))
        x = add(motion[1], rotate(motion[0], q))
        line = subtract(x, y)
        gap = sqrt(dot(line, line))
        if gap < TOUCHING:
            break
        if k % 8 == 7:
            d = scale(1.0 / gap, line)
            if gap - separation(motion, moving, fixed, rounds, d) < TOUCHING:
                return gap, d, x, y
    best = separation(motion, moving, fixed, rounds, d)
    if gap >= TOUCHING:  # nearly: the bound is the safe side
        return best, d, x, y
    turn = 0.3
    while turn > 1e-6:
        improved = False
        side = (1.0, 0.0, 0.0) if abs(d[0]) < 0.7 else (0.0, 1.0, 0.0)
        u = cross(d, side)
        u = scale(1.0 / sqrt(dot(u, u)), u)
        w = cross(d, u)
        for k in range(16):
            s, c = sine_cosine(0.39269908169872414 * k)
            trial = add(d, scale(turn, add(scale(c, u), scale(s, w))))
            trial = scale(1.0 / sqrt(dot(trial, trial)), trial)
            bound = separation(motion, moving, fixed, rounds, trial)
            if bound > best:
                best, d, improved = bound, trial, True
        if not improved:
            turn = 0.5 * turn
    return best, d, x, y


@law
def pose_of(x):
    """Return rotation and position of the tub from a sample."""
    return rotation_from_rpy(x[0], x[1], x[2]), (x[3], x[4], x[5])


@long_running
def nearest_points(pose, moving, fixed, are_round, answer):
    """Find the nearest points of two shapes at a pose of the body that carries the first.

    Args:
        pose: Roll, pitch, yaw, x, y, z. (6,) [rad, m]
        moving, fixed, are_round: As for `raise_bounds`.
        answer: Written: distance; direction that separates them; points of both shapes. (10,) [m]
    """
    up = (0.0, 0.0, 1.0)
    answer[0], away, first, second = distance_of(pose_of(pose), moving, fixed, are_round, up)
    for k in range(3):
        answer[1 + k], answer[4 + k], answer[7 + k] = away[k], first[k], second[k]


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
def measure_shifts(samples, size, good, references, farthest):
    """Compute how far the tub moves from reference poses in `lanes.WIDTH` runs side by side.

    All arrays are flat arrays of lanes.

    Args:
        samples: Samples, one after the other, each with the pose first: roll, pitch, yaw, x, y, z.
            [rad, m]
        size: Number of the numbers in each sample.
        good: Number of samples of each run that count, as a float.
        references: Reference pose of each run, and the largest distance of a point of the tub group
            from To. (7,)
        farthest: The first sample with the largest displacement of any point, and this displacement
            or more [m], written. (2,)
    """
    align_stack()
    x, count, reference = lane_array(samples), lane_array(good), lane_array(references)
    answer = lane_array(farthest)
    zero, reach = 0.0 * count[0], reference[6]
    answer[0], answer[1] = zero, zero - 1.0
    for row in range(len(samples) // (size * WIDTH)):
        k = row * size
        turned = abs(x[k] - reference[0]) + abs(x[k + 1] - reference[1])
        turned = turned + abs(x[k + 2] - reference[2])
        moved = (x[k + 3] - reference[3], x[k + 4] - reference[4], x[k + 5] - reference[5])
        displacement = sqrt(dot(moved, moved)) + turned * reach
        is_farther = (count[0] > row) & (displacement > answer[1])
        answer[0] = where(is_farther, zero + row, answer[0])
        answer[1] = where(is_farther, displacement, answer[1])


@long_running
def find_lowest_bounds(samples, size, good, directions, shapes, are_round, lowest):
    """Find the lowest bounds of distances in blocks of the samples of runs side by side.

    Args:
        samples, size, good: As for `measure_shifts`.
        directions: Flat array of lanes: for each pair of shapes the unit vector in W along which
            the first shape moves away, and the smallest coordinate of the second shape in the
            opposite direction.
        shapes, are_round: The first shape of each pair, see `lowest_point`. (pairs, 15), (pairs,)
        lowest: Flat array of lanes: for each `BLOCK` samples the lowest bound of each pair; inf
            without samples that count. Written. [m]
    """
    align_stack()
    x, count, along = lane_array(samples), lane_array(good), lane_array(directions)
    least, pairs = lane_array(lowest), len(shapes)
    zero, rows = 0.0 * count[0], len(samples) // (size * WIDTH)
    for begin in range(0, rows, BLOCK):
        first = begin // BLOCK * pairs
        for pair in range(pairs):
            least[first + pair] = zero + np.inf
        for row in range(begin, min(begin + BLOCK, rows)):
            k, is_good = row * size, count[0] > row
            rotation = rotation_from_rpy(x[k], x[k + 1], x[k + 2])
            position = (x[k + 3], x[k + 4], x[k + 5])
            for pair in range(pairs):
                at = 4 * pair
                d = (along[at], along[at + 1], along[at + 2])
                lowest_of_shape = lowest_point(
                    rotate_back(rotation, d), shapes[pair], are_round[pair]
                )
                bound = dot(position, d) + lowest_of_shape + along[at + 3]
                is_lower = is_good & (bound < least[first + pair])
                least[first + pair] = where(is_lower, bound, least[first + pair])
