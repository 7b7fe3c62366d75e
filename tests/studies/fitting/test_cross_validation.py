"""Errors of left-out tests: exact for a linear model, a repeated search for others."""

import numpy as np
import pytest

from wm_drake.studies.fitting.left_out import left_out_errors
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import FitProblem, Measurement, Unknown

RNG = np.random.default_rng(2)
TIME = np.linspace(0.1, 1.0, 30)
SIZES = (1.0, 0.6, 1.7, 2.2)


def problem(model, unknowns, noise=0.05):
    truth = np.array([[2.0, 1.5]])
    values = [model(truth, s)[0] + noise * RNG.normal(size=TIME.size) for s in SIZES]
    measured = [Measurement(f"{s}", v) for s, v in zip(SIZES, values, strict=True)]

    def part(chosen):
        return FitProblem(
            unknowns,
            tuple(measured[k] for k in chosen),
            lambda x: np.concatenate([model(x, SIZES[k]) for k in chosen], axis=1),
        )

    return part


def line(x, size):
    return size * (x[:, :1] + x[:, 1:2] * TIME * size)


def decay(x, size):
    return x[:, :1] * np.exp(-x[:, 1:2] * TIME * size)


@pytest.mark.parametrize("model", [line, decay])
def test_they_are_the_errors_of_fits_without_each_test(model):
    part = problem(model, (Unknown("a", 0.0, 10.0), Unknown("b", 0.1, 10.0, logarithmic=True)))
    everyone = range(len(SIZES))
    found = left_out_errors(identify(part(everyone)), part)
    for index in everyone:
        fit = identify(part([k for k in everyone if k != index]))
        alone = part([index])
        expected = np.sqrt(np.mean(alone.residuals(alone.coordinates_of(fit.values)[None]) ** 2))
        assert found[index] == pytest.approx(expected, rel=1e-3 if model is line else 2e-2)


def test_a_test_that_alone_shows_an_unknown_is_predicted_by_a_new_search():
    """Show b in the last test only; without it, b goes where its bounds let it."""
    part = problem(
        lambda x, size: x[:, :1] * TIME + np.where(size > 2.0, x[:, 1:2], 0.0),
        (Unknown("a", 0.0, 10.0), Unknown("b", 0.0, 10.0)),
    )
    fit = identify(part(range(len(SIZES))))
    found = left_out_errors(fit, part)
    assert np.all(np.isfinite(found))
    assert found[:3] == pytest.approx([test.rmse for test in fit.tests[:3]], rel=0.2)


def test_a_model_without_unknowns_has_its_own_errors():
    measured = (Measurement("a", np.array([3.0, 4.0])), Measurement("b", np.array([0.0, 2.0])))
    given = FitProblem((), measured, lambda x: np.ones((len(x), 4)))
    fit = identify(given)
    assert fit.rmse == pytest.approx(np.sqrt((4.0 + 9.0 + 1.0 + 1.0) / 4.0))
    assert left_out_errors(fit, lambda chosen: given) == pytest.approx(np.sqrt([6.5, 1.0]))
    assert fit.estimates == ()
