"""Tests of the gasket page, for any number of loads, factors and responses."""

import re

import numpy as np
import pandas as pd
import pytest
from pages import without_scripts

from wm_drake.errors import InputError
from wm_drake.parameters import GASKET_FACTORS, levels_of, load_factors
from wm_drake.report.arrangement import arrange
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket import figures
from wm_drake.studies.gasket.advice import advice
from wm_drake.studies.gasket.findings import about_residual, load_findings, summary, warnings
from wm_drake.studies.gasket.page import GasketResult
from wm_drake.studies.gasket.proposal import NOT_COMPARED
from wm_drake.studies.gasket.screening import Meaning, Responses, Words, run_screening
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.tables import as_plain_data, digits, factors, runs_frame
from wm_drake.studies.study import Facts

NAMES = ("C_L", "C_T", "K_Lx", "K_Ly")
RESPONSES = [letter + axis for letter in "DFM" for axis in "xyz"]
UNITS = {name: {"D": "mm", "F": "N", "M": "N m"}[name[0]] for name in RESPONSES}
KINDS = {"D": "displacement", "F": "force", "M": "moment"}
MEANINGS = {name: Meaning(f"{KINDS[name[0]]} {name[1]}", kind=KINDS[name[0]]) for name in RESPONSES}


@pytest.fixture(scope="module")
def words(trials):
    return Words(trials.factors, MEANINGS)


def planted(design):
    """Return responses with known effects.

    Dx falls with C_L by 4 mm, and Mx rises with it by 2 N m. Dy is lowest at level 0 of C_T. Fz is an
    interaction. All other effects are small.
    """
    x = dict(zip(design.factors, design.levels.T.astype(float), strict=True))
    small = 0.01 * x["K_Ly"]
    values = dict.fromkeys(RESPONSES, 10.0 + small)
    values |= {
        "Dx": 20.0 - 2.0 * x["C_L"],
        "Mx": 5.0 + x["C_L"],
        "Dy": 8.0 + x["C_T"] ** 2,
        "Fz": 30.0 + x["K_Lx"] * x["K_Ly"],
    }
    frame = pd.DataFrame(values)[RESPONSES]
    return Responses({"middle": frame, "towel & co": frame * 1.5}, UNITS, {}, MEANINGS)


@pytest.fixture(scope="module")
def screening():
    return run_screening(make_design("full", NAMES), planted)


@pytest.fixture(scope="module")
def trials(reference):
    factors = levels_of(
        reference,
        {name: factor for name, factor in load_factors(GASKET_FACTORS).items() if name in NAMES},
    )
    return GasketTrials(
        reference, factors, [Case("middle", reference.loads["middle"], reference.profile)]
    )


@pytest.mark.parametrize(
    ("place", "parts"),
    [
        (0, ("Dx", "mean 20.0 mm", "falls by 4.00 mm", "C_L", "0.0095 to 0.0285 N s/mm (100 %)")),
        (1, ("Dy", "mean 8.67 mm", "lowest at 60 N mm s/deg", "C_T", "up to 1.00 mm (100 %)")),
        (5, ("Fz", "mean 30.0 N", "interaction", "K_Lx × ", "K_Ly (100 %)")),
    ],
)
def test_words_come_from_the_numbers(screening, words, place, parts):
    text = load_findings(screening, "middle", words)[place]
    assert all(part in text for part in parts)


def test_advice_names_direction_gain_and_conflict(screening, words, trials):
    damping, torsional, *_ = advice(trials.factors, screening, words, NOT_COMPARED).frame().values
    assert damping[0] == "linear damping C_L"
    assert damping[1].startswith("gasket.damping_x, gasket.damping_y")
    assert damping[2:5].tolist() == [
        "less: 0.0095 N s/mm",
        "Mx [3.00 N m]",
        "more: 0.0285 N s/mm for Dx [6.00 mm]",
    ]
    assert torsional[2:5].tolist() == ["middle: 60 N mm s/deg", "Dy [1.50 mm]", ""]


def test_advice_names_the_load_where_loads_differ(words, trials):
    def evaluate(design):
        a = design.levels[:, 0].astype(float)
        frames = {
            name: pd.DataFrame({"Dx": 9.0 + sign * a}) for name, sign in (("p", 1), ("q", -1))
        }
        return Responses(frames, {"Dx": "mm"}, {}, MEANINGS)

    found = run_screening(make_design("full", NAMES), evaluate)
    damping = advice(trials.factors, found, words, NOT_COMPARED).frame().values[0]
    assert damping[3] == "Dx, load p [2.00 mm]"
    assert damping[4] == "more: 0.0285 N s/mm for Dx, load q [2.00 mm]"


def part_of_grid(kind, trials, cube):
    """Return a screening of a part of the grid; `cube` is the size of a term of three factors."""

    def evaluate(design):
        a, b, c, d = design.levels.T.astype(float)
        y = 10.0 + a + 0.2 * b * c + cube * a * b * d
        return Responses({"middle": pd.DataFrame({"y": y})}, {"y": "mm"}, {})

    return run_screening(make_design(kind, NAMES, trials=trials), evaluate)


def test_partial_design_is_judged_by_trials_that_are_left_out(words):
    good, poor = part_of_grid("d-optimal", 60, 0.1), part_of_grid("d-optimal", 60, 1.5)
    text = about_residual(good)
    assert "consists of" not in text
    assert "predicted R²" in text
    assert "left out of its fit with R² of at least" in " ".join(summary(good, words))
    assert warnings(good, words) == []
    assert "poorly" in warnings(poor, words)[0]


def test_few_trials_are_warned_of_and_none_left_is_refused(words):
    found = warnings(part_of_grid("d-optimal", 40, 0.1), words)
    assert "40 trials for 33 coefficients are few (7 degrees of freedom)" in found[0]
    with pytest.raises(InputError, match=r"33 trials for 33 coefficients .* no degree of freedom"):
        part_of_grid("d-optimal", 33, 0.1)


def test_full_saturated_design_says_that_nothing_shows_its_fit(trials, words):
    frame = pd.DataFrame({"y": np.arange(9.0) ** 2})
    responses = Responses({"middle": frame}, {"y": "mm"}, {})
    screening = run_screening(make_design("full", NAMES[:2]), lambda _: responses)
    assert "nothing shows how well the model fits between them" in warnings(screening, words)[0]
    page = GasketResult(screening, trials).page(Facts())
    assert not re.search(r"[>( ](nan|NaN)[<) ]", without_scripts(page))


def test_contact_is_said_first_and_listed(trials, words):
    def evaluate(design):
        gap = 5.0 + 3.0 * design.levels[:, 0]
        gap[4] = -1.0
        frame = pd.DataFrame({"gap": gap})
        return Responses({"middle": frame}, {"gap": "mm"}, {}, {}, {(4, "middle"): -1.0})

    screening = run_screening(make_design("full", NAMES), evaluate)
    first = warnings(screening, words)[0]
    assert "The tub touches the housing in 1 of 81 runs" in first
    assert "trial 5, load middle" in first
    assert "Runs in which the tub touches the housing" in GasketResult(screening, trials).page(
        Facts()
    )


def test_slack_springs_are_counted_by_spring_and_load(words):
    frame = pd.DataFrame({"y": np.arange(9.0) ** 2})
    slack = {(0, "middle"): ["left"], (3, "middle"): ["left", "rear"]}
    responses = Responses({"middle": frame}, {"y": "mm"}, {}, slack=slack)
    screening = run_screening(make_design("full", NAMES[:2]), lambda _: responses)
    (found,) = [text for text in warnings(screening, words) if "slack" in text]
    assert found.startswith(
        "Springs go slack in 2 of 9 runs: left with load middle (2) and rear with load middle (1)."
    )
    assert as_plain_data(screening)["slack"] == [
        {"trial": 1, "load": "middle", "springs": ["left"]},
        {"trial": 4, "load": "middle", "springs": ["left", "rear"]},
    ]
    assert list(runs_frame(screening)["slack"])[:4] == ["left", "", "", "left, rear"]


def test_spread_shows_all_points_of_all_loads(screening, words):
    """Check shared limits; once they were those of the first panel and cut points of the others."""
    figure = figures.spread_figure(screening, ["Dx", "Dy", "Dz"], "displacement", words)
    for place, load in zip(arrange(figure).places, screening.loads, strict=True):
        values = screening.responses.values[load][["Dx", "Dy", "Dz"]].to_numpy()
        low, high = place.panel.y.range
        assert low <= values.min() < values.max() <= high


def test_factor_table_has_every_level_and_its_unit(trials, words):
    table = factors(trials.factors, words)
    for group, factor in zip(table.groups, trials.factors, strict=True):
        for row in group.rows:
            key, _, *levels, unit = row.cells
            assert unit == factor.units[key]
            assert [float(text) for text in levels] == pytest.approx(
                [factor.numbers[key][at] for at in range(3)], rel=1e-3
            )


@pytest.mark.parametrize("model", ["main", "main+2fi"])
def test_page_of_few_factors_and_failed_runs(trials, model):
    def evaluate(design):
        rng = np.random.default_rng(0)
        frame = pd.DataFrame(rng.uniform(1.0, 2.0, (design.trials, 9)), columns=RESPONSES)
        frame["Fy"] = 0.0  # a response that does not vary
        frame.loc[2] = np.nan
        return Responses({"middle": frame}, UNITS, {(2, "middle"): "the run diverged at 1.2 s"})

    screening = run_screening(make_design("full", NAMES[:3], model=model), evaluate)
    page = GasketResult(screening, trials).page(Facts())
    assert "Trial 3, load middle: the run diverged at 1.2 s" in page
    assert ("all interactions, because the model contains main effects only" in page) == (
        model == "main"
    )


def test_page_of_one_factor_has_no_interactions(reference):
    """Take one factor with a model of interactions, as `--factor gasket.stiffness_x` gives."""

    def evaluate(design):
        frame = pd.DataFrame(dict.fromkeys(RESPONSES, 2.0 + design.levels[:, 0]))
        return Responses({"middle": frame}, UNITS, {})

    factors = levels_of(reference, {"C_L": load_factors(GASKET_FACTORS)["C_L"]})
    case = Case("middle", reference.loads["middle"], reference.profile)
    trials = GasketTrials(reference, factors, [case])
    screening = run_screening(make_design("full", ["C_L"]), evaluate)
    page = GasketResult(screening, trials).page(Facts())
    assert "Main effects, load middle" in page
    assert "Strongest interaction" not in page


@pytest.mark.parametrize(
    ("value", "text"),
    [(123.4, "123"), (12.34, "12.3"), (-1.234, "−1.23"), (0.01234, "0.0123"), (np.nan, "–")],
)
def test_three_digits(value, text):
    assert digits(value) == text
