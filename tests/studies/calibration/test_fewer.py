"""Fits with fewer free quantities: the choice in the linearised fit, and the counts."""

from itertools import combinations

import numpy as np
import pytest

from wm_drake.errors import InputError
from wm_drake.studies.calibration.fewer import check_counts, least_needed_out


def cost_without(slopes, offset, kept):
    part = slopes[:, kept]
    x = np.linalg.solve(part.T @ part + np.eye(len(kept)), -part.T @ offset)
    return 0.5 * np.sum((offset + part @ x) ** 2) + 0.5 * np.sum(x**2), x


def test_quantity_whose_loss_costs_least_goes_first():
    generator = np.random.default_rng(4)
    slopes, offset = generator.normal(size=(30, 6)), 3.0 * generator.normal(size=30)
    _, optimum = cost_without(slopes, offset, range(6))
    kept, x = least_needed_out(slopes, optimum, 5)
    costs = {five: cost_without(slopes, offset, five) for five in combinations(range(6), 5)}
    best = min(costs, key=lambda five: costs[five][0])
    assert tuple(kept) == best
    assert x == pytest.approx(costs[best][1], rel=1e-9)


def test_one_after_the_other_is_what_several_at_once_are():
    generator = np.random.default_rng(5)
    slopes, offset = generator.normal(size=(30, 6)), generator.normal(size=30)
    _, optimum = cost_without(slopes, offset, range(6))
    kept, x = least_needed_out(slopes, optimum, 2)
    assert x == pytest.approx(cost_without(slopes, offset, kept)[1], rel=1e-9)


@pytest.mark.parametrize("counts", [[3], [0], [2, 2], [1, 2], [-1]])
def test_counts_must_fall_from_the_number_of_free_quantities(counts):
    with pytest.raises(InputError, match="falling numbers from 2 to 1; 3 quantities are free"):
        check_counts(counts, 3)


def test_no_count_and_falling_counts_are_allowed():
    check_counts([], 3)
    check_counts([2, 1], 3)
