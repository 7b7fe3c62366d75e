"""Tests of the gasket page, for any number of loads, factors and responses."""

import re

import numpy as np
import pandas as pd
import pytest

from wm_drake.parameters import GASKET_FACTORS, levels_of, load_factors
from wm_drake.report.gasket.findings import about_residual, conflicts, load_findings, summary
from wm_drake.report.gasket.report import gasket_report
from wm_drake.report.gasket.tables import digits
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe import make_design
from wm_drake.studies.gasket.screening import Responses, run_screening
from wm_drake.studies.gasket.study import RESPONSES, GasketTrials

NAMES = ("C_L", "C_T", "K_Lx", "K_Ly")
UNITS = {name: {"D": "mm", "F": "N", "M": "N m"}[name[0]] for name in RESPONSES}


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
    return Responses({"middle": frame, "towel & co": frame * 1.5}, UNITS, {})


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


def test_words_come_from_the_numbers(screening):
    found = load_findings(screening, "middle")
    assert found[0] == "Dx (mean 20.0 mm) falls by 4.00 mm from level −1 to +1 of C_L (100 %)."
    assert found[1] == "Dy (mean 8.67 mm) is lowest at level 0 of C_T, by up to 1.00 mm (100 %)."
    assert found[5] == "Fz (mean 30.0 N) depends on the interaction K_Lx × K_Ly (100 %)."
    assert conflicts(screening, "middle") == ["Load middle: raising C_L lowers Dx but raises Mx."]
    text = summary(screening)
    assert (
        "162 runs: 81 trials of 4 factors (full, D-efficiency 100.00 %) with load middle and load towel & co."
        in text
    )
    assert "It consists of the interactions of three and more factors." in about_residual(screening)


def test_page_is_whole(screening, trials):
    page = gasket_report(screening, trials, "wm-drake study gasket", 12.0)
    assert "load towel &amp; co" in page
    assert page.count("<figure>") == 1 + 3 + 2 * 4
    sources = re.findall(r'<img src="([^"]{0,20})', page)
    assert len(sources) == 12
    assert all(source.startswith("data:image/") for source in sources)
    for text in (
        "0.0095 N s/mm",
        "gasket.damping_z",
        "D-efficiency for main+2fi",
        "wm-drake study gasket",
        "K_Lx × K_Ly",
    ):
        assert text in page
    assert not re.search(r"[>( ](nan|NaN)[<) ]", page)


@pytest.mark.parametrize("model", ["main", "main+2fi"])
def test_page_of_few_factors_and_failed_runs(trials, model):
    def evaluate(design):
        rng = np.random.default_rng(0)
        frame = pd.DataFrame(rng.uniform(1.0, 2.0, (design.trials, 9)), columns=RESPONSES)
        frame["Fy"] = 0.0  # a response that does not vary
        frame.loc[2] = np.nan
        return Responses({"middle": frame}, UNITS, {(2, "middle"): "the run diverged at 1.2 s"})

    page = gasket_report(
        run_screening(make_design("full", NAMES[:3], model=model), evaluate), trials
    )
    assert "Trial 3, load middle: the run diverged at 1.2 s" in page
    assert ("all interactions, because the model contains main effects only" in page) == (
        model == "main"
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [(123.4, "123"), (12.34, "12.3"), (-1.234, "−1.23"), (0.01234, "0.0123"), (np.nan, "–")],
)
def test_three_digits(value, text):
    assert digits(value) == text
