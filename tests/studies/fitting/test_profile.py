"""Intervals keep to the bounds: by the profile of the sum of squares where a standard error would not."""

import numpy as np
import pytest
from scipy.stats import t as student

from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import FitProblem, Measurement, Unknown

TIME = np.linspace(0.0, 1.0, 60)


def straight(x):
    return x[:, :1] + x[:, 1:2] * TIME


def problem(seed, friction, noise=1.0, lower=0.0):
    values = straight(np.array([[friction, 5.0]]))[0]
    values = values + noise * np.random.default_rng(seed).normal(size=TIME.size)
    unknowns = (Unknown("friction", lower, 20.0), Unknown("slope", -50.0, 50.0))
    return FitProblem(unknowns, (Measurement("m", values),), straight)


def fitted(seed, friction, **options):
    return identify(problem(seed, friction, **options), starts=1, screened=4)


def test_an_interval_within_the_bounds_is_that_of_the_linear_model():
    fit = fitted(0, 3.0)
    columns = np.stack([np.ones_like(TIME), TIME], axis=1)
    values = fit.problem.measurements[0].values
    best, left, *_ = np.linalg.lstsq(columns, values)
    error = np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0] * left[0] / 58.0)
    reach = student.ppf(0.975, 58) * error
    assert fit["friction"].lower == pytest.approx(best[0] - reach, rel=1e-3)
    assert fit["friction"].upper == pytest.approx(best[0] + reach, rel=1e-3)


def test_an_interval_that_would_leave_the_bounds_ends_at_them():
    wide, kept = fitted(1, 0.25, lower=-20.0)["friction"], fitted(1, 0.25)["friction"]
    assert wide.lower < 0.0 < kept.value
    assert kept.lower == 0.0
    assert kept.upper == pytest.approx(wide.upper, rel=1e-3)


def test_the_profile_of_a_curved_model_ends_where_its_sum_of_squares_has_risen():
    """Take a rate seen through a decay: far from its value the profile is not a parabola."""
    rng = np.random.default_rng(4)
    model = lambda x: np.exp(-x[:, :1] * TIME)  # noqa: E731
    values = model(np.array([[0.5]]))[0] + 1.0 * rng.normal(size=TIME.size)
    given = FitProblem((Unknown("rate", 0.0, 4.0),), (Measurement("m", values),), model)
    estimate = identify(given, starts=1)["rate"]
    square = lambda rate: np.sum((values - np.exp(-rate * TIME)) ** 2)  # noqa: E731
    slope = -TIME * np.exp(-estimate.value * TIME)
    variance = square(estimate.value) / 59.0
    rise = student.ppf(0.975, 59) ** 2 * variance
    assert estimate.value - np.sqrt(rise / np.sum(slope**2)) < 0.0
    assert estimate.lower > 0.0
    assert square(estimate.lower) - square(estimate.value) == pytest.approx(rise, rel=0.05)


def test_intervals_near_a_bound_hold_the_truth_in_at_least_90_of_100_noisy_repeats():
    """Put the truth 2.2 standard errors above its bound: nearly half of the intervals are cut."""
    friction = 2.2 * np.sqrt(np.linalg.inv([[60.0, 30.0], [30.0, np.sum(TIME**2)]])[0, 0])
    held = cut = 0
    for seed in range(100):
        estimate = fitted(seed, friction)["friction"]
        held += estimate.lower <= friction <= estimate.upper
        cut += estimate.lower == 0.0
        assert not estimate.lower < 0.0
    assert 90 <= held <= 99
    assert cut > 20
