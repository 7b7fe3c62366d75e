"""Tests of `wm-drake study spin-cycle`: output, files, resumption after interruption, bad input."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from machine_with_bearing import BEARING, UNITS

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, load_profile
from wm_drake.parameters.recorded_sensors import recorded_test_of
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.records import versions
from wm_drake.simulation.runs import simulate
from wm_drake.studies.compare.task import sensor_points
from wm_drake.studies.spin_cycle.measured import RMS_COLUMNS

PROFILE = """
time: (0, 4, 6) s
speed: (60, 250, 250) rpm
regions: [{name: R1, begin: 0 s, end: 3 s}, {name: R2, begin: 3 s, end: 6 s}]
"""
CASES = "case,front_g,rear_g,phase_deg\nfront,400,0,0\nboth,400,400,180\n"
INPUT = ("--profile", "p.yaml", "--cases", "c.csv", "--machine", "reference")


@pytest.fixture
def study(wm_drake):
    def run(*arguments):
        Path("p.yaml").write_text(PROFILE)
        Path("c.csv").write_text(CASES)
        return wm_drake("study", "spin-cycle", *INPUT, "--out", "out", *arguments)

    return run


@pytest.fixture
def whirling_file(tmp_path):
    numbers = "\n".join(f"    {key}: {value} {UNITS[key]}" for key, value in BEARING.items())
    path = tmp_path / "whirling.yaml"
    path.write_text(
        f"name: whirling\nextends: reference\nstep: 0.5 ms\nimperfections:\n  bearing:\n{numbers}\n"
    )
    return path


def rms_of(shown, name="rms"):
    """Return the RMS displacements of a result as JSON, (case, region, sensor, axis). [mm]"""
    frame = pd.DataFrame(shown[name]).set_index(["case", "region", "sensor", "axis"])
    return frame.rms_mm.to_xarray().reindex(case=[row["case"] for row in shown["cases"]])


def test_prints_one_json_object_and_writes_what_it_says(study):
    ended = study("--json")
    assert (ended.code, len(ended.out.splitlines())) == (0, 1)
    shown = json.loads(ended.out)
    assert [case["case"] for case in shown["cases"]] == ["front", "both"]
    tensions = pd.DataFrame(shown["springs"]).smallest_spring_tension_N
    assert [row["spring"] for row in shown["springs"]] == ["left", "right", "rear"] * 2
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert (tensions >= 0.0).all()
    assert (tensions == 0.0).any() == ("Springs go slack" in page)
    rms = rms_of(shown)
    assert rms.shape == (2, 2, 3, 3)
    assert rms.min() > 0.0
    assert sorted(path.name for path in Path("out").iterdir()) == [
        "cases.csv", "displacements.csv", "feet.csv", "feet_regions.csv", "ledger.sqlite",
        "mounts.csv", "regions.csv", "report.html", "rms.csv", "rms_from_acceleration.csv",
        "run.json", "springs.csv",
    ]  # fmt: skip
    table = pd.read_csv("out/rms.csv")
    assert list(table) == RMS_COLUMNS
    np.testing.assert_allclose(table.rms_mm.to_numpy().reshape(rms.shape), rms, rtol=1e-5)
    feet = pd.read_csv("out/feet.csv").set_index("case")
    regions = pd.read_csv("out/feet_regions.csv").set_index(["case", "region"])
    margins = ["smallest_foot_load_N", "slide_margin_N", "turn_margin_Nm"]
    for case, of_case in regions.groupby("case"):
        lowest = of_case[[f"region_{name}" for name in margins]].min().to_numpy()
        assert (feet.loc[case, margins] <= lowest + 1e-6 * abs(lowest)).all()
    assert (feet.slide_margin_N > 0.0).all()
    gasket = pd.DataFrame(shown["mounts"]).set_index("mount").loc["gasket"]
    assert (gasket.mount_force_peak_N > gasket.mount_force_rms_N).all()
    assert "Case both: 400 g at the front and 400 g at the rear, 180° apart" in page
    own = page.replace("http://www.w3.org", "").replace("https://doi.org/", "")
    assert not re.search(r"https?://", re.sub(r"<script.*?</script>", "", own, flags=re.DOTALL))
    assert versions()["drake"] in page


def test_second_time_nothing_is_run_and_its_own_table_is_a_perfect_measurement(study, no_runs):
    first = json.loads(study("--json").out)
    no_runs()
    again = study("--json", "--measured", "out/rms.csv", "--overwrite")
    assert again.code == 0
    shown = json.loads(again.out)
    assert shown["rms"] == first["rms"]
    assert max(region["mean_error_percent"] for region in shown["regions"]) < 1e-3
    assert pd.read_csv("out/measured.csv").equals(pd.read_csv("out/rms.csv"))
    assert "measured" not in first


def test_drakes_engine_runs_a_case_too(study):
    shown = {}
    for engine in ("drake", "compiled"):
        if shown:
            refused = study("--case", "front", "--resume")
            assert refused.code == 2
            assert "engine is 'drake' there and 'compiled' now" in refused.err
        ended = study("--json", "--case", "front", "--engine", engine, "--overwrite")
        assert ended.code == 0
        shown[engine] = json.loads(ended.out)
        page = Path("out/report.html").read_text(encoding="utf-8")
        assert re.search(rf"<dt>Engine</dt>\s*<dd>{engine}</dd>", page)
    drake, compiled = shown["drake"], shown["compiled"]
    for name in ("rms", "rms_from_acceleration"):
        np.testing.assert_allclose(rms_of(drake, name), rms_of(compiled, name), rtol=5e-4)
    for name in ("smallest_foot_load_N", "slide_margin_N", "turn_margin_Nm"):
        assert drake["feet"][0][name] == pytest.approx(compiled["feet"][0][name], rel=5e-3)
    ours, theirs = (pd.DataFrame(one["mounts"]).filter(like="_N") for one in (compiled, drake))
    np.testing.assert_allclose(theirs, ours, rtol=5e-3)
    # Drake's distance of two shapes is good to some micrometres
    gap, ours = (found["cases"][0]["smallest_gap_mm"] for found in (drake, compiled))
    assert gap == pytest.approx(ours, abs=1e-2)


def test_a_machine_with_a_motor_has_its_measures_in_json_table_and_page(study):
    ended = study("--json", "--case", "front", "--machine", "motor")
    assert ended.code == 0
    (motor,) = json.loads(ended.out)["drive"]
    table = pd.read_csv("out/drive.csv").set_index("case").loc["front"]
    for name in ("peak_torque_Nm", "mean_torque_Nm", "speed_ripple_percent"):
        assert table[f"drive_{name}"] == pytest.approx(motor[f"drive_{name}"], rel=1e-5)
        assert motor[f"drive_{name}"] > 0.0
    assert motor["drive_caught_speed_rpm"] is None


def test_measured_accelerations_are_integrated(study):
    time = 5e-3 * np.arange(1200)
    wave = 2e-3 * np.sin(2.0 * np.pi * 4.0 * time) * np.clip(time, 0.0, 1.0) ** 3
    channels = {
        f"S{sensor}_{axis}": -((2.0 * np.pi * 4.0) ** 2) * wave
        for sensor in (1, 2, 3)
        for axis in "xyz"
    }
    Path("records").mkdir()
    pd.DataFrame({"time_s": time, **channels}).to_csv("records/front.csv", index=False)
    shown = json.loads(study("--json", "--accelerations", "records").out)
    error = 0.01 * shown["regions"][1]["mean_error_percent"]
    front = rms_of(shown, "rms_recorded").sel(case="front", region="R2")
    expected = np.linalg.norm(front - 2.0 / np.sqrt(2.0)) / np.linalg.norm(
        np.full(9, 2.0 / np.sqrt(2.0))
    )
    assert error == pytest.approx(expected, rel=0.02)


def accelerations_of_the_machine():
    """Return time and signals of accelerometers with gravity, of the machine itself."""
    Path("c.csv").write_text(CASES)
    Path("p.yaml").write_text(PROFILE)
    machine = build_machine(load_machine("reference"))
    (case,) = (c for c in load_unbalance_cases(Path("c.csv")) if c.name == "front")
    run = simulate(machine, Case("front", case.load(machine.parameters), load_profile("p.yaml")))
    test = recorded_test_of(machine.parameters)
    points = sensor_points(machine, test)
    sensors = {n: s for n, s in test.sensors.items() if n[2:3] == "_"}
    signals = {n: recorded_signal(run, s, points[n]) for n, s in sensors.items()}
    return {"time_s": run.time.values, **signals}


def with_accelerations(study, signals, *words):
    """Return how the study ends with records of a case."""
    Path("records").mkdir()
    pd.DataFrame(signals).to_csv("records/front.csv", index=False)
    return study("--json", "--case", "front", "--accelerations", "records", *words)


def test_accelerometers_with_gravity_agree_with_a_perfect_machine(study):
    """Record the machine itself, with gravity along axes that turn with the tub."""
    ended = with_accelerations(study, accelerations_of_the_machine())
    shown = json.loads(ended.out)
    assert max(row["mean_error_percent"] for row in shown["regions"]) < 0.1
    assert "not like its prediction" not in ended.err
    without = rms_of(shown, "rms_recorded") / rms_of(shown) - 1.0
    assert np.abs(without).max() > 0.02  # what the sensors add to the motion


@pytest.mark.parametrize(
    ("channels", "factor", "cause"),
    [
        ({"S1_x": "S1_z", "S1_z": "S1_x"}, 1.0, "the channels of S1_x and S1_z are exchanged"),
        ({"S2_y": "S3_z", "S3_z": "S2_y"}, 1.0, "the channels of S2_y and S3_z are exchanged"),
        ({}, 1.0 / 9.80665, "are larger than declared by the factor 0.102 (g)"),
    ],
)
def test_accelerations_unlike_the_model_are_explained(study, channels, factor, cause):
    signals = accelerations_of_the_machine()
    time = signals.pop("time_s")
    turned = {name: factor * signals[channels.get(name, name)] for name in signals}
    ended = with_accelerations(study, {"time_s": time, **turned})
    assert ended.code == 0
    assert json.loads(ended.out)["regions"][1]["mean_error_percent"] > 1.0
    (text,) = (line for line in ended.err.splitlines() if "not like its prediction" in line)
    assert cause in text


FIT = ("study", "spin-identify", "--unknown", "damper_types.friction.friction_force=(20, 60) N")


def test_an_identification_says_what_accelerations_are_not_like(wm_drake):
    """Exchange two cables; then give the record of one case, with fewer digits, for another."""
    signals = accelerations_of_the_machine()
    signals["S1_x"], signals["S1_z"] = signals["S1_z"], signals["S1_x"]
    words = (*INPUT, "--accelerations", "records", "--json", "--out", "out")
    Path("records").mkdir()
    pd.DataFrame(signals).to_csv("records/front.csv", index=False)
    ended = wm_drake(*FIT, *words, "--case", "front")
    assert ended.code == 0, ended.err
    assert "the channels of S1_x and S1_z are exchanged" in ended.err
    pd.DataFrame(signals).round(3).to_csv("records/both.csv", index=False)
    for command in (FIT, ("study", "spin-cycle")):
        refused = wm_drake(*command, *words, "--case", "front", "--case", "both", "--overwrite")
        assert refused.code == 2
        assert "both.csv: has the same samples as records/front.csv" in refused.err


@pytest.mark.slow
def test_a_drum_that_can_whirl_is_run_and_said(study, whirling_file):
    shown = json.loads(study("--machine", whirling_file, "--json").out)
    plain = json.loads(study("--out", "perfect", "--json").out)
    assert 1e-5 < np.abs(rms_of(shown) / rms_of(plain) - 1.0).max() < 0.05
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "The drum bearing is compliant, so the drum can whirl" in page
    assert "radial stiffness is 4000 N/mm and the tilting stiffness 50000 N m/rad" in page
