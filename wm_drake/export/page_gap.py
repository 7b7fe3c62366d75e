"""Compiled functions of a page that find the smallest gap between tub and housing.

They do what `wm_drake.model.scene` does with Drake.
"""

from typing import Any

import numpy as np
from numba import cfunc, njit, types

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine, sqrt
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
from wm_drake.export.kernel import OPTIONS, PAIR_SIZE, POINTER, SHAPE_SIZE, numbers_at
from wm_drake.model.outline import lowest_point

MOST_PROJECTIONS = 20000
"""Projections after which the nearest points of two shapes count as found."""
TOUCHING = 1e-7
"""Accuracy of a distance of two shapes. [m]"""


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


def _pair_reader(plan: Any) -> Any:
    """Return the function (c, pair) of both shapes, whether each is round, and a direction."""
    of = plan.of

    @njit(**OPTIONS)
    def pair_at(c, pair):
        begin, constants = of.pairs + PAIR_SIZE * pair, numbers_at(c, 0)
        d = begin + PAIR_SIZE - 3
        rounds = constants[d - 2] > 0.5, constants[d - 1] > 0.5
        moving, fixed = numbers_at(c, begin), numbers_at(c, begin + SHAPE_SIZE)
        return moving, fixed, rounds, (constants[d], constants[d + 1], constants[d + 2])

    return pair_at


def _measure_pair(plan: Any) -> Any:
    """Return the function that measures a pair in a sample; it returns what separates the pair.

    Arguments: v, c; number of the pair; the sample and its number; the direction to begin with.
    """
    at, pair_at = plan.at, _pair_reader(plan)

    @njit(**OPTIONS)
    def measure_pair(v, c, pair, x, row, d):
        moving, fixed, rounds, _ = pair_at(c, pair)
        answer = numbers_at(v, at.answer)
        gap, d, nearest, other = distance_of(pose_of(x), moving, fixed, rounds, d)
        if gap < answer[0]:
            answer[0], answer[1], answer[2] = gap, row, pair
            for k in range(3):
                answer[3 + k], answer[6 + k] = nearest[k], other[k]
        return d

    return measure_pair


def _smallest_of_pair(plan: Any) -> Any:
    """Return the function that finds the smallest gap of a pair, if it is the smallest so far.

    Arguments: v, c; number of the pair; samples and their number; array of bounds.
    """
    at, pair_at, measure_pair = plan.at, _pair_reader(plan), _measure_pair(plan)
    sample = plan.elements.begins.size + plan.elements.begins.rates

    @njit(**OPTIONS)
    def smallest_of_pair(v, c, pair, history, rows, bounds):
        moving, fixed, rounds, d = pair_at(c, pair)
        answer = numbers_at(v, at.answer)
        for row in range(rows):
            bounds[row] = -np.inf
        while True:
            least = 0
            for row in range(rows):
                if bounds[row] < answer[0]:
                    pose = pose_of(numbers_at(history, sample * row))
                    bounds[row] = max(bounds[row], separation(pose, moving, fixed, rounds, d))
                if bounds[row] < bounds[least]:
                    least = row
            if not bounds[least] < answer[0]:
                return
            d = measure_pair(v, c, pair, numbers_at(history, sample * least), least, d)
            bounds[least] = np.inf

    return smallest_of_pair


def gap_finder(plan: Any) -> Any:
    """Return the function that finds the smallest gap of a run, as `Scene.smallest_gap`.

    Arguments: v, c; samples and their number; array of bounds, a number for each sample.
    """
    at, of, count, reach = plan.at, plan.of, plan.count, plan.reach
    sample = plan.elements.begins.size + plan.elements.begins.rates
    distances = of.pairs + PAIR_SIZE * count.pairs
    pair_at, measure_pair = _pair_reader(plan), _measure_pair(plan)
    smallest_of_pair = _smallest_of_pair(plan)

    @njit(**OPTIONS)
    def farthest_of(history, c, rows):
        drawn, farthest, moved = numbers_at(c, of.initial), 0, -1.0
        for row in range(rows):
            x = numbers_at(history, sample * row)
            turned = abs(x[0] - drawn[0]) + abs(x[1] - drawn[1]) + abs(x[2] - drawn[2])
            line = (x[3] - drawn[3], x[4] - drawn[4], x[5] - drawn[5])
            shift = sqrt(dot(line, line)) + turned * reach
            if shift > moved:
                farthest, moved = row, shift
        return farthest, moved

    @cfunc(types.void(POINTER, POINTER, POINTER, types.int32, POINTER), **OPTIONS)
    def wm_find_gap(v, c, history, rows, work):
        at_rest, bounds = numbers_at(c, distances), numbers_at(work, 0)
        answer = numbers_at(v, at.answer)
        answer[0] = np.inf
        if rows == 0 or count.pairs == 0:
            return
        row, shift = farthest_of(history, c, rows)
        first = 0
        for pair in range(count.pairs):
            if at_rest[pair] < at_rest[first]:
                first = pair
        x = numbers_at(history, sample * row)
        measure_pair(v, c, first, x, row, pair_at(c, first)[3])
        smallest_of_pair(v, c, first, history, rows, bounds)
        for pair in range(count.pairs):
            if pair != first and at_rest[pair] - shift < answer[0]:
                smallest_of_pair(v, c, pair, history, rows, bounds)

    return wm_find_gap
