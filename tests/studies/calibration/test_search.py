"""Searches on problems with a known answer, without a machine."""

import numpy as np
import pytest

from wm_drake.studies.calibration.search import (
    METHODS,
    SearchProblem,
    evolution_search,
    least_squares_search,
)

TRUTH = np.array([0.8, -0.5, 0.3])


def curved(points):
    """Return nonlinear residuals of a known point; deviations are small beside the prior."""
    offset = points - TRUTH
    return 200.0 * np.column_stack(
        [offset[:, 0], offset[:, 1] + offset[:, 0] ** 2, offset[:, 2] - 0.5 * offset[:, 1] ** 2]
    )


def problem(residuals=curved, bound=3.0, size=3):
    return SearchProblem(
        lambda points: (residuals(points), residuals(points)),
        np.full(size, -bound),
        np.full(size, bound),
        np.zeros(size),
    )


@pytest.mark.parametrize("method", METHODS)
def test_known_point_is_found_from_a_distant_start(method):
    found = METHODS[method](problem(), np.array([-2.0, 2.0, -2.0]), 50, 3)
    assert found.point == pytest.approx(TRUTH, abs=1e-3)
    assert found.cost == pytest.approx(0.5 * np.sum(TRUTH**2), rel=1e-2)


def test_prior_determines_a_quantity_without_data():
    found = least_squares_search(
        problem(lambda points: 50.0 * (points[:, :1] - 1.0)), np.array([0.0, 1.5, -1.0]), 30
    )
    assert found.point == pytest.approx([1.0, 0.0, 0.0], abs=1e-3)


def test_weight_between_data_and_prior_is_that_of_their_deviations():
    # one datum 1 +- 1 and a prior 0 +- 1: the product of the two normal distributions is at 1/2
    found = least_squares_search(problem(lambda points: points - 1.0, size=1), np.array([-1.0]), 30)
    assert found.point == pytest.approx([0.5], abs=1e-5)


@pytest.mark.parametrize("search", METHODS.values())
def test_bounds_are_kept(search):
    tried = []

    def watched(points):
        tried.append(points)
        return curved(points)

    found = search(problem(watched, bound=0.6), np.array([-0.5, 0.5, 0.0]), 40, 1)
    assert np.all(np.abs(np.concatenate(tried)) <= 0.6 + 1e-12)
    assert found.point[0] == pytest.approx(0.6, abs=1e-3)


def test_search_avoids_points_without_a_machine():
    def with_a_hole(points):
        values = curved(points)
        values[np.linalg.norm(points - [-0.6, 0.8, -0.8], axis=1) < 0.4] = np.nan
        return values

    found = least_squares_search(problem(with_a_hole), np.array([-2.0, 2.0, -2.0]), 60)
    assert found.point == pytest.approx(TRUTH, abs=1e-2)


def test_evolution_with_one_seed_is_reproducible():
    first, again, other = (evolution_search(problem(), np.zeros(3), 20, seed) for seed in (7, 7, 8))
    assert np.array_equal(first.point, again.point)
    assert not np.array_equal(first.point, other.point)


def test_evolution_follows_a_kink_at_which_least_squares_stops():
    def kinked(points):
        x, y = points.T
        return np.column_stack([100.0 * np.abs(x - 2.0 * y), 3.0 * (x - 1.5)])

    # along x = 2 y the cost is 4.5 (x - 1.5)^2 + x^2 / 2 + x^2 / 8
    lowest = 13.5 / (9.0 + 1.25)
    found = evolution_search(problem(kinked, size=2), np.zeros(2), 100, 0)
    assert found.point == pytest.approx([lowest, lowest / 2.0], abs=0.01)
    stopped = least_squares_search(problem(kinked, size=2), np.zeros(2), 60)
    assert stopped.cost > 2.0 * found.cost


def test_hops_leave_a_local_minimum():
    def rippled(points):
        x = points[:, :1]
        values = 10.0 * (x - 0.5) + 8.0 * np.sin(9.0 * x)
        return values, values

    def search(method):
        bounds = np.full(1, -3.0), np.full(1, 3.0)
        return METHODS[method](
            SearchProblem(rippled, *bounds, np.zeros(1)), np.array([-2.0]), 12, 0
        )

    assert search("least-squares").cost > 2.0
    assert search("basin-hopping").cost < 0.5


def test_starts_are_the_expected_point_and_points_that_the_seed_determines():
    starts = [problem().start(number, 5) for number in range(4)]
    assert not starts[0].any()
    assert np.array_equal(starts[2], problem().start(2, 5))
    assert not np.array_equal(starts[2], problem().start(2, 6))
    assert len({tuple(start) for start in starts}) == 4


def test_progress_reports_evaluations_and_a_falling_cost():
    told = []
    watched = SearchProblem(
        lambda points: (curved(points), curved(points)),
        np.full(3, -3.0),
        np.full(3, 3.0),
        np.zeros(3),
        lambda count, best: told.append((count, best)),
    )
    found = least_squares_search(watched, np.zeros(3), 30)
    counts, costs = zip(*told, strict=True)
    assert list(counts) == sorted(counts)
    assert counts[-1] == found.evaluations
    assert list(costs) == sorted(costs, reverse=True)


def kinked(points):
    """Return the larger of two peaks, like an amplitude, and their power mean of order 20."""
    x, y = points.T
    peaks = np.stack([np.exp(0.5 + x + 0.2 * y), np.exp(0.5 - x + 0.2 * y)])
    hard, smooth = peaks.max(axis=0), np.mean(peaks**20, axis=0) ** (1 / 20)
    other = np.exp(x - 0.3)
    return 50.0 * np.log(np.stack([hard, other], axis=1)), 50.0 * np.log(
        np.stack([smooth, other], axis=1)
    )


def test_slopes_of_smooth_residuals_pass_a_kink():
    wide = np.full(2, 6.0)
    found = least_squares_search(
        SearchProblem(kinked, -wide, wide, 0.0 * wide), np.array([-1.5, 1.0]), 60
    )
    stuck = least_squares_search(
        SearchProblem(lambda p: (kinked(p)[0],) * 2, -wide, wide, 0.0 * wide),
        np.array([-1.5, 1.0]),
        60,
    )
    assert found.point == pytest.approx([0.3, -4.0], abs=0.1)
    assert found.cost <= stuck.cost + 0.1
