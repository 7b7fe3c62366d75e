"""Posterior of problems with priors."""

import numpy as np
import pytest

from wm_drake.studies.fitting.posterior import Posterior
from wm_drake.studies.fitting.problem import Unknown


def test_spread_is_that_of_the_normal_distribution():
    # the data of the first unknown have the deviation of its prior; the second has no data
    posterior = Posterior(np.zeros(2), np.array([[1.0, 0.0]]), 1)
    assert posterior.spread() == pytest.approx([np.sqrt(0.5), 1.0])
    assert posterior.directions() == pytest.approx([1.0])


def test_estimates_are_the_optimum_within_the_bounds():
    unknowns = tuple(
        Unknown(name, 0.0, 10.0, prior=(expected, 2.0))
        for name, expected in (("data", 5.0), ("prior", 2.0), ("bound", 6.0))
    )
    slopes = np.array([[np.sqrt(3.0), 0.0, 0.0]])
    found = Posterior(np.array([0.5, 0.0, 2.0]), slopes, 1, unknowns).estimates
    assert [e.value for e in found] == [6.0, 2.0, 10.0]
    assert (found[0].lower, found[0].upper) == pytest.approx((6.0 - 1.96, 6.0 + 1.96), abs=1e-3)
    assert (found[1].lower, found[1].upper) == pytest.approx((0.0, 2.0 + 3.92), abs=1e-3)
    assert found[2].at_bound == "upper"
    assert np.isnan(found[2].lower)
