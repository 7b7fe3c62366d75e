"""What `wm-drake study design` prints and writes."""

import json
from pathlib import Path

import pandas as pd
import pytest

pytest.importorskip("pymoo")

PROFILE = "time: (0, 1) s\nspeed: (0, 60) rpm\n"
TASK = """loads: [middle]
vary:
  k: {keys: [spring_types.suspension.stiffness], low: 50 %, high: 150 %}
  m: {keys: [bodies.motor.mass], low: 90 %, high: 110 %}
objectives:
- {quantity: Dx}
- {quantity: bodies.motor.mass}
constraints:
- {quantity: gap, at_least: 1 mm}
"""


@pytest.fixture
def study(wm_drake):
    """Return a function that runs a small study of one second with extra arguments."""
    Path("p.yaml").write_text(PROFILE)
    Path("d.yaml").write_text(TASK)
    common = ("--profile", "p.yaml", "--out", "out", "--population", "8")
    return lambda *arguments: wm_drake("study", "design", "d.yaml", *common, *arguments)


def test_study_writes_front_and_machines(study, wm_drake):
    ended = study("--evaluations", "16", "--json")
    assert ended.code == 0
    printed = json.loads(ended.out)
    assert printed["history"][-1]["evaluations"] == 16
    assert {"design", "Dx_mm", "bodies.motor.mass_kg", "k_percent"} <= set(printed["front"][0])
    front = pd.read_csv("out/front.csv")
    assert list(front["Dx_mm"]) == sorted(front["Dx_mm"])
    assert wm_drake("machine", "check", "out/machine_best_Dx.yaml").code == 0
