"""Posterior of problems with priors."""

import numpy as np
import pytest

from wm_drake.studies.fitting.posterior import Posterior


def test_spread_is_that_of_the_normal_distribution():
    # the data of the first unknown have the deviation of its prior; the second has no data
    posterior = Posterior(np.zeros(2), np.array([[1.0, 0.0]]), 1)
    assert posterior.spread() == pytest.approx([np.sqrt(0.5), 1.0])
    assert posterior.directions() == pytest.approx([1.0])
