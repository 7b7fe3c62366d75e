"""Tests of the gasket page, for any number of loads, factors and responses."""

import re

import numpy as np
import pytest
from pages import without_scripts

from wm_drake.errors import InputError
from wm_drake.parameters import varying
from wm_drake.parameters.units import Unit
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.report.arrangement import arrange
from wm_drake.report.formatting import three_digits
from wm_drake.report.quantity import Quantity, shown
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.facts import Facts
from wm_drake.studies.gasket import figures
from wm_drake.studies.gasket.findings import load_findings, warnings
from wm_drake.studies.gasket.page import gasket_answer
from wm_drake.studies.gasket.screening import run_screening, runs_of
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.surface import models_of
from wm_drake.studies.gasket.tables import factors_table
from wm_drake.studies.gasket.words import Words

NAMES = ("C_L", "C_T", "K_Lx", "K_Ly")
RESPONSES = [letter + axis for letter in "DFM" for axis in "xyz"]
UNITS = {"D": Unit("m", "mm"), "F": Unit("N", "N"), "M": Unit("N*m", "N*m")}
KINDS = {"D": "displacement", "F": "force", "M": "moment"}
QUANTITIES = {
    name: Quantity(f"{KINDS[name[0]]} {name[1]}", UNITS[name[0]], form=three_digits)
    for name in RESPONSES
}
Y = {"y": Quantity("y", Unit("m", "mm"), form=three_digits)}


@pytest.fixture(scope="module")
def words(trials, screening):
    return Words(trials.factors, screening)


def planted(design):
    """Return responses with known effects, in units for reading.

    Dx falls with C_L by 4 mm, and Mx rises with it by 2 N m. Dy is lowest at level 0 of C_T. Fz is an
    interaction. All other effects are small.
    """
    x = dict(zip(design.factors, design.levels.T.astype(float), strict=True))
    values = dict.fromkeys(RESPONSES, 10.0 + 0.01 * x["K_Ly"])
    values |= {
        "Dx": 20.0 - 2.0 * x["C_L"],
        "Mx": 5.0 + x["C_L"],
        "Dy": 8.0 + x["C_T"] ** 2,
        "Fz": 30.0 + x["K_Lx"] * x["K_Ly"],
    }
    one = {name: QUANTITIES[name].unit.to_si(column) for name, column in values.items()}
    more = {name: 1.5 * column for name, column in one.items()}
    return runs_of(
        {"middle": one, "towel & co": more}, QUANTITIES, kinds={n: KINDS[n[0]] for n in RESPONSES}
    )


@pytest.fixture(scope="module")
def screening():
    return run_screening(make_design("full", NAMES), planted)


@pytest.fixture(scope="module")
def trials(reference):
    return trials_of(reference, NAMES)


def trials_of(machine, names):
    known = gasket_entries()
    case = Case("middle", machine.loads["middle"], machine.profile)
    return GasketTrials(varying(machine, {name: known[name] for name in names}), [case])


def page_of(screening, trials):
    return gasket_answer(screening, models_of(screening), trials).page(Facts())


def of_y(design, y, load="middle"):
    """Return a screening of one response. [mm]"""
    return run_screening(design, lambda _: runs_of({load: {"y": 1e-3 * y}}, Y))


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


def part_of_grid(kind, trials, cube):
    """Return a screening of a part of the grid; `cube` is the size of a term of three factors."""
    design = make_design(kind, NAMES, trials=trials)
    a, b, c, d = design.levels.T.astype(float)
    return of_y(design, 10.0 + a + 0.2 * b * c + cube * a * b * d)


@pytest.mark.parametrize(("size", "cube", "count"), [(60, 0.1, 0), (60, 1.5, 1), (40, 0.1, 1)])
def test_few_trials_and_poor_models_are_warned_of(trials, size, cube, count):
    screening = part_of_grid("d-optimal", size, cube)
    assert len(warnings(screening, Words(trials.factors, screening))) == count


def test_no_degree_of_freedom_is_refused():
    with pytest.raises(InputError, match=r"33 trials for 33 coefficients .* no degree of freedom"):
        part_of_grid("d-optimal", 33, 0.1)


def test_page_of_a_full_saturated_design_has_no_nan(reference):
    screening = of_y(make_design("full", NAMES[:2]), np.arange(9.0) ** 2)
    trials = trials_of(reference, NAMES[:2])
    assert len(warnings(screening, Words(trials.factors, screening))) == 1
    page = page_of(screening, trials)
    assert not re.search(r"[>( ](nan|NaN)[<) ]", without_scripts(page))


def test_contact_is_warned_of_and_listed(trials):
    design = make_design("full", NAMES)

    def evaluate(_):
        gap = 5.0 + 3.0 * design.levels[:, 0]
        gap[4] = -1.0
        runs = runs_of({"middle": {"gap": 1e-3 * gap}}, {"gap": Y["y"]}, {"gap": "larger"})
        runs.overlap.loc[{"trial": 5}] = -1e-3
        return runs

    screening = run_screening(design, evaluate)
    answer = gasket_answer(screening, models_of(screening), trials)
    assert "1 of 81 runs" in answer.warned[0]
    (row,) = answer.labelled()["touching"].records()
    assert (row["trial"], row["load"], row["gap_mm"]) == (5, "middle", -1.0)


def test_slack_springs_are_counted_by_spring_and_load(reference):
    def evaluate(_):
        runs = runs_of({"middle": {"y": np.arange(9.0) ** 2}}, Y)
        runs.slack.loc[{"trial": 1}] = "left"
        runs.slack.loc[{"trial": 4}] = "left, rear"
        return runs

    screening = run_screening(make_design("full", NAMES[:2]), evaluate)
    trials = trials_of(reference, NAMES[:2])
    answer = gasket_answer(screening, models_of(screening), trials)
    (found,) = [text for text in answer.warned if "slack" in text]
    assert "2 of 9 runs: left with load middle (2) and rear with load middle (1)." in found
    assert answer.labelled()["slack"].records() == [
        {"trial": 1, "load": "middle", "springs": "left"},
        {"trial": 4, "load": "middle", "springs": "left, rear"},
    ]
    assert list(answer.tables()["runs"]["slack"])[:4] == ["left", "", "", "left, rear"]


def test_spread_shows_all_points_of_all_loads(screening, words):
    """Check shared limits; once they were those of the first panel and cut points of the others."""
    figure = figures.spread_figure(screening, ["Dx", "Dy", "Dz"], words)
    for place, load in zip(arrange(figure).places, screening["load"].values, strict=True):
        values = shown(screening.value.sel(load=load, response=["Dx", "Dy", "Dz"]))
        low, high = place.panel.y.range
        assert low <= values.min() < values.max() <= high


def test_factor_table_has_every_level_and_its_unit(trials, words):
    rows = factors_table(trials, words).frame().set_index("key")
    for factor in trials.factors:
        for number in factor.numbers:
            assert rows.loc[number.key, "unit"] == number.unit.label
            levels = [number.unit.from_si(level) for level in factor.levels_of(number)]
            assert rows.loc[number.key, ["-1", "0", "1"]].tolist() == pytest.approx(levels)


@pytest.mark.parametrize("model", ["main", "main+2fi"])
def test_page_of_few_factors_and_failed_runs(reference, model):
    def evaluate(design):
        rng = np.random.default_rng(0)
        values = {name: rng.uniform(1.0, 2.0, design.trials) for name in RESPONSES}
        values["Fy"] = np.zeros(design.trials)  # a response that does not vary
        for column in values.values():
            column[2] = np.nan
        runs = runs_of({"middle": values}, QUANTITIES)
        runs.failed.loc[{"trial": 3}] = "the run diverged at 1.2 s"
        return runs

    screening = run_screening(make_design("full", NAMES[:3], model=model), evaluate)
    page = page_of(screening, trials_of(reference, NAMES[:3]))
    assert "trial 3, load middle: the run diverged at 1.2 s" in page
    assert ("all interactions, because the model contains main effects only" in page) == (
        model == "main"
    )


def test_page_of_one_factor_has_no_interactions(reference):
    """Take one factor with a model of interactions, as `--factor gasket.stiffness_x` gives."""
    design = make_design("full", ["C_L"])
    page = page_of(of_y(design, 2.0 + design.levels[:, 0]), trials_of(reference, ["C_L"]))
    assert "Main effects, load middle" in page
    assert "Strongest interaction" not in page


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (123.4, "123"),
        (12.34, "12.3"),
        (-1.234, "−1.23"),
        (0.01234, "0.0123"),
        (0.99999, "1.00"),
        (np.nan, "–"),
    ],
)
def test_three_digits(value, text):
    assert three_digits(value) == text
