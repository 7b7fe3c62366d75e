"""The search of [B] section 3.1.2 on functions with a known minimum."""

import numpy as np
import pytest

from wm_drake.studies.fitting.grid import grid_search
from wm_drake.studies.fitting.problem import FAILED, FitProblem, Measurement, Unknown

LOWER, UPPER = np.array([0.0, -1.0]), np.array([4.0, 7.0])


def problem_of(cost):
    """Return a problem whose cost at a point (2,) is that of a function, >= 0."""
    unknowns = tuple(Unknown(name, *ends) for name, *ends in zip("xy", LOWER, UPPER, strict=True))
    data = Measurement("cost", np.zeros(1))
    return FitProblem(unknowns, (data,), lambda points: np.array([[cost(x)] for x in points]))


def bowl(best):
    def cost(point):
        evaluated.append(tuple(point))
        return np.sum(((point - best) / (UPPER - LOWER)) ** 2)

    evaluated = []
    return problem_of(cost), evaluated


@pytest.mark.parametrize("best", [(1.3, 2.9), (0.0, -1.0), (3.99, 0.1), (2.0, 3.0)])
def test_minimum_is_found_within_the_last_grid(best):
    bowl_problem, evaluated = bowl(best)
    end, rounds = grid_search(bowl_problem, 1e-4)
    assert rounds[-1].spacing <= 1e-4 < 2.0 * rounds[-1].spacing
    assert np.all(np.abs(rounds[-1].best - best) <= 1e-4 * (UPPER - LOWER))
    assert np.array_equal(bowl_problem.points_at(end.point), rounds[-1].best)
    assert end.evaluations == len(evaluated) == len(set(evaluated))  # no point twice
    assert np.all(np.array(evaluated) >= LOWER)
    assert np.all(np.array(evaluated) <= UPPER)


def test_first_grid_is_the_region_in_25_points_and_the_next_half_as_wide():
    first, second, *_ = grid_search(bowl((1.9, 3.2))[0], 0.01)[1]
    assert len(first.points) == 25
    assert (first.points.min(axis=0).tolist(), first.points.max(axis=0).tolist()) == (
        LOWER.tolist(),
        UPPER.tolist(),
    )
    assert np.ptp(second.points, axis=0) == pytest.approx((UPPER - LOWER) / 2.0)
    assert len(second.points) == 25 - 9  # the inner points of the old grid are known


def valley(best, angle, ratio, noise=0.0):
    """Return a problem as that of envelopes: a sum of two 2-norms, linear in the unknowns.

    Its valley has an angle with the first axis, in units of the region. The distance grows by a
    factor `ratio` less along it than across it. Noise that no point fits makes the bottom round.
    """
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    along, across = np.array([c, s]), np.array([-s, c])

    def cost(point):
        d = (point - best) / (UPPER - LOWER)
        return sum(
            np.sqrt((w * d @ along / ratio) ** 2 + (d @ across) ** 2 + noise**2) for w in (1, 3)
        )

    return problem_of(cost)


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("ratio", [4.0, 20.0])
@pytest.mark.parametrize("angle", [-60.0, -45.0, -20.0, 8.0, 35.0])
def test_diagonal_valley_is_followed_to_its_bottom(angle, ratio, noise):
    """Follow a valley on whose side a grid that is halved in every round stops."""
    best = np.array([1.1, 3.7])
    _, rounds = grid_search(valley(best, angle, ratio, noise), 1e-4)
    assert np.all(np.abs(rounds[-1].best - best) <= 0.01 * (UPPER - LOWER))


def test_each_grid_finds_a_better_point_or_is_halved():
    _, rounds = grid_search(valley(np.array([0.4, 6.0]), -45.0, 10.0), 1e-3)
    values = np.minimum.accumulate([np.min(grid.values, initial=np.inf) for grid in rounds])
    spacings = np.array([grid.spacing for grid in rounds])
    assert spacings[0] == 0.25
    moved = np.diff(values) < 0.0
    assert moved.any()
    for was_better, before, after in zip(moved, spacings[1:-1], spacings[2:], strict=False):
        assert after == before if was_better else after == 0.5 * before
    assert spacings[-1] <= 1e-3
    assert values[-1] == values[-2]


def test_rule_of_the_paper_halves_each_grid_and_ends_at_a_small_fall():
    """End beside the bottom of a diagonal valley, which the search that moves on reaches."""
    best, least = np.array([1.9, 3.4]), 0.002
    problem = valley(best, -45.0, 10.0)
    end, rounds = grid_search(problem, 0.0, least_fall=least)
    assert [grid.spacing for grid in rounds] == [0.25 * 0.5**k for k in range(len(rounds))]
    falls = -np.diff(np.minimum.accumulate([np.min(grid.values) for grid in rounds]))
    assert np.all(falls[:-1] >= least)
    assert falls[-1] < least
    assert end.cost > 10.0 * grid_search(problem, 1e-3)[0].cost


def test_rule_of_the_paper_ends_where_every_point_diverges():
    assert len(grid_search(problem_of(lambda point: np.nan), 0.0, least_fall=0.1)[1]) <= 2


def test_points_that_diverge_are_not_a_minimum():
    partly = problem_of(lambda point: np.nan if point[0] < 1.0 else point @ point)
    end, _ = grid_search(partly, 1e-3)
    assert partly.points_at(end.point) == pytest.approx([1.0, 0.0], abs=0.01)


def test_search_ends_where_every_point_diverges():
    end, rounds = grid_search(problem_of(lambda point: np.nan), 0.05)
    assert end.cost == FAILED
    assert rounds[-1].spacing <= 0.05
