"""Tests of `wm-drake calibrate`: its files, its resumption, and its errors for bad input."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, with_value
from wm_drake.simulation.cases import case_of
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate

SHORT = "extends: reference\nname: short\nmeasured: []\nprofile: {time: '(0, 12) s', speed: '(40, 270) rpm'}\n"
FREE = """vary:
  friction: {bounds: "(10, 60) N", prior: "(30, 10) N", sets: damper_types.friction.friction_force, source: test}
  radius:
    bounds: (230, 250) mm
    prior: (240, 5) mm
    sets: loads.middle.unbalances.0.radius
    source: test
"""
TRUTH = 38.0
SENSORS = ["Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a machine, a vary file, and amplitudes for another friction force."""
    (tmp_path / "short.yaml").write_text(SHORT)
    (tmp_path / "free.yaml").write_text(FREE)
    machine = build_machine(load_machine(tmp_path / "short.yaml"))
    parameters = with_value(machine.parameters, "damper_types.friction.friction_force", TRUTH)
    parameters = with_value(parameters, "loads.middle.unbalances.0.radius", 0.24)
    rows = []
    for name in ("middle", "back"):
        case = case_of(parameters, name)
        amplitude = measure(
            simulate(machine, type(case)(name, case.load, case.profile, True, parameters))
        ).amplitude
        rows.append([name, "yes", "experiment", *(1e3 * amplitude.values)])
    pd.DataFrame(rows, columns=["load", "gasket", "source", *SENSORS]).to_csv(
        tmp_path / "measured.csv", index=False
    )
    return tmp_path


COMMAND = "calibrate --machine short.yaml --vary free.yaml --targets measured.csv --starts 1"


@pytest.mark.usefixtures("folder")
def test_planted_friction_comes_back_from_command_line_to_report(wm_drake):
    command = f"{COMMAND} --deviation 1 --leave-out back --limit 20"
    ended = wm_drake(command, "--json", "--out", "out")
    assert ended.code == 0, ended.err
    result = json.loads(ended.out)
    friction, radius = result["estimates"]
    assert friction["value"] == pytest.approx(TRUTH, abs=0.5)
    assert friction["lower_95"] < friction["value"] < friction["upper_95"]
    assert friction["held_by"] == "data"
    assert radius["unit"] == "mm"
    assert result["searches"][0]["largest_percent"] < 2.0
    assert result["predictions"][0]["held_out"] == "back"
    names = {path.name for path in Path("out").iterdir()}
    assert names == {
        "report.html", "machine_1.yaml", "estimates.csv", "solutions.csv", "correlations.csv", "amplitudes.csv", "differences.csv",
        "predictions.csv", "intervals_back.csv", "critical_speeds.csv", "gaps.csv", "searches.csv",
        "next_steps.csv", "ledger.sqlite", "run.json",
    }  # fmt: skip
    written = load_machine(Path("out/machine_1.yaml"))
    assert written.damper_types["friction"].friction_force == pytest.approx(
        friction["value"], abs=0.01
    )
    assert written.sources["damper_types.friction.friction_force"].startswith("fit: friction")
    assert written.name == "short_calibrated_1"
    table = pd.read_csv("out/amplitudes.csv")
    assert np.allclose(
        *(
            table[table.source == source][[f"{name}_mm" for name in SENSORS]]
            for source in ("experiment", "solution 1")
        ),
        rtol=0.03,
    )
    again = wm_drake(command, "--json", "--out", "out")
    # a finished calibration is read back
    assert json.loads(again.out) | {"wall_s": 0.0} == result | {"wall_s": 0.0}
    shown = wm_drake(command, "--out", "out").out
    value = next(line for line in shown.splitlines() if "friction" in line)
    assert f"{friction['value']:.4g}" in value
    assert " N " in value
    assert "data" in value
