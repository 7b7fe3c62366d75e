"""Tests of the fitted model of a gasket study between its levels, and of its check by runs."""

import itertools

import numpy as np
import pytest
from scipy import stats

from wm_drake.errors import InputError
from wm_drake.parameters import (
    load_machine,
    varying,
)
from wm_drake.parameters.units import Unit
from wm_drake.parameters.variation import number_at
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.report.quantity import Quantity
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket.screening import run_screening, runs_of
from wm_drake.studies.gasket.surface import (
    Setting,
    codes,
    compared_with_models,
    half_widths,
    mean_half_widths,
    model_rows,
    models_of,
    predicted,
)

NAMES = ("a", "b", "c")
LENGTH = Quantity("y", Unit("m", "mm"))


def truth(x):
    """Return a polynomial that the model with interactions contains."""
    a, b, c = np.asarray(x, dtype=float).T
    return 3.0 + 2.0 * a - 1.5 * a * a + b + 0.5 * a * b * b - 0.25 * a * a * c * c + 0.1 * c


def screening_of(noise, seed=0):
    def evaluate(design):
        rng = np.random.default_rng(seed)
        y = truth(design.levels) + noise * rng.normal(size=design.trials)
        return runs_of({"middle": {"y": y}}, {"y": LENGTH})

    return run_screening(make_design("full", NAMES, model="main+2fi"), evaluate)


def test_codes_are_those_of_the_levels():
    assert codes(np.array([-1.0, 0.0, 1.0])).tolist() == [[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]


def test_polynomial_of_the_model_is_recovered_between_the_levels():
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 3))
    found = predicted(models_of(screening_of(0.0)), x)
    assert found.predicted.values.ravel() == pytest.approx(truth(x), abs=1e-10)


def test_intervals_are_those_of_least_squares_with_another_basis():
    screening = screening_of(0.4)
    models, x = models_of(screening), (0.3, -0.7, 0.5)

    def powers(a, b, c):
        one = [[v, v * v] for v in (a, b, c)]
        pairs = [p * q for u, w in itertools.combinations(one, 2) for p in u for q in w]
        return np.array([1.0, *itertools.chain(*one), *pairs])

    levels = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
    order = {tuple(row): i for i, row in enumerate(screening.design.levels.tolist())}
    y = screening.value.sel(load="middle", response="y").values
    y = y[[order[tuple(map(int, row))] for row in levels]]
    matrix = np.array([powers(*row) for row in levels])
    beta, residual, *_ = np.linalg.lstsq(matrix, y)
    df = len(y) - matrix.shape[1]
    leverage = powers(*x) @ np.linalg.solve(matrix.T @ matrix, powers(*x))
    spread = stats.t.ppf(0.975, df) * np.sqrt(residual[0] / df)
    found = predicted(models, [x])
    assert found.predicted.item() == pytest.approx(powers(*x) @ beta, abs=1e-10)
    assert found.half_width.item() == pytest.approx(spread * (1 + leverage) ** 0.5)
    rows = model_rows(np.array([x]), interactions=True)
    assert half_widths(models, rows, of_run=False).item() == pytest.approx(spread * leverage**0.5)
    # a mean over 9 of the 27 trials of the full factorial
    assert mean_half_widths(models, [1.0])[1].item() == pytest.approx(spread / 3.0)


def test_row_without_interactions_is_short():
    rows = model_rows(np.array([[0.0, 1.0]]), interactions=False)
    assert rows.tolist() == [[1.0, 0.0, 1.0, -1.0, -1.0]]


@pytest.fixture(scope="module")
def machine():
    return load_machine("reference")


@pytest.mark.parametrize("tables", ["scaled", "linear"])
def test_places_between_levels_lie_between_them(machine, tables):
    factors = varying(machine, gasket_entries(), tables=tables)
    half = factors.at_levels([0.5] * 8)
    for factor in factors.every:
        for number in factor.numbers:
            low, middle, high = factor.levels_of(number)
            assert (low, middle, high) == pytest.approx([s * middle for s in (0.5, 1.0, 1.5)])
            value = number_at(half, number.key).nominal
            assert value == pytest.approx(0.5 * (middle + high), rel=1e-12)


def test_place_of_a_value_in_percent_and_with_unit(machine):
    (factor,) = varying(machine, {"C_L": gasket_entries()["C_L"]}).every
    assert factor.level_of("50 %") == pytest.approx(-1.0)
    assert factor.level_of("125 %") == pytest.approx(0.5)
    assert factor.level_of(f"{factor.first_levels[2]} N*s/m") == pytest.approx(1.0)
    with pytest.raises(InputError, match="outside the range of factor C_L"):
        factor.level_of("200 %")


def test_check_says_which_runs_are_inside_the_interval():
    models = models_of(screening_of(0.4))
    settings = (Setting("a=1", (1.0, 0.0, 0.0)), Setting("a=-1", (-1.0, 0.0, 0.0)))
    one = predicted(models, [settings[0].places]).isel(setting=0).squeeze()
    values = [one.predicted.item() + 0.9 * one.half_width.item(), 99.0]
    runs = runs_of({"middle": {"y": values}, "left out": {"y": values}}, {"y": LENGTH}).value
    check = compared_with_models(models, settings, runs.rename(trial="setting"))
    assert check.is_inside.sel(load="middle", response="y").values.tolist() == [True, False]
    first = check.isel(setting=0).sel(load="middle")
    assert first.difference.item() == pytest.approx(0.9 * one.half_width.item())
    assert np.isnan(check.predicted.sel(load="left out")).all()
