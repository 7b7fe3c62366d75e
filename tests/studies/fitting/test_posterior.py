"""Posterior of problems with priors, and the choice of unknowns in the linearised fit."""

from itertools import combinations

import numpy as np
import pytest

from wm_drake.studies.fitting.posterior import Posterior, least_needed_out


def test_spread_is_that_of_the_normal_distribution():
    # the data of the first unknown have the deviation of its prior; the second has no data
    posterior = Posterior(np.zeros(2), np.array([[1.0, 0.0]]), 1)
    assert posterior.spread() == pytest.approx([np.sqrt(0.5), 1.0])
    assert posterior.directions() == pytest.approx([1.0])


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
