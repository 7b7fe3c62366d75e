"""Searches on problems with a known answer, without a machine."""

import numpy as np
import pytest

from wm_drake.studies.fitting.problem import (
    KINKED,
    FitProblem,
    Measurement,
    ModelValues,
    Unknown,
)
from wm_drake.studies.fitting.search import Search, descended
from wm_drake.studies.fitting.starts import starts_of

TRUTH = np.array([0.8, -0.5, 0.3])


def curved(points):
    """Return nonlinear residuals of a known point; deviations are small beside the prior."""
    offset = points - TRUTH
    return 200.0 * np.column_stack(
        [offset[:, 0], offset[:, 1] + offset[:, 0] ** 2, offset[:, 2] - 0.5 * offset[:, 1] ** 2]
    )


def searched(residuals=curved, bound=3.0, size=3, smooth=None, report=lambda *_: None):
    """Return a search of a problem whose unknowns have the prior 0 +- 1."""
    unknowns = tuple(
        Unknown(f"x{k}", -bound, bound, start=0.0, prior=(0.0, 1.0)) for k in range(size)
    )
    evaluate = lambda points: ModelValues(residuals(points), (smooth or residuals)(points))  # noqa: E731
    data = Measurement("m", np.zeros(residuals(np.zeros((1, size))).shape[1]), errors="known")
    return Search(FitProblem(unknowns, (data,), evaluate, KINKED), report)


def test_known_point_is_end_from_a_distant_start():
    end = descended(searched(), np.array([-2.0, 2.0, -2.0]), 50)
    assert end.point == pytest.approx(TRUTH, abs=1e-3)
    assert end.cost == pytest.approx(np.sqrt(np.sum(TRUTH**2) / 6.0), rel=1e-2)


def test_prior_determines_a_quantity_without_data():
    end = descended(
        searched(lambda points: 50.0 * (points[:, :1] - 1.0)), np.array([0.0, 1.5, -1.0]), 30
    )
    assert end.point == pytest.approx([1.0, 0.0, 0.0], abs=1e-3)


def test_weight_between_data_and_prior_is_that_of_their_deviations():
    # one datum 1 +- 1 and a prior 0 +- 1: the product of the two normal distributions is at 1/2
    end = descended(searched(lambda points: points - 1.0, size=1), np.array([-1.0]), 30)
    assert end.point == pytest.approx([0.5], abs=1e-5)


def test_bounds_are_kept():
    tried = []

    def watched(points):
        tried.append(points)
        return curved(points)

    end = descended(searched(watched, bound=0.6), np.array([-0.5, 0.5, 0.0]), 40)
    assert np.all(np.abs(np.concatenate(tried)) <= 0.6 + 1e-12)
    assert end.point[0] == pytest.approx(0.6, abs=1e-3)


def test_search_avoids_points_without_a_machine():
    def with_a_hole(points):
        values = curved(points)
        values[np.linalg.norm(points - [-0.6, 0.8, -0.8], axis=1) < 0.4] = np.nan
        return values

    end = descended(searched(with_a_hole), np.array([-2.0, 2.0, -2.0]), 60)
    assert end.point == pytest.approx(TRUTH, abs=1e-2)


def test_starts_are_the_expected_point_and_points_that_the_seed_determines():
    starts = list(starts_of(searched(), 5, 4, 24))
    assert not starts[0].any()
    assert np.array_equal(starts[2], list(starts_of(searched(), 5, 3, 24))[2])
    assert not np.array_equal(starts[2], list(starts_of(searched(), 6, 3, 24))[2])
    assert len({tuple(start) for start in starts}) == 4


def test_progress_reports_evaluations_and_a_falling_cost():
    reports = []
    search = searched(report=lambda count, best: reports.append((count, best)))
    end = descended(search, np.zeros(3), 30)
    counts, costs = zip(*reports, strict=True)
    assert list(counts) == sorted(counts)
    assert counts[-1] == end.evaluations
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
    hard, smooth = (lambda points, k=k: kinked(points)[k] for k in (0, 1))
    begin = np.array([-1.5, 1.0])
    end = descended(searched(hard, 6.0, 2, smooth), begin, 60)
    stuck = descended(searched(hard, 6.0, 2), begin, 60)
    assert end.point == pytest.approx([0.3, -4.0], abs=0.1)
    assert end.cost <= stuck.cost + 0.1
