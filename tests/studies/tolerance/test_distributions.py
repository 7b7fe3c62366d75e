"""Distributions, samples, subset simulation, Sobol indices and shares: closed forms and oracles."""

import math
import warnings

import numpy as np
import pytest
from scipy import stats

from wm_drake.studies.tolerance.distributions import (
    LARGEST_SCORE,
    Joint,
    base_samples,
    lognormal,
    normal,
    triangular,
    uniform,
)
from wm_drake.studies.tolerance.rare import subset_simulation
from wm_drake.studies.tolerance.sensitivity import exchanged, sobol_indices
from wm_drake.studies.tolerance.shares import percentile_of, share_of


@pytest.mark.parametrize(
    ("marginal", "mean", "deviation"),
    [
        (normal(9.0, 0.5), 9.0, 0.5),
        (lognormal(9.0, 2.0), 9.0, 2.0),
        (uniform(2.0, 5.0), 3.5, 3.0 / math.sqrt(12.0)),
        (triangular(0.0, 3.0, 3.0), 2.0, 3.0 / math.sqrt(18.0)),
        # two deviations each side: variance 1 - 4 phi(2) / (2 Phi(2) - 1)
        (normal(9.0, 0.5, 8.0, 10.0), 9.0, 0.5 * math.sqrt(1.0 - 4.0 * 0.05399097 / 0.9544997)),
    ],
    ids=["normal", "lognormal", "uniform", "triangular", "truncated"],
)
def test_samples_have_mean_and_deviation(marginal, mean, deviation):
    values = marginal.values(base_samples(1, 1 << 14, 3)[0][:, 0])
    assert np.mean(values) == pytest.approx(mean, rel=1e-3)
    assert np.std(values) == pytest.approx(deviation, rel=5e-3)


def test_truncated_lognormal_keeps_its_ends():
    low, high = lognormal(9.0, 2.0, 7.0, 12.0).values(np.array([-LARGEST_SCORE, LARGEST_SCORE]))
    assert (low, high) == pytest.approx((7.0, 12.0), rel=1e-9)


def test_doubling_the_samples_keeps_the_old_ones():
    few, many = base_samples(5, 64, 7), base_samples(5, 128, 7)
    for old, new in zip(few, many, strict=True):
        assert np.array_equal(old, new[:64])
    assert not np.array_equal(few[0], base_samples(5, 64, 8)[0])


def test_correlated_normals_have_their_covariance():
    matrix = np.array([[1.0, 0.7, 0.0], [0.7, 1.0, -0.3], [0.0, -0.3, 1.0]])
    joint = Joint(
        (normal(1.0, 2.0), normal(0.0, 1.0), normal(5.0, 0.1)), np.linalg.cholesky(matrix)
    )
    values = joint.values(base_samples(3, 1 << 14, 0)[0])
    assert np.corrcoef(values.T) == pytest.approx(matrix, abs=5e-3)
    assert np.std(values, axis=0) == pytest.approx([2.0, 1.0, 0.1], rel=5e-3)


@pytest.mark.parametrize(("beta", "size"), [(2.5, 12), (3.5, 6), (4.5, 12)])
def test_subset_simulation_of_a_linear_limit(beta, size):
    # g = beta - sum(z) / sqrt(n) fails with probability Phi(-beta) exactly
    exact = stats.norm.cdf(-beta)
    found = [
        subset_simulation(lambda z: beta - z.sum(axis=1) / math.sqrt(size), size, seed=seed)
        for seed in range(100)
    ]
    estimates = np.array([event.probability for event in found])
    error = np.std(estimates) / math.sqrt(len(found))
    assert np.mean(estimates) == pytest.approx(exact, abs=4.0 * error)
    # the reported deviation is that of repetitions, and 95 % intervals contain the truth
    assert np.mean([e.deviation for e in found]) == pytest.approx(
        np.std(estimates) / exact, rel=0.3
    )
    assert np.mean([e.lower <= exact <= e.upper for e in found]) >= 0.9
    assert np.mean(estimates) > 0.5 * exact


def test_subset_simulation_agrees_with_a_million_samples():
    # two failure regions of different shape: none is found by chance alone
    def limit(z):
        return np.minimum(3.0 - z[:, 0], 4.0 - np.hypot(z[:, 1], z[:, 2]))

    scores = np.random.default_rng(1).standard_normal((1_000_000, 3))
    crude = share_of(limit(scores) <= 0.0)
    event = subset_simulation(limit, 3, samples=4000, seed=2)
    assert event.lower < crude.upper
    assert crude.lower < event.upper
    assert event.evaluations < 20_000


def test_subset_simulation_of_what_never_fails():
    event = subset_simulation(lambda z: 100.0 + z[:, 0], 2, samples=100)
    assert event.probability == 0.0
    # only the 100 samples of the first level are independent: rule of three
    assert event.upper == pytest.approx(1.0 - 0.05 ** (1 / 100))
    assert event.upper == pytest.approx(3.0 / 100, rel=0.02)
    assert 90.0 < event.smallest < event.thresholds[-1]


def test_failed_runs_count_as_failure():
    event = subset_simulation(lambda z: np.where(z[:, 0] > 1.0, np.nan, 1.0), 2, samples=2000)
    assert event.lower < stats.norm.cdf(-1.0) < event.upper


def ishigami(x):
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def g_function(x, a=(0.0, 1.0, 4.5, 9.0)):
    return np.prod([(np.abs(4.0 * x[:, i] - 2.0) + k) / (1.0 + k) for i, k in enumerate(a)], axis=0)


def indices_of(function, marginal, size, count=2048):
    joint = Joint((marginal,) * size)
    a, b = base_samples(size, count, 11)
    at_a, others = function(joint.values(a)), function(joint.values(exchanged(a, b)))
    return at_a, others, sobol_indices(at_a, others)


def test_ishigami_has_its_known_indices():
    _, _, found = indices_of(ishigami, uniform(-math.pi, math.pi), 3)
    assert found["first"] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.03)
    assert found["total"] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.03)
    total, low, high = [0.5576, 0.4424, 0.2437], found["total_lower"], found["total_upper"]
    assert np.all((low < total) & (total < high) & (high - low < 0.2))


def test_g_function_has_its_known_indices():
    # V_i = (1/3) / (1 + a_i)^2, V = prod(1 + V_i) - 1
    parts = np.array([1.0 / 3.0 / (1.0 + a) ** 2 for a in (0.0, 1.0, 4.5, 9.0)])
    variance = np.prod(1.0 + parts) - 1.0
    total = parts * np.prod(1.0 + parts) / (1.0 + parts) / variance
    _, _, found = indices_of(g_function, uniform(0.0, 1.0), 4, 4096)
    assert found["first"] == pytest.approx(parts / variance, abs=0.02)
    assert found["total"] == pytest.approx(total, abs=0.02)


def test_indices_agree_with_salib():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sobol = pytest.importorskip("SALib.analyze.sobol")
    at_a, others, found = indices_of(ishigami, uniform(-math.pi, math.pi), 3)
    parts = others.reshape(4, -1)
    # rows of SALib: A, then A with each column of B, then B
    rows = np.concatenate([at_a[None], parts[1:], parts[:1]]).T.ravel()
    problem = {"num_vars": 3, "names": list("abc"), "bounds": [[0, 1]] * 3}
    theirs = sobol.analyze(problem, rows, calc_second_order=False, seed=1, num_resamples=2)
    # SALib divides by the variance of A and B, and shifts by the mean of all
    assert found["first"] == pytest.approx(theirs["S1"], abs=0.02)
    assert found["total"] == pytest.approx(theirs["ST"], abs=0.02)


def test_indices_of_a_failed_run_or_a_constant_are_refused():
    values, others = np.arange(8.0), np.arange(24.0)
    assert sobol_indices(np.where(values == 3.0, np.nan, values), others) is None
    assert sobol_indices(np.ones(8), np.ones(24)) is None


def test_share_has_the_interval_of_clopper_and_pearson():
    share = share_of(np.arange(1000) < 10)
    assert share.estimate == 0.01
    # quantiles of beta distributions
    assert share.lower == pytest.approx(stats.beta.ppf(0.025, 10, 991), rel=1e-6)
    assert share.upper == pytest.approx(stats.beta.ppf(0.975, 11, 990), rel=1e-6)
    # no event in n runs: 1 - 0.025^(1/n)
    assert share_of(np.zeros(1000)).upper == pytest.approx(1.0 - 0.025**0.001, rel=1e-6)


def test_intervals_of_percentiles_contain_the_truth():
    random = np.random.default_rng(0)
    found = [percentile_of(random.random(200), 95.0) for _ in range(400)]
    inside = np.mean([p.lower <= 0.95 <= p.upper for p in found])
    assert 0.92 <= inside <= 0.995


def test_a_single_quantity_that_hardly_varies_has_indices():
    at_a = np.zeros(8)
    at_a[0] = 1.0  # most resamples do not vary
    at_exchanged = np.concatenate([np.zeros(8), at_a[::-1]])
    found = sobol_indices(at_a, at_exchanged)
    assert np.isfinite([found["first"], found["total"]]).all()
