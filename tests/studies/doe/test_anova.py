"""Analysis of variance against a textbook, reference tables of statsmodels and known effects."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

from wm_drake.studies.doe.anova import SumCoding, anova
from wm_drake.studies.doe.coding import level_matrix
from wm_drake.studies.doe.exchange import d_optimal_levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

# Montgomery, Design and Analysis of Experiments, battery life data: hours by plate material (1-3)
# and temperature (15, 70, 125 deg F), four batteries each; analysis of variance as printed there
BATTERY = {
    (1, 15): (130, 155, 74, 180),
    (1, 70): (34, 40, 80, 75),
    (1, 125): (20, 70, 82, 58),
    (2, 15): (150, 188, 159, 126),
    (2, 70): (136, 122, 106, 115),
    (2, 125): (25, 70, 58, 45),
    (3, 15): (138, 110, 168, 160),
    (3, 70): (174, 120, 150, 139),
    (3, 125): (96, 104, 82, 60),
}
BATTERY_TABLE = {  # sum of squares, degrees of freedom, F
    "material": (10683.72, 2, 7.91),
    "temperature": (39118.72, 2, 28.97),
    "material:temperature": (9613.78, 4, 3.56),
}


def battery():
    rows = [(m, t, hours) for (m, t), cell in BATTERY.items() for hours in cell]
    return pd.DataFrame(rows, columns=["material", "temperature", "hours"])


def test_battery_table_of_the_textbook():
    data = battery()
    table = anova(data[["material", "temperature"]], data[["hours"]]).sel(response="hours")
    # the printed sums of squares as variances: 36 batteries; the mean square of the error is 675.21
    total = (10683.72 + 39118.72 + 9613.78) / 36.0 + 18230.75 / 27.0
    for name, (sum_sq, df, f) in BATTERY_TABLE.items():
        term = table.sel(term=name)
        assert (term.sum_sq, term.df, term.f) == (
            pytest.approx(sum_sq, abs=0.006),
            df,
            pytest.approx(f, abs=0.006),
        )
        assert 100.0 * term.share == pytest.approx(100.0 * sum_sq / 36.0 / total, abs=1e-3)
    assert 100.0 * table.unexplained == pytest.approx(100.0 * 18230.75 / 27.0 / total, abs=1e-3)
    assert table.residual_sum_sq == pytest.approx(18230.75, abs=0.006)
    assert table.total_sum_sq == pytest.approx(77646.97, abs=0.006)
    assert table.residual_df == 27
    assert table.p[2] == pytest.approx(0.0186, abs=5e-5)
    assert table.constant == pytest.approx(105.53, abs=0.005)


# R's table of type III with contrasts sum for these data, from the test suite of statsmodels
# (stats/tests/test_anova.py, TestAnovaLM): days in hospital of kidney patients by duration of
# treatment (1, 2) and weight gain (1, 2, 3); the unbalanced case omits the same rows as there
KIDNEY = """
0.0 1 1|2.0 1 1|1.0 1 1|3.0 1 1|0.0 1 1|2.0 1 1|0.0 1 1|5.0 1 1|6.0 1 1|8.0 1 1|2.0 1 2|4.0 1 2|7.0 1 2|12.0 1 2|15.0 1 2|4.0 1 2|
3.0 1 2|1.0 1 2|5.0 1 2|20.0 1 2|15.0 1 3|10.0 1 3|8.0 1 3|5.0 1 3|25.0 1 3|16.0 1 3|7.0 1 3|30.0 1 3|3.0 1 3|27.0 1 3|0.0 2 1|
1.0 2 1|1.0 2 1|0.0 2 1|4.0 2 1|2.0 2 1|7.0 2 1|4.0 2 1|0.0 2 1|3.0 2 1|5.0 2 2|3.0 2 2|2.0 2 2|0.0 2 2|1.0 2 2|1.0 2 2|3.0 2 2|
6.0 2 2|7.0 2 2|9.0 2 2|10.0 2 3|8.0 2 3|12.0 2 3|3.0 2 3|7.0 2 3|15.0 2 3|4.0 2 3|9.0 2 3|6.0 2 3|1.0 2 3
"""


def kidney():
    rows = [row.split() for row in KIDNEY.replace("\n", "").strip().split("|")]
    data = pd.DataFrame(rows, columns=["Days", "Duration", "Weight"]).astype(
        {"Days": float, "Duration": int, "Weight": int}
    )
    return data.assign(log_days=np.log(data["Days"] + 1.0))


def statsmodels_table(data, response, factors):
    formula = f"{response} ~ {' * '.join(f'C({name}, Sum)' for name in factors)}"
    return anova_lm(ols(formula, data).fit(), typ=3)


@pytest.mark.parametrize("dropped", [[], [0, 4, 11, 27, 33, 50]])
def test_reference_case_of_statsmodels(dropped):
    data = kidney().drop(index=dropped)
    assert len(kidney()) == 60
    expected = statsmodels_table(data, "log_days", ["Duration", "Weight"]).drop(index="Intercept")
    table = anova(data[["Duration", "Weight"]], data[["log_days"]]).sel(response="log_days")
    for (_, row), term in zip(expected.iloc[:3].iterrows(), table.term, strict=True):
        found = table.sel(term=term)
        assert (found.sum_sq, found.df, found.f, found.p) == pytest.approx(
            (row["sum_sq"], row["df"], row["F"], row["PR(>F)"])
        )
    assert table.residual_sum_sq == pytest.approx(expected.loc["Residual", "sum_sq"])


def test_balanced_reference_case_as_r_prints_it():
    """Compare with R: anova(lm(log(Days+1) ~ Duration*Weight)), as in statsmodels' test file."""
    data = kidney()
    table = anova(data[["Duration", "Weight"]], data[["log_days"]]).sel(response="log_days")
    assert table.sum_sq.values == pytest.approx([2.3397, 16.9713, 0.6357], abs=5e-5)
    assert table.f.values == pytest.approx([4.3583, 15.8064, 0.5920], abs=5e-4)


NAMES = list("abcdefgh")


def design_of(levels):
    return pd.DataFrame(levels, columns=NAMES[: levels.shape[1]])


def planted(levels, main, cross):
    """Return a response with known effects of each factor and of factors 0 and 1 together."""
    response = 7.0 + sum(effects[levels[:, f] + 1] for f, effects in enumerate(main))
    return response + cross[levels[:, 0] + 1, levels[:, 1] + 1]


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["full", "orthogonal", "d-optimal", "random"]))
def test_known_effects_are_recovered_exactly_by_any_design(seed, kind):
    rng = np.random.default_rng(seed)
    full = level_matrix(5)
    levels = {
        "full": lambda: full,
        "orthogonal": lambda: orthogonal_levels(8, 243),
        "d-optimal": lambda: d_optimal_levels(4, 50, "main+2fi", 0),
        "random": lambda: full[rng.choice(243, 120, replace=False)],
    }[kind]().astype(int)
    main = rng.normal(size=(levels.shape[1], 3))
    main -= main.mean(axis=1, keepdims=True)
    cross = rng.normal(size=(3, 3))
    cross -= cross.mean(axis=0, keepdims=True)
    cross -= cross.mean(axis=1, keepdims=True)
    table = anova(design_of(levels), pd.DataFrame({"y": planted(levels, main, cross)})).sel(
        response="y"
    )
    assert table.constant == pytest.approx(7.0)
    effects = {NAMES[f]: of_factor for f, of_factor in enumerate(main)} | {"a:b": cross}
    total = sum(np.mean(of_term**2) for of_term in effects.values())
    for name in table.term.values.tolist():
        term, expected = table.sel(term=name), effects.get(name, np.zeros((3, 3)))
        share = np.mean(expected**2) / total
        assert 100.0 * term.share == pytest.approx(100.0 * share, abs=1e-8)
        found = term.effect.values[:, 1:] if ":" in name else term.effect.values[:, 0]
        assert found == pytest.approx(expected, abs=1e-9)
    assert 100.0 * table.unexplained == pytest.approx(0.0, abs=1e-12)
    assert table.main + table.interaction == pytest.approx(1.0)


@pytest.mark.parametrize(
    "levels", [level_matrix(5), orthogonal_levels(8, 243)], ids=["full", "orthogonal"]
)
def test_contributions_of_an_orthogonal_design_are_those_of_statsmodels(levels):
    rng = np.random.default_rng(1)
    response = (
        rng.normal(size=len(levels))
        + levels @ rng.normal(size=levels.shape[1])
        + 2.0 * levels[:, 0] * levels[:, 1]
    )
    data = design_of(levels).assign(y=response)
    table = anova(data.drop(columns="y"), data[["y"]]).sel(response="y")
    formula = f"y ~ ({' + '.join(f'C({name}, Sum)' for name in data.columns[:-1])})**2"
    expected = anova_lm(ols(formula, data).fit(), typ=3).drop(index="Intercept")
    # sums of squares as variances over the grid: the residual with its degrees of freedom, and with
    # the part of the grid that the trials are
    trials, grid = len(levels), 3 ** levels.shape[1]
    coefficients = trials - table.residual_df
    variances = expected["sum_sq"] / trials
    variances["Residual"] *= trials / table.residual_df * (1.0 - coefficients / grid)
    percents = 100.0 * variances / variances.sum()
    found = [*(100.0 * table.share.values), 100.0 * table.unexplained]
    assert found == pytest.approx(list(percents))
    assert sum(found) == pytest.approx(100.0)


def test_response_that_does_not_vary_has_no_contributions():
    levels = level_matrix(3)
    table = anova(design_of(levels), pd.DataFrame({"y": np.full(27, 0.3)})).sel(response="y")
    assert table.constant == pytest.approx(0.3)
    assert table.share.isnull().all()
    assert np.isnan(100.0 * table.unexplained)


def test_predicted_r2_is_that_of_fits_without_each_trial():
    rng = np.random.default_rng(3)
    levels = d_optimal_levels(4, 60, "main+2fi", 0)
    response = 4.0 * levels[:, 0] + np.prod(levels[:, :3], axis=1) + rng.normal(size=60)
    table = anova(design_of(levels), pd.DataFrame({"y": response})).sel(response="y")
    matrix = SumCoding(design_of(levels), interactions=True).matrix
    press = 0.0
    for out in range(60):
        kept = np.arange(60) != out
        fit = np.linalg.lstsq(matrix[kept], response[kept], rcond=None)[0]
        press += (response[out] - matrix[out] @ fit) ** 2
    total = np.sum((response - response.mean()) ** 2)
    assert table.predicted_r2 == pytest.approx(1.0 - press / total)
    freedom = 60 - matrix.shape[1]
    assert table.adjusted_r2 == pytest.approx(1.0 - table.residual_sum_sq / freedom * 59 / total)


def test_residual_share_is_that_of_the_grid_for_any_number_of_trials():
    """Fit parts of the grid: on average they give the share that the whole grid has."""
    rng = np.random.default_rng(8)
    full = level_matrix(5)
    response = 2.0 * full[:, 0] + full[:, 1] * full[:, 2] + rng.normal(size=len(full))
    frame = pd.DataFrame({"y": response})
    truth = anova(design_of(full), frame).unexplained.item()
    plain, corrected = [], []
    for _ in range(150):
        rows = rng.choice(len(full), 75, replace=False)
        table = anova(design_of(full[rows]), frame.iloc[rows]).sel(response="y")
        plain.append(table.residual_sum_sq / 75.0)
        corrected.append(SumCoding(design_of(full[rows]), True).residual_variance(75.0 * plain[-1]))
    over_grid = anova(design_of(full), frame).residual_sum_sq.item() / len(full)
    assert truth == pytest.approx(over_grid / np.var(response))
    assert np.mean(corrected) == pytest.approx(over_grid, rel=0.05)
    assert np.mean(plain) < 0.5 * over_grid


def test_saturated_design_has_no_residual_and_no_predicted_r2():
    levels = level_matrix(2)
    table = anova(design_of(levels), pd.DataFrame({"y": np.arange(9.0) ** 2})).sel(response="y")
    assert table.residual_df == 0
    assert all(np.isnan([100.0 * table.unexplained, table.adjusted_r2, table.predicted_r2]))
    assert table.main + table.interaction == pytest.approx(1.0)
