"""A measure in one file outside the package goes through every door; no file of wm_drake knows it.

Two processes use it: one that registers it by a function, and one that finds it by an entry point.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

FILE = Path(__file__).parent / "largest_jerk.py"
NAME = "largest_jerk"
SHORT = """extends: reference
name: short
profile: {time: "(0, 1.5) s", speed: "(60, 200) rpm"}
"""
TOLERANCES = """about: friction
loads: middle
vary:
  friction: {keys: [damper_types.friction.friction_force], distribution: uniform, low: 15 N, high: 25 N}
"""
LIMITS = "limits:\n  - {quantity: largest_jerk_Xr, at_most: 1000 m/s^3, allowed_share: 50 %}\n"
DESIGN = """loads: [middle]
vary:
  friction: {keys: [damper_types.friction.friction_force], low: 15 N, high: 25 N}
objectives:
- {quantity: largest_jerk_Xr, goal: smaller, over: worst}
- {quantity: Dx, goal: smaller, over: worst}
constraints:
- {quantity: largest_jerk_Zf, at_most: 1e6 m/s^3, over: worst}
"""
COMMANDS = {
    "spin": ("spin", "--load", "middle", "--json"),
    "compared": ("spin", "--load", "middle", "--compare-gasket", "--json"),
    "gasket": ("study", "gasket", "--load", "middle", "--trials", "24", "--model", "main", "--response", NAME, "--json"),
    "tolerance": ("study", "tolerance", "friction.yaml", "--samples", "64", "--sensitivity", "0", "--subset", "0",
                  "--response", NAME, "--limits", "limits.yaml", "--json"),
    "design": ("study", "design", "design.yaml", "--evaluations", "16", "--population", "8", "--json"),
}  # fmt: skip
"""Commands, each writing to the folder of its name."""

IN_PROCESS = """
import contextlib, io, json, sys
from pathlib import Path

import wm_drake as wm
from wm_drake.cli import main

def run(name, words):
    sys.argv = ["wm-drake", *words, "--machine", "short.yaml", "--out", name]
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        try:
            main()
        except SystemExit as ended:
            assert not ended.code, (name, ended.code, printed.getvalue())
    Path(f"{name}.json").write_text(printed.getvalue())

for name, words in json.loads(sys.argv[1]).items():
    run(name, words)

parameters = wm.load_machine("short.yaml")
from wm_drake.studio.answers import numbers, runner_of
from wm_drake.live.machine import OpenMachine
from wm_drake.live.state import PageState
opened = OpenMachine(parameters, wm.build_machine(parameters), wm.Scene(parameters))
state = PageState(machine="short", load="middle")
shown = numbers(opened, runner_of(opened), state, ["gasket.stiffness_x"])
Path("studio.json").write_text(json.dumps([shown["rows"], shown["arrows"]]))
"""

BY_FUNCTION = """
import numpy as np
import wm_drake as wm
from largest_jerk import LARGEST_JERK
from wm_drake.parameters import Load, SpinProfile, Unbalance
from wm_drake.simulation.measures import MEASURES

wm.register_measure(LARGEST_JERK)
machine = wm.build_machine(wm.load_machine("reference"))
profile = SpinProfile(time=(0.0, 2.0), speed=(8.0, 28.0))
cases = [
    wm.Case(f"{mass} kg", Load(unbalances=(Unbalance(mass=mass, radius=0.25, y=-0.05),)), profile)
    for mass in (0.2, 1.0, 90.0)
]
table = wm.simulate_many(machine, cases, measures=["largest_jerk"])
assert table.diverged.values[2] and table.largest_jerk.attrs["units"] == "m/s^3"
for run, case in enumerate(cases):
    jerk = wm.measure(wm.simulate(machine, case)).largest_jerk
    assert jerk.dims == ("sensor",)
    np.testing.assert_array_equal(table.largest_jerk.values[run], jerk.values)
assert table.largest_jerk.values[1].min() > table.largest_jerk.values[0].min() > 0.0
assert list(MEASURES).count("largest_jerk") == 1
"""


def python(folder, script, *words):
    """Run a script in a process of its own that finds the modules of a folder."""
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script, *words],
        cwd=folder, env={**_environment(), "PYTHONPATH": str(folder)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def _environment():
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder of results, written by a process in which an entry point names the measure."""
    folder = tmp_path_factory.mktemp("jerk")
    (folder / "largest_jerk.py").write_text(FILE.read_text())
    info = folder / "jerk-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: jerk\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        f"[wm_drake.measures]\n{NAME} = largest_jerk:LARGEST_JERK\n"
    )
    inputs = {"short": SHORT, "friction": TOLERANCES, "limits": LIMITS, "design": DESIGN}
    for name, text in inputs.items():
        (folder / f"{name}.yaml").write_text(text)
    ended = python(folder, IN_PROCESS, json.dumps(COMMANDS))
    assert ended.returncode == 0, ended.stderr
    return folder


def test_no_file_of_the_package_knows_it():
    package = Path(__file__).parents[2] / "wm_drake"
    for path in package.rglob("*"):
        if path.suffix in (".py", ".html", ".js", ".yaml"):
            assert "jerk" not in path.read_text(encoding="utf-8"), path


def test_a_record_equals_a_lane(tmp_path):
    (tmp_path / "largest_jerk.py").write_text(FILE.read_text())
    ended = python(tmp_path, BY_FUNCTION)
    assert ended.returncode == 0, ended.stderr


def test_spin_prints_it_and_its_page_shows_it(folder):
    shown = json.loads((folder / "spin.json").read_text())
    (jerk,) = shown["largest_jerk"]
    sensors = [row["sensor"] for row in shown["sensors"]]
    assert min(jerk[f"{sensor}_m_per_s3"] for sensor in sensors) > 0.0
    page = (folder / "spin" / "report.html").read_text(encoding="utf-8")
    assert "Largest jerk of the filtered displacement at each sensor." in page


def test_differences_of_two_machines_have_it(folder):
    table = pd.read_csv(folder / "compared" / "differences.csv")
    of_jerk = table[table["measure"] == "largest jerk"]
    assert len(of_jerk) == 6
    assert set(of_jerk["unit"]) == {"m/s^3"}


def test_gasket_study_takes_it_as_responses(folder):
    printed = (folder / "gasket.json").read_text()
    assert json.loads(printed)
    assert "largest_jerk_Xr" in printed


def test_tolerances_limit_it(folder):
    printed = json.loads((folder / "tolerance.json").read_text())
    (row,) = (row for row in printed["measures"] if row["quantity"] == "largest_jerk_Xr")
    assert row["unit"] == "m/s^3"
    samples = pd.read_csv(folder / "tolerance" / "samples.csv")
    (column,) = (name for name in samples if "jerk_Xr" in name)
    assert samples[column].std() > 0.0


def test_a_design_makes_it_small(folder):
    front = pd.read_csv(folder / "design" / "front.csv")
    (column,) = (name for name in front if "jerk_Xr" in name)
    assert np.isfinite(front[column]).all()
    assert any("jerk_Zf" in name for name in front)


def test_studio_shows_it_with_its_arrow(folder):
    rows, (arrow,) = json.loads((folder / "studio.json").read_text())
    places = [place for place, row in enumerate(rows) if row["title"] == "largest jerk Xr, m/s^3"]
    assert len(places) == 1
    assert rows[places[0]]["value"] > 0.0
    assert arrow["changes"][places[0]] != 0.0
