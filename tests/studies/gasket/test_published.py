"""Published results and level 0 beside a screening, on responses with known effects."""

import numpy as np
import pytest
import xarray as xr
from simple_machines import with_gasket_tables

from wm_drake.parameters import (
    PublishedTerm,
    varying,
)
from wm_drake.parameters.reading import SI, US, read_in
from wm_drake.parameters.units import Unit
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.parameters.varying import TABLES
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket.screening import (
    at,
    compared_terms,
    leaders,
    mean_difference,
    published_for,
    run_screening,
    runs_of,
    sign_differs,
)
from wm_drake.studies.gasket.study import GasketTrials, run_level_zero
from wm_drake.studies.gasket.tables import leading_table, published_table, variance_table
from wm_drake.studies.gasket.words import Words

NAMES = ("C_L", "K_Lx", "K_Ly")
LENGTH = Quantity("length", Unit("m", "mm"))
DX, DY = ("middle", "Dx"), ("middle", "Dy")


def planted(design):
    """Return Dx = 20 - 2 C_L, of which C_L has all the variance, and Dy = 10 + C_L K_Lx. [mm]"""
    a, b = design.levels[:, 0].astype(float), design.levels[:, 1].astype(float)
    one = {"Dx": 1e-3 * (20.0 - 2.0 * a), "Dy": 1e-3 * (10.0 + a * b)}
    return runs_of({"middle": one, "counter": one}, {"Dx": LENGTH, "Dy": LENGTH})


@pytest.fixture(scope="module")
def screening():
    return run_screening(make_design("full", NAMES), planted)


@pytest.fixture(scope="module", params=[SI, US])
def published(screening, request):
    """Return published numbers, which are in SI units of the trade whatever results are read in."""
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
    with read_in(request.param):
        return published_for(results, screening, "table.csv")


def test_differences_from_the_published_results(screening, published):
    difference = mean_difference(screening, published)
    assert at(difference, DX).item() == pytest.approx(0.25)
    assert at(difference, DY).item() == pytest.approx(4.0 / 6.0)
    assert np.isnan(difference.sel(load="counter")).all()
    # ours are 100 and 0 %
    assert leaders(screening, published) == {DX: ("C_L", "C_L")}
    of = at(published, DX)
    assert (of.smallest, of.largest, of.main) == (0.015, 0.017, 0.95)
    assert np.isnan(of.interaction)
    assert not published_for({("back", "Dx"): {}}, screening)


def test_term_with_its_factors_in_another_order_is_found(published):
    of = at(published, DY)
    assert of.share.sel(term="C_L:K_Lx") == 0.9
    # in the file K_Lx is the first factor: its level changes slowest
    effect = 1e3 * of.effect.sel(term="C_L:K_Lx")
    found = [
        effect.sel(level=a, other_level=b).item()
        for a, b in ((-1, "-1"), (0, "-1"), (-1, "0"), (1, "1"))
    ]
    assert found == pytest.approx([0.0, 1.0, 3.0, 8.0])


def test_effects_with_another_sign_are_marked(screening):
    known = {DX: {"C_L": PublishedTerm(90.0, (-1.0, 0.0, 1.0))}}
    turned = published_for(known, screening, "table.csv")
    differs = sign_differs(screening, turned)
    assert (int(differs.sum()), bool(at(differs, DX).sel(term="C_L"))) == (1, True)
    table = leading_table(screening, turned, Words(levels(screening), screening)).table()
    (row,) = [row for group in table.groups for row in group.rows if row.kind == "alarm"]
    assert row.cells[1].endswith("C_L")


def test_tables_have_published_numbers_beside_ours(screening, published):
    words = Words(levels(screening), screening)
    variance = variance_table(screening, published, words)
    frame = variance.frame().set_index(["load", "response"])
    assert frame.loc[DX, ["mean", "published_mean"]].tolist() == pytest.approx([20.0, 16.0])
    assert frame.loc[DX, "difference_percent"] == pytest.approx(25.0)
    assert (frame.loc[DX, "is_far"], frame.loc[DY, "is_far"]) == (False, True)
    assert np.isnan(frame.loc[("counter", "Dx"), "published_mean"])
    marked = [row.kind for group in variance.table().groups for row in group.rows]
    assert marked == ["", "alarm", "", ""]
    plain = variance_table(screening, xr.Dataset(), words).frame()
    assert not [name for name in plain if "published" in name]

    rows = published_table(screening, published).frame().set_index(["response", "term"])
    assert rows.loc[("Dx", "C_L"), "published_contribution_percent"].tolist() == [60.0] * 3
    assert rows.loc[("Dx", "C_L"), "published_effect"].tolist() == pytest.approx([1.0, 0.5, -1.5])
    assert set(rows.index) == {("Dx", "C_L"), ("Dx", "K_Lx"), ("Dy", "C_L:K_Lx")}
    assert int(compared_terms(published).sum()) == 3


def levels(screening):
    """Return factors with the names of a screening, for words."""
    from wm_drake.parameters import load_machine

    known, names = gasket_entries(), screening.design.factors
    return varying(load_machine("reference"), {name: known[name] for name in names}).every


def fake_simulate(machine, _measures, cases, _what):
    """Return responses of a machine that has the gasket's force at 30 mm as its displacement."""
    value = machine.parameters.gasket.stiffness_x
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


def test_level_zero_is_the_machine_if_tables_are_scaled(reference):
    machine = with_gasket_tables(reference)
    known = {"K_Lx": gasket_entries()["K_Lx"]}
    every = {name: varying(machine, known, tables=name) for name in TABLES}
    loads = [Case("middle", machine.loads["middle"], machine.profile)]
    trials = GasketTrials(every["scaled"], loads, ["D"])
    zero = at(run_level_zero(machine, every, trials, fake_simulate), ("middle", "Dx"))
    assert zero.machine.item() == pytest.approx(1e-3 * machine.gasket.stiffness_x.force[-1])
    assert zero.scaled_difference.item() == 0.0
    slope = every["linear"].at_levels([0]).gasket.stiffness_x
    hardening = 0.03 * slope / machine.gasket.stiffness_x.force[-1] - 1.0
    assert zero.linear_difference.item() == pytest.approx(hardening)
    assert hardening < -0.1


@pytest.mark.parametrize("factor", ["C_L", "K_Lx"])
def test_level_zero_is_not_run_without_tables(sponges, factor):
    known = {factor: gasket_entries()[factor]}
    every = {name: varying(sponges, known, tables=name) for name in TABLES}
    assert not run_level_zero(sponges, every, None, None)
