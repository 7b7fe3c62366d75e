"""Published results and level 0 beside a screening, on responses with known effects."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from simple_machines import with_gasket_tables

from wm_drake.parameters import (
    GASKET_FACTORS,
    TABLES,
    PublishedTerm,
    at_levels,
    levels_of,
    load_factors,
)
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket import tables as texts
from wm_drake.studies.gasket.findings import level_zero_text, summary
from wm_drake.studies.gasket.page import GasketResult
from wm_drake.studies.gasket.proposal import Compared
from wm_drake.studies.gasket.screening import Responses, Words, published_for, run_screening
from wm_drake.studies.gasket.study import GasketTrials, run_level_zero
from wm_drake.studies.gasket.tables import as_plain_data

NAMES = ("C_L", "K_Lx", "K_Ly")


def planted(design):
    """Return Dx = 20 - 2 C_L, of which C_L has all the variance, and Dy = 10 + C_L K_Lx."""
    a, b = design.levels[:, 0].astype(float), design.levels[:, 1].astype(float)
    frame = pd.DataFrame({"Dx": 20.0 - 2.0 * a, "Dy": 10.0 + a * b})
    return Responses({"middle": frame, "counter": frame}, {"Dx": "mm", "Dy": "mm"}, {})


@pytest.fixture(scope="module")
def screening():
    return run_screening(make_design("full", NAMES), planted)


@pytest.fixture(scope="module")
def published():
    results = {
        ("middle", "Dx"): {
            "constant": PublishedTerm(None, (16.0,)),
            "C_L": PublishedTerm(60.0, (1.0, 0.5, -1.5)),
            "K_Lx": PublishedTerm(29.0, ()),
            "main effects": PublishedTerm(95.0, ()),
            "range": PublishedTerm(None, (15.0, 17.0)),
        },
        ("middle", "Dy"): {
            "constant": PublishedTerm(None, (6.0,)),
            "K_Lx:C_L": PublishedTerm(90.0, tuple(map(float, range(9)))),
        },
        ("middle", "Fx"): {"constant": PublishedTerm(None, (1.0,))},
        ("back", "Dx"): {"constant": PublishedTerm(None, (1.0,))},
    }
    labels = [(load, name) for load in ("middle", "counter") for name in ("Dx", "Dy")]
    return published_for(results, labels, "table.csv")


def test_differences_from_the_published_results(screening, published):
    assert set(published.terms) == {("middle", "Dx"), ("middle", "Dy")}
    assert published.mean_difference(screening, ("middle", "Dx")) == pytest.approx(25.0)
    assert published.mean_difference(screening, ("counter", "Dx")) is None
    far = published.far_means(screening)
    assert far == {("middle", "Dy"): pytest.approx(100.0 * 4.0 / 6.0)}
    # ours are 100 and 0; 29 points are not far, 40 are
    assert published.leaders(screening)["middle", "Dx"] == ("C_L", "C_L")
    assert published.range(("middle", "Dx")) == (15.0, 17.0)
    assert published.sums(("middle", "Dx")) == (95.0, None)
    points = published.far_contributions(screening)
    assert points == {(("middle", "Dx"), "C_L"): pytest.approx(40.0)}


def test_term_with_its_factors_in_another_order_is_found(screening, published):
    (term,) = [t for t in screening.tables["middle", "Dy"].terms if t.name == "C_L:K_Lx"]
    assert published.percent(("middle", "Dy"), term) == 90.0
    effects = published.effects(("middle", "Dy"), term)
    # in the file K_Lx is the first factor: its level changes slowest
    assert (effects[-1, -1], effects[0, -1], effects[-1, 0], effects[1, 1]) == (0.0, 1.0, 3.0, 8.0)


def test_effects_with_another_sign_are_marked(screening):
    known = {("middle", "Dx"): {"C_L": PublishedTerm(90.0, (-1.0, 0.0, 1.0))}}
    turned = published_for(known, screening.tables, "table.csv")
    assert turned.other_signs(screening) == [(("middle", "Dx"), "C_L")]
    shown = texts.leading(screening, "middle", Words(levels(screening), {}), turned)
    (row,) = [row for row in shown.groups[0].rows if "sign differs" in row.cells[0]]
    assert row.kind == "alarm"
    text = " ".join(summary(screening, Words((), {}), Compared(turned)))
    assert "The most influential factor is the published one in 1 of 1 cases." in text
    assert "differ from the published ones by 10.0 points of percent in the mean" in text
    assert "another sign than the published ones: 1 of 1: C_L on Dx, load middle." in text


def test_tables_and_files_have_published_numbers_beside_ours(screening, published, tmp_path):
    words = Words(levels(screening), {})
    found = texts.variance(screening, words, published)
    assert found.header[4:6] == ("published mean", "difference")
    first, second = found.shown[0].rows
    assert (first.cells[2:5], first.kind) == (("20.0", "16.0", "+25 %"), "")
    assert (second.cells[2:5], second.kind) == (("10.0", "6.00", "+67 %"), "alarm")
    assert found.shown[1].rows[0].cells[3:5] == ("–", "–")
    shown = texts.leading(screening, "middle", words, published)
    assert shown.header[2:4] == ("percent", "published percent")
    cells = [row.cells for row in shown.groups[0].rows]
    assert cells[:2] == [
        ("constant", "", "", "20.0", "", ""),
        ("published constant", "", "", "16.0", "", ""),
    ]
    assert [c[1:3] for c in cells if "C_L" in c[0] or "K_Lx" in c[0]] == [
        ("100.0", "60.0"),
        ("0.0", "29.0"),
    ]
    assert ("published effect", "", "", "1.00", "0.500", "−1.50") in cells
    assert len(texts.variance(screening, words).header) == len(found.header) - 5

    GasketResult(screening, SimpleNamespace(factors=()), Compared(published)).write(tmp_path)
    table = pd.read_csv(tmp_path / "published.csv").set_index(["response", "term"])
    assert table.loc[("Dx", "constant"), "published_effect"] == 16.0
    assert table.loc[("Dx", "C_L"), "published_percent"].tolist() == [60.0] * 3
    assert table.loc[("Dx", "range"), "published_effect"].tolist() == [15.0, 17.0]
    assert table.loc[("Dx", "main effects"), "published_percent"] == 95.0
    data = as_plain_data(screening, Compared(published))
    response = data["responses"]["middle"]["Dx"]
    assert (data["published"], response["published_mean"]) == ("table.csv", 16.0)
    assert response["mean_difference_percent"] == pytest.approx(25.0)
    assert response["terms"][0]["published_effects"] == {"-1": 1.0, "0": 0.5, "1": -1.5}
    assert response["terms"][0]["sign_differs"] is False
    assert (response["published_main_percent"], response["published_range"]) == (95.0, [15.0, 17.0])
    assert "published_mean" not in data["responses"]["counter"]["Dx"]
    assert "published" not in as_plain_data(screening)


def levels(screening):
    """Return factors with the names of a screening, for words."""
    from wm_drake.parameters import load_machine

    known = load_factors(GASKET_FACTORS)
    names = screening.design.factors
    return levels_of(load_machine("reference"), {name: known[name] for name in names})


def fake_run(parameters, cases):
    """Return responses of a machine that has the gasket's force at 30 mm as its displacement."""
    value = parameters.gasket.stiffness_x
    force = 0.03 * value if isinstance(value, float) else value.force[-1]
    shape = (len(cases), 3)
    values = np.full(shape, 1e-3 * force)
    return xr.Dataset(
        {
            "detergent_displacement": (("run", "axis"), values),
            "diverged": ("run", np.full(len(cases), "", dtype=object)),
        },
        {"run": range(len(cases))},
    )


@pytest.mark.parametrize("tables", TABLES)
def test_level_zero_is_the_machine_if_tables_are_scaled(reference, tables):
    machine = with_gasket_tables(reference)
    known = {"K_Lx": load_factors(GASKET_FACTORS)["K_Lx"]}
    every = {name: levels_of(machine, known, name) for name in TABLES}
    loads = [Case("middle", machine.loads["middle"], machine.profile)]
    trials = GasketTrials(machine, every[tables], loads, ["D"])
    zero = run_level_zero(machine, every, tables, trials, fake_run)
    label = ("middle", "Dx")
    assert zero.value(label, "machine") == pytest.approx(machine.gasket.stiffness_x.force[-1])
    assert zero.difference(label, "scaled") == 0.0
    slope = at_levels(machine, every["linear"], [0]).gasket.stiffness_x
    hardening = 100.0 * (0.03 * slope / machine.gasket.stiffness_x.force[-1] - 1.0)
    assert zero.difference(label, "linear") == pytest.approx(hardening)
    assert hardening < -10.0
    text = level_zero_text(zero, Words(every[tables], {}))
    assert text.startswith(
        "Level 0 of the study is the machine."
        if tables == "scaled"
        else "Level 0 of this study is not the machine"
    )
    assert f"by up to {-hardening:.1f} %" in text
    assert list(zero.frame()["scaled_difference_percent"]) == [0.0] * 3


@pytest.mark.parametrize("factor", ["C_L", "K_Lx"])
def test_level_zero_is_not_run_without_tables(sponges, factor):
    known = {factor: load_factors(GASKET_FACTORS)[factor]}
    every = {name: levels_of(sponges, known, name) for name in TABLES}
    assert run_level_zero(sponges, every, "scaled", None, None) is None
