"""The search of [B] section 3.1.2 on functions with a known minimum."""

import numpy as np
import pytest

from wm_drake.studies.gasket_damping.grid_search import bounded_search, grid_search

LOWER, UPPER = np.array([0.0, -1.0]), np.array([4.0, 7.0])


def bowl(best):
    def objective(points):
        asked.extend(tuple(point) for point in points)
        return [float(np.sum(((point - best) / (UPPER - LOWER)) ** 2)) for point in points]

    asked = []
    return objective, asked


@pytest.mark.parametrize("best", [(1.3, 2.9), (0.0, -1.0), (3.99, 0.1), (2.0, 3.0)])
def test_minimum_is_found_within_the_last_grid(best):
    objective, asked = bowl(best)
    found = grid_search(objective, LOWER, UPPER, 1e-6)
    spacing = (UPPER - LOWER) / 4.0 / 2.0 ** (len(found.rounds) - 1)
    assert np.all(np.abs(found.best - best) <= spacing)
    assert found.evaluations == len(asked) == len(set(asked))  # no point twice
    assert np.all(np.array(asked) >= LOWER)
    assert np.all(np.array(asked) <= UPPER)


def test_first_grid_is_the_region_in_25_points_and_the_next_half_as_wide():
    objective, _ = bowl((1.9, 3.2))
    first, second, *_ = grid_search(objective, LOWER, UPPER, 1e-9).rounds
    assert len(first.points) == 25
    assert (first.points.min(axis=0).tolist(), first.points.max(axis=0).tolist()) == (
        LOWER.tolist(),
        UPPER.tolist(),
    )
    assert np.ptp(second.points, axis=0) == pytest.approx((UPPER - LOWER) / 2.0)
    assert len(second.points) == 25 - 9  # the inner points of the old grid are known


def test_search_ends_when_the_gain_is_small():
    objective, _ = bowl((1.37, 2.77))
    values = [grid.best_value for grid in grid_search(objective, LOWER, UPPER, 1e-4).rounds]
    gains = -np.diff(values)
    assert gains[-1] < 1e-4
    assert np.all(gains[:-1] >= 1e-4)


def test_points_that_diverge_are_not_a_minimum():
    def objective(points):
        return [np.inf if point[0] < 1.0 else float(point @ point) for point in points]

    assert grid_search(objective, LOWER, UPPER, 1e-3).best == pytest.approx([1.0, 0.0], abs=0.3)


def test_both_searches_agree():
    objective, _ = bowl((1.3, 2.9))
    assert bounded_search(objective, LOWER, UPPER, 1e-8).best == pytest.approx([1.3, 2.9], abs=0.02)
