"""Problems of every kind: coordinates, restriction to some unknowns, costs."""

import numpy as np
import pytest

from wm_drake.studies.fitting.problem import FAILED, FitProblem, Measurement, Unknown

PLAIN = (
    Unknown("a", -1.0, 3.0, start=0.5),
    Unknown("b", 0.1, 10.0, logarithmic=True),
    Unknown("c", 0.0, 2.0),
)
WITH_PRIORS = tuple(Unknown(f"x{k}", -4.0, 8.0, start=0.0, prior=(1.0, 2.0)) for k in range(3))
TARGET = np.array([1.0, 2.0, 0.5, 1.5])


def model(points):
    a, b, c = np.asarray(points).T
    return np.stack([a, b, c, a + b * c], axis=1)


PROBLEMS = {
    "least squares": FitProblem(PLAIN, (Measurement("m", TARGET),), model),
    "priors": FitProblem(WITH_PRIORS, (Measurement("m", TARGET, errors="known"),), model),
}


@pytest.fixture(params=PROBLEMS)
def problem(request):
    return PROBLEMS[request.param]


def test_coordinates_and_points_go_both_ways_and_keep_the_bounds(problem):
    points = np.random.default_rng(1).uniform(0.2, 1.9, (5, 3))
    coordinates = problem.coordinates_of(points)
    assert problem.points_at(coordinates) == pytest.approx(points, rel=1e-12)
    assert np.all((problem.lower < coordinates) & (coordinates < problem.upper))
    for side in ("lower", "upper"):
        ends = [getattr(unknown, side) for unknown in problem.unknowns]
        assert problem.points_at(getattr(problem, side)) == pytest.approx(ends, rel=1e-12)


def test_coordinates_go_from_0_to_1_or_count_deviations_of_the_prior():
    assert PROBLEMS["least squares"].lower.tolist() == [0.0] * 3
    assert PROBLEMS["least squares"].upper.tolist() == [1.0] * 3
    assert PROBLEMS["least squares"].start == pytest.approx([0.375, 0.5, 0.5])
    assert PROBLEMS["priors"].lower.tolist() == [-2.5] * 3
    assert PROBLEMS["priors"].start.tolist() == [-0.5] * 3


@pytest.mark.parametrize("free", [[0], [1, 2], []])
def test_a_restricted_problem_is_the_whole_one_with_the_others_held(problem, free):
    held = problem.coordinates_of(np.array([0.7, 1.3, 0.4]))
    part = problem.restricted(free, held)
    moved = np.random.default_rng(2).uniform(0.1, 0.3, (4, len(free)))
    whole = np.tile(held, (4, 1))
    whole[:, free] = moved
    assert part.residuals(moved) == pytest.approx(problem.residuals(whole), rel=1e-12)
    assert [unknown.name for unknown in part.unknowns] == [problem.unknowns[k].name for k in free]
    assert np.array_equal(part.upper, problem.upper[free])


def test_costs_are_root_mean_squares_with_the_distances_from_expected_values():
    point = np.array([[0.3, 0.6, 0.2]])
    for name, problem in PROBLEMS.items():
        rows = problem.residuals(point)[0]
        if name == "priors":
            rows = np.concatenate([rows, point[0]])
        cost = problem.costs_of(problem.evaluated(point).exact)[0]
        assert cost == pytest.approx(np.sqrt(np.mean(rows**2)))


def test_a_model_that_fails_costs_more_than_any_other_and_has_no_slope():
    problem = FitProblem(PLAIN, (Measurement("m", TARGET),), lambda x: np.full((len(x), 4), np.nan))
    rows = problem.evaluated(np.full((1, 3), 0.5))
    assert problem.costs_of(rows.exact)[0] == FAILED * TARGET.max()
    assert np.isnan(rows.smooth).all()
