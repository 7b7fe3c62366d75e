"""Polynomial models of own designs: a planted polynomial, statsmodels, left-out trials, words."""

import numpy as np
import pytest
import statsmodels.api as sm

from wm_drake.errors import InputError
from wm_drake.studies.doe.design import read_levels
from wm_drake.studies.doe.polynomial import (
    PolynomialDesign,
    check_determined,
    fitted_polynomial,
    polynomial,
)

NAMES = ("a", "b", "c")


def latin_hypercube(trials, factors, seed):
    rng = np.random.default_rng(seed)
    places = (rng.permuted(np.tile(np.arange(trials), (factors, 1)), axis=1).T + 0.5) / trials
    return 2.0 * places - 1.0


def central_composite(factors, star):
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * factors)).reshape(factors, -1).T
    stars = np.vstack([star * np.eye(factors), -star * np.eye(factors)])
    return np.vstack([corners, stars, np.zeros((1, factors))])


def responses(levels, seed=1):
    a, b, c = levels.T
    noise = np.random.default_rng(seed).normal(size=len(levels))
    return np.stack([3.0 + 2.0 * a - b * c + 0.5 * c**2, np.exp(a) + 0.1 * noise], axis=-1)


@pytest.mark.parametrize("levels", [latin_hypercube(25, 3, 0), central_composite(3, 1.682)])
def test_planted_polynomial_is_found(levels):
    fit = fitted_polynomial(polynomial("quadratic", NAMES), levels, responses(levels))
    found = fit.coefficient.isel(response=0).to_series().round(9).to_dict()
    planted = {"constant": 3.0, "a": 2.0, "b:c": -1.0, "c^2": 0.5}
    assert found == pytest.approx({name: planted.get(name, 0.0) for name in found}, abs=1e-9)


@pytest.mark.parametrize("model", ["linear", "quadratic", "a, b, a:b, a^3"])
def test_fit_is_that_of_statsmodels(model):
    levels = latin_hypercube(40, 3, 2)
    terms = polynomial(model, NAMES)
    fit = fitted_polynomial(terms, levels, responses(levels)).isel(response=1)
    other = sm.OLS(responses(levels)[:, 1], terms.columns(levels)).fit()
    influence = other.get_influence()
    np.testing.assert_allclose(fit.coefficient, other.params, rtol=1e-8, atol=1e-12)
    low, high = other.conf_int().T
    np.testing.assert_allclose(fit.half_width, 0.5 * (high - low), rtol=1e-8)
    np.testing.assert_allclose(fit.p, other.pvalues, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(fit.leverage, influence.hat_matrix_diag, rtol=1e-8)
    assert fit.adjusted_r2.item() == pytest.approx(other.rsquared_adj)
    assert fit.residual_deviation.item() == pytest.approx(np.sqrt(other.mse_resid))


def test_predicted_r2_leaves_each_trial_out():
    levels, terms = latin_hypercube(20, 3, 3), polynomial("quadratic", NAMES)
    values = responses(levels)[:, 1:]
    errors = []
    for k in range(len(levels)):
        kept = np.arange(len(levels)) != k
        rows, one = terms.columns(levels[kept]), terms.columns(levels[k : k + 1])
        errors.append(values[k, 0] - (one @ np.linalg.lstsq(rows, values[kept, 0])[0])[0])
    expected = 1.0 - np.sum(np.square(errors)) / np.sum((values - values.mean()) ** 2)
    fit = fitted_polynomial(terms, levels, values)
    assert fit.predicted_r2.item() == pytest.approx(expected)


def refused(levels, model):
    design = PolynomialDesign("own.csv", NAMES, levels, polynomial(model, NAMES))
    with pytest.raises(InputError) as caught:
        check_determined(design)
    return str(caught.value)


def test_model_with_more_terms_than_the_design_determines_is_named():
    squares = refused(central_composite(3, 1.0)[:8], "a, b, c, a^2, b^2")
    assert "determine 4 of the 6 coefficients" in squares
    assert "constant, a^2, b^2; add" in squares
    assert "--model linear+2fi" in squares  # the corners determine it
    few = refused(latin_hypercube(6, 3, 0), "quadratic")
    assert "6 different trials determine 6 of the 10" in few
    assert "--model linear" in few
    least = refused(latin_hypercube(4, 3, 0), "linear")
    assert "no degree of freedom" in least
    assert "--model linear" not in least


@pytest.mark.parametrize(
    ("model", "message"),
    [("a, d", "'d' is no model"), ("cubic", "no model"), ("a^0", "power"), ("a:b^x", "power")],
)
def test_wrong_models_are_refused(model, message):
    with pytest.raises(InputError, match=message):
        polynomial(model, NAMES)


def test_levels_and_values_of_programs_are_read(tmp_path):
    path = tmp_path / "design.csv"
    path.write_text(
        "StdOrder,PtType,a,b [N/mm],c\n1,1,-1.682,3,80 %\n2,0,0.25,4.5,low\n3,0,0.25,4.5,low\n"
    )
    known = {"3 N/mm": -0.5, "4.5 N/mm": 0.25, "80 %": -0.4}
    with pytest.warns(match="1 repeated trials run once"):
        levels = read_levels(path, NAMES, lambda _, text: known[text])
    assert levels.tolist() == [[-1.682, -0.5, -0.4], [0.25, 0.25, -1.0]]
    path.write_text("a,b,c\n0,1500,0\n")
    with pytest.raises(InputError, match=r"csv:2: b: '1500' is not a level"):
        read_levels(path, NAMES, lambda _, text: known[text])
