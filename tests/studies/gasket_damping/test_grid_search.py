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
    found = grid_search(objective, LOWER, UPPER, 1e-4)
    assert found.rounds[-1].spacing <= 1e-4 < 2.0 * found.rounds[-1].spacing
    assert np.all(np.abs(found.best - best) <= 1e-4 * (UPPER - LOWER))
    assert found.evaluations == len(asked) == len(set(asked))  # no point twice
    assert np.all(np.array(asked) >= LOWER)
    assert np.all(np.array(asked) <= UPPER)


def test_first_grid_is_the_region_in_25_points_and_the_next_half_as_wide():
    objective, _ = bowl((1.9, 3.2))
    first, second, *_ = grid_search(objective, LOWER, UPPER, 0.01).rounds
    assert len(first.points) == 25
    assert (first.points.min(axis=0).tolist(), first.points.max(axis=0).tolist()) == (
        LOWER.tolist(),
        UPPER.tolist(),
    )
    assert np.ptp(second.points, axis=0) == pytest.approx((UPPER - LOWER) / 2.0)
    assert len(second.points) == 25 - 9  # the inner points of the old grid are known


def valley(best, angle, ratio, noise=0.0):
    """Return an objective as that of envelopes: a sum of two 2-norms, linear in the unknowns.

    Its valley has an angle with the first axis, in units of the region. The distance grows by a
    factor `ratio` less along it than across it. Noise that no point fits makes the bottom round.
    """
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    along, across = np.array([c, s]), np.array([-s, c])

    def objective(points):
        steps = [(point - best) / (UPPER - LOWER) for point in points]
        return [
            sum(
                np.sqrt((w * d @ along / ratio) ** 2 + (d @ across) ** 2 + noise**2) for w in (1, 3)
            )
            for d in steps
        ]

    return objective


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("ratio", [4.0, 20.0])
@pytest.mark.parametrize("angle", [-60.0, -45.0, -20.0, 8.0, 35.0])
def test_diagonal_valley_is_followed_to_its_bottom(angle, ratio, noise):
    """Follow a valley on whose side a grid that is halved in every round stops."""
    best = np.array([1.1, 3.7])
    found = grid_search(valley(best, angle, ratio, noise), LOWER, UPPER, 1e-4)
    assert np.all(np.abs(found.best - best) <= 0.01 * (UPPER - LOWER))


def test_each_grid_finds_a_better_point_or_is_halved():
    rounds = grid_search(valley(np.array([0.4, 6.0]), -45.0, 10.0), LOWER, UPPER, 1e-3).rounds
    values = [grid.best_value for grid in rounds]
    spacings = np.array([grid.spacing for grid in rounds])
    assert spacings[0] == 0.25
    moved = np.diff(values) < 0.0
    assert moved.any()
    for was_better, before, after in zip(moved, spacings[1:-1], spacings[2:], strict=False):
        assert after == before if was_better else after == 0.5 * before
    assert spacings[-1] <= 1e-3
    assert values[-1] == values[-2]


def test_points_that_diverge_are_not_a_minimum():
    def objective(points):
        return [np.inf if point[0] < 1.0 else float(point @ point) for point in points]

    assert grid_search(objective, LOWER, UPPER, 1e-3).best == pytest.approx([1.0, 0.0], abs=0.01)


def test_search_ends_where_every_point_diverges():
    found = grid_search(lambda points: [np.inf] * len(points), LOWER, UPPER, 0.05)
    assert found.value == np.inf
    assert found.rounds[-1].spacing <= 0.05


def test_both_searches_agree():
    objective, _ = bowl((1.3, 2.9))
    assert bounded_search(objective, LOWER, UPPER, 1e-8).best == pytest.approx([1.3, 2.9], abs=0.02)
