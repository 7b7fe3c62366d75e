"""Tests of `wm-drake study tolerance`: output, doubling, resuming, bad input."""

import json
from pathlib import Path

import pandas as pd
import pytest

PROFILE = "time: (0, 1) s\nspeed: (0, 300) rpm\n"
TOLERANCES = """loads: middle
vary:
  mass: {keys: [loads.middle.unbalances.0.mass], distribution: uniform, low: 1 kg, high: 12 kg}
  radius: {keys: [loads.middle.unbalances.0.radius], distribution: uniform, low: 95 %, high: 105 %}
"""
LIMITS = "limits:\n- {quantity: gap, at_least: 0 mm, allowed_share: 0.1 %}\n"


@pytest.fixture
def study(wm_drake):
    """Return a function that runs a small study of one second with extra arguments."""
    for name, text in (("p", PROFILE), ("t", TOLERANCES), ("l", LIMITS)):
        Path(f"{name}.yaml").write_text(text)
    common = ("--profile", "p.yaml", "--out", "out", "--subset", "0")
    return lambda *arguments: wm_drake("study", "tolerance", "t.yaml", *common, *arguments)


def test_study_writes_tables_and_page_and_prints_json(study):
    few = ("--response", "gap", "--response", "Dx", "--response", "mount_force_peak_springs.left")
    ended = study("--samples", "16", "--sensitivity", "16", "--limits", "l.yaml", "--json", *few)
    assert ended.code == 0
    printed = json.loads(ended.out)
    assert printed["runs"] == 16 + 48 + 4
    (contact,) = printed["contact_probability"]
    assert contact["method"] == "crude count"
    measures = {row["quantity"]: row for row in printed["measures"]}
    assert {"unit", "p5", "p50", "p95"} <= set(measures["smallest_gap"])
    of = {(row["measure"], row["quantity"]): row["total"] for row in printed["sobol"]}
    assert of["Dx", "mass"] > of["Dx", "radius"]
    assert len(printed["limits"]) == 1
    samples = pd.read_csv("out/samples.csv")
    touching = (samples["smallest_gap_mm"] <= 0.0).mean()
    assert contact["probability_percent"] == pytest.approx(100.0 * touching)
    page = Path("out/report.html").read_text()
    assert "in a million" not in page
    assert page.index('id="smallest-gap"') < page.index('id="distributions"')
    assert [row["load"] for row in printed["loads"]] == ["middle", "counter", "back", "front"]


def test_doubling_keeps_the_finished_runs(study, no_runs):
    settings = ("--sensitivity", "0", "--response", "gap")
    assert study("--samples", "16", *settings).code == 0
    few = pd.read_csv("out/samples.csv")
    assert study("--samples", "32", *settings).code == 0
    many = pd.read_csv("out/samples.csv")
    pd.testing.assert_frame_equal(few, many[:16])
    no_runs()
    assert study("--samples", "16", *settings, "--workers", "1").code == 0
    pd.testing.assert_frame_equal(few, pd.read_csv("out/samples.csv"))
