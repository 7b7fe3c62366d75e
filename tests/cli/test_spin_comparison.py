"""`wm-drake spin` with several machines, or with and without gasket."""

import json
from pathlib import Path

import pandas as pd
import pytest

from wm_drake.studies.spin.task import file_parts

PROFILE = "steps:\n- {ramp_to: 100 rpm, rate: 50 rpm/s}\n"
SOFT = (
    "name: soft\nextends: reference\n"
    "spring_types: {suspension: {stiffness: 8 N/mm}}\n"
    "loads: {back: null, front: null, counter: null, extra: {unbalances: []}}\n"
)


def spin(wm_drake, *arguments):
    Path("p.yaml").write_text(PROFILE)
    return wm_drake("spin", "--profile", "p.yaml", "--out", "out", *arguments)


def of_machines(*names):
    return [word for name in names for word in ("--machine", name)]


def test_two_machines_on_one_page(wm_drake, monkeypatch):
    Path("soft.yaml").write_text(SOFT)
    monkeypatch.setattr("wm_drake.report.page.plotly_of", lambda figure: {})
    ended = spin(wm_drake, *of_machines("reference", "soft.yaml"), "--json", "--replay")
    assert (ended.code, ended.err) == (0, "")
    printed = json.loads(ended.out, parse_constant=pytest.fail)
    assert set(printed) == {"engine", "variants", "differences", "wall_s"}
    assert [(v["name"], v["machine"]) for v in printed["variants"]] == [
        ("reference", "reference"),
        ("soft", "soft"),
    ]
    # the only load that both have
    assert [[c["load"] for c in v["cases"]] for v in printed["variants"]] == [["middle"]] * 2
    of_reference, of_soft = (v["cases"][0]["amplitudes_mm"]["Xr"] for v in printed["variants"])
    (row,) = [
        row
        for row in printed["differences"]
        if (row["measure"], row["name"]) == ("amplitude", "Xr")
    ]
    assert (row["reference"], row["variant"], row["unit"]) == ("reference", "soft", "mm")
    assert row["difference"] == pytest.approx(of_soft - of_reference)
    assert row["percent"] == pytest.approx(100.0 * (of_soft / of_reference - 1.0))
    assert abs(row["percent"]) > 0.1  # softer springs move another way
    assert {path.name for path in Path("out").iterdir()} == {
        "amplitudes.csv", "differences.csv", "record_reference_middle.nc", "record_soft_middle.nc",
        "replay_reference_middle.html", "replay_soft_middle.html", "report.html",
        "report_reference.html", "report_soft.html", "run.json",
    }  # fmt: skip
    table = pd.read_csv("out/differences.csv")
    assert len(table) == len(printed["differences"])
    page = Path("out/report.html").read_text()
    assert "Comparison of machines reference and soft" in page
    assert '<a href="report_soft.html">' in page
    assert "replay_soft_middle.html" in Path("out/report_soft.html").read_text()


def test_with_and_without_gasket(wm_drake, monkeypatch):
    monkeypatch.setattr("wm_drake.report.page.plotly_of", lambda figure: {})
    Path("steady.yaml").write_text("time: (0, 2, 6) s\nspeed: (0, 200, 200) rpm\n")
    arguments = ("--compare-gasket", "--load", "middle", "--profile", "steady.yaml", "--json")
    ended = wm_drake("spin", *arguments, "--out", "out")
    assert ended.code == 0, ended.err
    table = pd.read_csv("out/differences.csv").set_index(["measure", "name"])
    assert table.loc[("gasket force", "x"), "reference_value"] > 0.0
    assert pd.isna(table.loc[("gasket force", "x"), "value"])
    sources = pd.read_csv("out/amplitudes.csv")[["variant", "gasket"]].drop_duplicates()
    assert sources.to_numpy().tolist() == [["with gasket", "yes"], ["without gasket", "no"]]
    printed = json.loads(ended.out, parse_constant=pytest.fail)
    assert printed["steady_window_s"] == [4.0, 6.0]
    effect = pd.read_csv("out/effect.csv")
    assert effect["sensor"].tolist() == [row["sensor"] for row in printed["effect"]]
    for row in printed["effect"]:
        assert row["percent"] == pytest.approx(100 * (row["with_mm"] / row["without_mm"] - 1))
        assert row["experiment_percent"] is None  # another profile than the measured one
    assert abs(effect["percent"][0]) > 0.1
    page = Path("out/report.html").read_text()
    assert "<h2>Effect of the gasket</h2>" in page
    assert "Amplitudes at constant speed" in page


def test_parts_of_file_names_are_safe_and_differ():
    assert file_parts(["a", "A", "b, with gasket", "../../etc", "µ", "[/]"]) == [
        "a", "A_2", "b_with_gasket", "etc", "5", "6",
    ]  # fmt: skip
