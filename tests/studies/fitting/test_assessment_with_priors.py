"""Assessment of problems with priors: the posterior of linear models is known."""

import numpy as np
import pytest
from linear_fits import fit_at

from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import FitProblem, Measurement, Unknown


def test_spread_is_that_of_the_normal_distribution():
    # the data of the first unknown have the deviation of its prior; the second has no data
    fit = fit_at([0.0, 0.0], [[1.0, 0.0]])
    assert fit.remaining == pytest.approx([np.sqrt(0.5), 1.0])
    assert fit.linear.directions() == pytest.approx([1.0])
    assert fit.linear.covariance() == pytest.approx(fit.covariance)
    assert fit.linear.covariance(2.0)[0, 0] == pytest.approx(0.8)


def test_what_is_known_narrows_and_what_is_wished_does_not():
    known = fit_at([0.0, 0.0], [[1.0, 0.0], [0.0, 3.0]], count=1)
    assert known.remaining == pytest.approx([np.sqrt(0.5), np.sqrt(0.1)])
    wished = fit_at([0.0, 0.0], [[1.0, 0.0]], wished=[[0.0, 3.0]])
    assert wished.remaining == pytest.approx([np.sqrt(0.5), 1.0])
    assert wished.problem.evaluated(np.array([[0.0, 1.0]])).exact.tolist() == [[0, 3, 0, 1]]


def test_estimates_are_the_optimum_within_the_bounds():
    unknowns = tuple(
        Unknown(name, 0.0, 10.0, prior=(expected, 2.0))
        for name, expected in (("data", 5.0), ("prior", 2.0), ("bound", 6.0))
    )
    slopes = [[np.sqrt(3.0), 0.0, 0.0]]
    found = fit_at([0.5, 0.0, 2.0], slopes, unknowns).estimates
    assert [e.value for e in found] == [6.0, 2.0, 10.0]
    assert (found[0].lower, found[0].upper) == pytest.approx((6.0 - 1.96, 6.0 + 1.96), abs=1e-3)
    assert (found[1].lower, found[1].upper) == pytest.approx((0.0, 2.0 + 3.92), abs=1e-3)
    assert found[2].at_bound == "upper"
    assert np.isnan(found[2].lower)


def test_unknowns_with_and_without_priors_are_found_together():
    """Measure gain times slope: only the prior of the gain tells both apart.

    The interval of the slope holds its truth as often as it claims, with a gain that is drawn from
    its prior and noise of a deviation that the fit estimates.
    """
    x, rng, hits, widths = np.linspace(0.1, 1.0, 40), np.random.default_rng(3), 0, []
    unknowns = (
        Unknown("slope", 0.5, 5.0, logarithmic=True),
        Unknown("gain", 0.5, 1.5, prior=(1.0, 0.02)),
    )
    for _ in range(200):
        values = 2.0 * rng.normal(1.0, 0.02) * x + 0.01 * rng.standard_normal(x.size)
        data = Measurement("line", values, scale=0.01)
        problem = FitProblem(unknowns, (data,), lambda p: p[:, :1] * p[:, 1:] * x)
        fit = identify(problem, starts=1, screened=2)
        hits += fit["slope"].lower <= 2.0 <= fit["slope"].upper
        widths.append(fit["slope"].upper - fit["slope"].lower)
    assert 0.91 < hits / 200 < 0.985
    assert np.mean(widths) == pytest.approx(2.0 * 1.98 * 2.0 * 0.02, rel=0.05)
