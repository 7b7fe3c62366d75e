"""Test linear equations in compiled functions against numpy."""

import numpy as np
import pytest

from wm_drake.compiler.matrices import solve_least


@pytest.mark.parametrize("columns", [1, 3, 6, 9])
@pytest.mark.parametrize("is_repeated", [False, True])
def test_least_squares_have_the_smallest_solution(columns, is_repeated):
    rng = np.random.default_rng(columns)
    pulls, force = rng.normal(size=(6, columns)), rng.normal(size=6)
    if is_repeated:
        pulls = np.hstack([pulls, pulls[:, :1]])
    products, solution = (pulls @ pulls.T).ravel(), force.copy()
    solve_least(products, solution, 6, np.empty(36))
    expected = np.linalg.lstsq(pulls, force, rcond=1e-6)[0]
    np.testing.assert_allclose(pulls.T @ solution, expected, rtol=1e-9, atol=1e-12)
