"""Compiled functions of a page that find the smallest gap between tub and housing.

They do what `wm_drake.model.scene` does, with the same distances of shapes that are apart.
"""

from typing import Any

import numpy as np
from numba import cfunc, njit, types

from wm_drake.compiler.elementary import sqrt
from wm_drake.compiler.vectors import dot
from wm_drake.export.kernel import OPTIONS, PAIR_SIZE, POINTER, SHAPE_SIZE, numbers_at
from wm_drake.model.outline import distance_of, pose_of, separation


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
