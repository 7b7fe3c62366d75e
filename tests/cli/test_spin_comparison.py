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
    assert printed["title"] == "Comparison of machines reference and soft"
    amplitudes = pd.DataFrame(printed["amplitudes"]).set_index("variant")
    assert amplitudes["load"].to_dict() == {"reference": "middle", "soft": "middle"}  # of both
    (row,) = [
        row for row in printed["differences"] if (row["measure"], row["of"]) == ("amplitude", "Xr")
    ]
    assert row["unit"] == "mm"
    assert [row["value_reference"], row["value_soft"]] == amplitudes.Xr_mm.tolist()
    change = 100.0 * (row["value_soft"] / row["value_reference"] - 1.0)
    assert row["change_soft_percent"] == pytest.approx(change)
    assert abs(change) > 0.1  # softer springs move another way
    assert {path.name for path in Path("out").iterdir()} == {
        "amplitudes.csv", "differences.csv", "record_reference_middle.nc", "record_soft_middle.nc",
        "replay_reference_middle.html", "replay_soft_middle.html", "report.html",
        "report_reference.html", "report_soft.html", "run.json",
    }  # fmt: skip
    assert len(pd.read_csv("out/differences.csv")) == len(printed["differences"])
    page = Path("out/report.html").read_text()
    assert '<a href="report_soft.html">' in page
    assert "replay_soft_middle.html" in Path("out/report_soft.html").read_text()


def test_with_and_without_gasket(wm_drake, monkeypatch):
    monkeypatch.setattr("wm_drake.report.page.plotly_of", lambda figure: {})
    Path("steady.yaml").write_text("time: (0, 2, 6) s\nspeed: (0, 200, 200) rpm\n")
    arguments = ("--compare-gasket", "--load", "middle", "--profile", "steady.yaml", "--json")
    ended = wm_drake("spin", *arguments, "--out", "out")
    assert ended.code == 0, ended.err
    printed = json.loads(ended.out, parse_constant=pytest.fail)
    table = pd.DataFrame(printed["differences"]).set_index(["measure", "of"])
    force = table.loc[("gasket force", "x")]
    assert force["value_with gasket"] > 0.0
    assert pd.isna(force[["value_without gasket", "change_with gasket_percent"]]).all()
    sources = pd.DataFrame(printed["amplitudes"])[["variant", "gasket"]]
    assert sources.to_numpy().tolist() == [["without gasket", "no"], ["with gasket", "yes"]]
    amplitude = table.loc["amplitude"]
    change = 100.0 * (amplitude["value_with gasket"] / amplitude["value_without gasket"] - 1.0)
    assert amplitude["change_with gasket_percent"].tolist() == pytest.approx(change.tolist())
    assert abs(change.iloc[0]) > 0.1
    assert any(name.startswith("steady amplitude at ") for name, _ in table.index)
    # another profile than the measured one
    assert "measured_change_with gasket_percent" not in table.columns


def test_parts_of_file_names_are_safe_and_differ():
    assert file_parts(["a", "A", "b, with gasket", "../../etc", "µ", "[/]"]) == [
        "a", "A_2", "b_with_gasket", "etc", "5", "6",
    ]  # fmt: skip
