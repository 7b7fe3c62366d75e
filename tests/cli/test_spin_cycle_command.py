"""Tests of `wm-drake study spin-cycle`: output, files, resumption after interruption, bad input."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from machine_with_bearing import BEARING, UNITS

from wm_drake.simulation.records import versions

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


def test_prints_one_json_object_and_writes_what_it_says(study):
    ended = study("--json")
    assert (ended.code, len(ended.out.splitlines())) == (0, 1)
    shown = json.loads(ended.out)
    assert [case["case"] for case in shown["cases"]] == ["front", "both"]
    tensions = [case["smallest_spring_tension_N"] for case in shown["cases"]]
    assert all(min(found.values()) >= 0.0 for found in tensions)
    assert list(tensions[0]) == ["left", "right", "rear"]
    slack = any(0.0 in found.values() for found in tensions)
    assert slack == ("Springs go slack" in Path("out/report.html").read_text(encoding="utf-8"))
    rms = np.array([case["rms_mm"] for case in shown["cases"]])
    assert rms.shape == (2, 2, 3, 3)
    assert rms.min() > 0.0
    assert sorted(path.name for path in Path("out").iterdir()) == [
        "cases.csv", "feet.csv", "ledger.sqlite", "report.html", "rms.csv", "run.json",
    ]  # fmt: skip
    table = pd.read_csv("out/rms.csv")
    np.testing.assert_allclose(table["rms_mm"].to_numpy().reshape(rms.shape), rms, rtol=1e-5)
    page = Path("out/report.html").read_text(encoding="utf-8")
    feet = pd.read_csv("out/feet.csv").set_index(["case", "part"])
    for case in shown["cases"]:
        parts = {"run": case["feet"], **case["feet"]["regions"]}
        assert list(parts) == ["run", "R1", "R2"]
        for part, values in parts.items():
            for key in ("smallest_normal_force_N", "slide_margin_N", "turn_margin_Nm"):
                assert feet.loc[(case["case"], part), key] == pytest.approx(values[key], rel=1e-5)
                assert parts["run"][key] <= values[key]
        assert case["feet"]["slide_margin_N"] > 0.0
        assert case["mount_force_N"]["gasket"]["peak"] > case["mount_force_N"]["gasket"]["rms"] > 0
    assert "Forces on the floor" in page
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
    assert [case["rms_mm"] for case in shown["cases"]] == [
        case["rms_mm"] for case in first["cases"]
    ]
    assert max(shown["relative_error"]["by_region_mean"]) < 1e-5
    assert "average error" in Path("out/report.html").read_text(encoding="utf-8")


def test_drakes_engine_runs_a_case_too(study):
    shown = {}
    for engine in ("drake", "compiled"):
        ended = study("--json", "--case", "front", "--engine", engine, "--overwrite")
        assert ended.code == 0
        shown[engine] = json.loads(ended.out)["cases"][0]
    for name in ("rms_mm", "rms_from_acceleration_mm"):
        np.testing.assert_allclose(shown["drake"][name], shown["compiled"][name], rtol=5e-4)
    for key in ("smallest_normal_force_N", "slide_margin_N", "turn_margin_Nm"):
        assert shown["drake"]["feet"][key] == pytest.approx(
            shown["compiled"]["feet"][key], rel=5e-3
        )
    for mount, force in shown["compiled"]["mount_force_N"].items():
        assert shown["drake"]["mount_force_N"][mount] == pytest.approx(force, rel=5e-3)
    # Drake's distance of two shapes is good to some micrometres
    np.testing.assert_allclose(
        shown["drake"]["smallest_gap_mm"], shown["compiled"]["smallest_gap_mm"], atol=1e-2
    )


def test_a_machine_with_a_motor_has_its_measures_in_json_table_and_page(study):
    ended = study("--json", "--case", "front", "--machine", "motor")
    assert ended.code == 0
    case = json.loads(ended.out)["cases"][0]
    table = pd.read_csv("out/drive.csv").set_index("case").loc["front"]
    for key in ("peak_torque_Nm", "mean_torque_Nm", "speed_ripple_percent"):
        assert table[key] == pytest.approx(case["motor"][key], rel=1e-5)
        assert case["motor"][key] > 0.0
    assert case["motor"]["caught_rpm"] is None
    assert "speed ripple" in Path("out/report.html").read_text(encoding="utf-8")


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
    error = shown["relative_error"]["by_region_mean"][1]
    (front,) = (np.array(case["rms_mm"][1]) for case in shown["cases"] if case["case"] == "front")
    expected = np.linalg.norm(front - 2.0 / np.sqrt(2.0)) / np.linalg.norm(
        np.full(9, 2.0 / np.sqrt(2.0))
    )
    assert error == pytest.approx(expected, rel=0.02)


def test_a_drum_that_can_whirl_is_run_and_said(study, whirling_file):
    shown = json.loads(study("--machine", whirling_file, "--json").out)
    plain = json.loads(study("--out", "perfect", "--json").out)
    rms, perfect = (np.array([case["rms_mm"] for case in told["cases"]]) for told in (shown, plain))
    assert 1e-5 < np.abs(rms / perfect - 1.0).max() < 0.05
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "The drum bearing is compliant, so the drum can whirl" in page
    assert "radial stiffness is 4000 N/mm and the tilting stiffness 50000 N m/rad" in page
