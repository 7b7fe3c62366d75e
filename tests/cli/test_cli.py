"""Tests of the command `wm-drake`: its output, its files, and its errors for bad input."""

import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ordinary_machine import ORDINARY

from wm_drake import load_record
from wm_drake.cli import COMMANDS
from wm_drake.parameters import load_machine

SENSORS = ["Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]
PROFILE = "time: (0, 2) s\nspeed: (0, 100) rpm\n"
VIOLENT = "unbalances: [{mass: 800 kg, radius: 300 mm, y: 100 mm}]\n"  # the tub leaves its bounds


def test_check_of_the_reference(wm_drake):
    ended = wm_drake("machine", "check", "reference")
    assert (ended.code, ended.out) == (0, "reference: machine 'reference' is valid\n")
    # warnings of what is unusual (wm_drake/model/expectations.py), and nothing else
    assert all(line.startswith("warning: ") and " unusual" in line for line in ended.messages)


def test_check_of_several_machines_tells_all_problems(wm_drake):
    Path("good.yaml").write_text(ORDINARY)
    Path("typo.yaml").write_text("extends: reference\ngasket: {stifness_x: 3 N/mm}\n")
    Path("two.yaml").write_text("extends: reference\ngravity: 9 kg\noutput_period: -1 ms\n")
    ended = wm_drake("machine check good.yaml typo.yaml two.yaml nosuch.yaml --page pages")
    assert ended.code == 2
    assert ended.out.splitlines()[-1] == "good.yaml: machine 'ordinary' is valid"
    problems = [line for line in ended.messages if not line.startswith("warning: ")]
    assert [line.partition(":")[0] for line in problems] == [
        *("typo.yaml", "two.yaml", "two.yaml", "nosuch.yaml")
    ]
    alone = [wm_drake(f"machine check {name}.yaml").err for name in ("typo", "two", "nosuch")]
    assert "\n".join(problems) + "\n" == "".join(alone)
    assert not Path("pages").exists()


def test_check_of_several_machines_draws_a_page_of_each(wm_drake):
    Path("good.yaml").write_text(ORDINARY)
    ended = wm_drake("machine check good.yaml free_stroke good.yaml --page pages")
    assert ended.code == 0
    assert sorted(path.name for path in Path("pages").iterdir()) == [
        "free_stroke.html",
        "good.html",
    ]
    assert "ordinary" in Path("pages/good.html").read_text(encoding="utf-8")
    for page, words in {
        "pages/good.html": "folder",
        "pages": "good.yaml and ./good.yaml would have the same page",
    }.items():
        refused = wm_drake(f"machine check good.yaml ./good.yaml --page {page}")
        assert refused.code == 2
        assert words in refused.err


def test_shown_machine_obeys_set(wm_drake):
    shown = json.loads(
        wm_drake("machine show --json --set 'bodies.tub.mass=11 kg' --set 'gravity = 1 m/s^2'").out
    )
    assert shown["bodies"]["tub"]["mass"] == 11.0
    assert shown["gravity_W"] == [0.0, 0.0, -1.0]


def test_machine_is_shown_as_text(wm_drake, machine):
    ended = wm_drake("machine", "show", "reference")
    assert ended.code == 0
    assert ended.out.startswith("machine: reference\nunits: SI: m, kg, s, rad, N;")
    tub = machine.plant.GetBodyByName("tub")
    assert f"    mass: {tub.default_mass():.6g}\n" in ended.out


def spin(wm_drake, *arguments, load="middle"):
    Path("profile.yaml").write_text(PROFILE)
    ended = wm_drake(
        "spin", "--json", "--profile", "profile.yaml", "--out", "out", "--load", load, *arguments
    )
    return ended, strict_json(ended.out)


def strict_json(text):
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


@dataclass(frozen=True)
class PlainRun:
    """Run of the reference machine in a separate process, with its folder."""

    ended: subprocess.CompletedProcess
    folder: Path

    @property
    def shown(self):
        return strict_json(self.ended.stdout)

    def table(self, name):
        """Return a table of the result by its labels, as printed."""
        return table_of(self.shown, name)


def table_of(shown, name):
    """Return a table of a result in JSON, by its columns of text."""
    frame = pd.DataFrame(shown[name])
    return frame.set_index([column for column in frame if isinstance(frame[column][0], str)])


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    (folder / "profile.yaml").write_text(PROFILE)
    command = "spin --json --profile profile.yaml --out out --load middle --replay"
    return PlainRun(in_own_process(*command.split(), cwd=folder), folder)


def in_own_process(*arguments, cwd):
    command = [sys.executable, "-c", "from wm_drake.cli import main; main()", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def test_spin_prints_one_json_object(plain):
    assert plain.ended.returncode == 0
    printed = plain.shown
    assert (printed["machine"], printed["title"]) == ("reference", "Spin run of machine reference")
    assert printed["wall_s"] > 0.0
    (run,) = printed["runs"]
    assert (run["load"], run["gasket"], run["engine"]) == ("middle", "yes", "compiled")
    assert run["diverged"] == ""
    sensors = plain.table("sensors").loc["middle"]
    assert list(sensors.index) == SENSORS
    assert (sensors.amplitude_mm > 0.0).all()
    assert sensors.critical_speed_rpm.between(0.0, 100.0 + 1e-9).all()
    mounts = plain.table("mounts").loc["middle"]
    assert (mounts.index[0], mounts.index[-1]) == ("springs.left", "gasket")
    assert (mounts.peak_N > mounts["0 to 100 rpm_N"]).all()  # the profile has no regions
    margins = plain.table("margins").loc["middle"]
    assert list(margins.index) == ["whole run", "0 to 100 rpm"]
    assert margins.slide_margin_N.nunique() == 1
    assert 0.0 < margins.smallest_foot_load_N.iloc[0] < 250.0
    assert 0.0 < margins.slide_margin_N.iloc[0] < 0.4 * 80.0 * 9.81
    cabinet = plain.table("cabinet").loc["middle"]
    assert list(cabinet.index) == ["x", "y", "z"]
    assert (cabinet.cabinet_force_peak_N > cabinet.cabinet_force_dynamic_rms_N).all()
    assert 0.0 < printed["gaps"][0]["smallest_gap_mm"] < 100.0
    assert "walk" not in printed


def test_nothing_else_is_printed(plain):
    assert len(plain.ended.stdout.splitlines()) == 1
    lines = plain.ended.stderr.strip().splitlines()
    assert all(re.fullmatch(r"middle: \d+ %, .*", line) for line in lines)  # of a slow run


def test_result_files_are_there_and_nothing_beside_them(plain):
    tables = [name for name, value in plain.shown.items() if isinstance(value, list)]
    assert {str(path.relative_to(plain.folder)) for path in plain.folder.rglob("*")} == {
        *("out", "out/record_middle.nc", "out/replay_middle.html", "out/report.html"),
        *("out/run.json", "profile.yaml", *(f"out/{name}.csv" for name in tables)),
    }


def test_record_can_be_loaded_and_agrees(plain):
    record = load_record(plain.folder / "out" / "record_middle.nc")
    assert record.time.values == pytest.approx(np.arange(0.0, 2.0 + 1e-9, 0.005))
    assert (record.attrs["diverged"], record.attrs["load"], record.attrs["gasket"]) == (
        "",
        "middle",
        "yes",
    )
    largest = {
        "detergent_displacement_mm": 1e3 * record.detergent_displacement,
        "gasket_force_N": record.bushing_force.squeeze("bushing"),
    }
    printed = plain.table("largest")
    for name, values in largest.items():
        assert abs(values).max("time").values == pytest.approx(printed[name].tolist())


def test_table_of_amplitudes_agrees(plain):
    table = pd.read_csv(plain.folder / "out" / "amplitudes.csv")
    columns = [f"{name}_mm" for name in SENSORS]
    assert list(table.columns) == ["load", "gasket", "source", "band", *columns]
    (computed,) = table[table["source"] == "wm_drake"].to_dict("records")
    assert computed["band"] == "0.5 to 20 Hz"
    sizes = plain.table("sensors").amplitude_mm.tolist()
    assert [computed[name] for name in columns] == pytest.approx(sizes, rel=1e-8)


def test_replay_is_one_self_contained_page(plain):
    page = (plain.folder / "out" / "replay_middle.html").read_text(encoding="utf-8")
    assert is_self_contained(page)
    assert len(page) > 500_000  # the viewer is inside


def is_self_contained(page):
    """Return whether a page loads nothing from other places; links for reading are allowed."""
    loads = re.findall(r"<(?:script|img|iframe|source)[^>]*\ssrc=\"([^\"]{0,20})", page)
    loads += re.findall(r"<link[^>]*\shref=\"([^\"]{0,20})", page)
    return page.lstrip().lower().startswith("<!doctype html") and all(
        address.startswith("data:") for address in loads
    )


def test_without_gasket_there_is_no_gasket_force(wm_drake):
    _, printed = spin(wm_drake, "--no-gasket")
    assert printed["runs"][0]["gasket"] == "no"
    largest = pd.DataFrame(printed["largest"])
    assert largest[["gasket_force_N", "gasket_moment_Nm"]].isna().all(axis=None)
    assert "gasket" not in pd.DataFrame(printed["mounts"]).mount.tolist()
    assert load_record(Path("out/record_middle.nc")).attrs["gasket"] == "no"


def test_set_changes_the_result_and_is_recorded(wm_drake, plain):
    load = "loads.middle.unbalances.0.mass = 500 g"
    _, printed = spin(wm_drake, "--set", load, "--set", "gasket.damping_x=0.03 N s/mm")
    sizes = [shown["sensors"][0]["amplitude_mm"] for shown in (printed, plain.shown)]
    assert sizes[0] < 0.8 * sizes[1]
    attrs = load_record(Path("out/record_middle.nc")).attrs
    assert json.loads(attrs["load_parameters"])["unbalances"][0]["mass"] == 0.5
    assert json.loads(attrs["parameters"])["gasket"]["damping_x"] == pytest.approx(30.0)
    report = Path("out/report.html").read_text(encoding="utf-8")
    assert "gasket.damping_x" in report
    assert "set on the command line" in report


COMPARED = {
    "as it was measured": ((), True),
    "another load": (("--load", "heavy.yaml"), False),
    "another profile": (("--profile", "profile.yaml"), False),
    "a number changed": (("--set", "gasket.damping_x=0.03 N s/mm"), False),
    "a file that extends": (("--machine", "mine.yaml"), False),
    "measurements named": (("--machine", "mine.yaml", "--measured", "measured.csv"), True),
}


@pytest.mark.parametrize("kind", COMPARED)
def test_only_what_was_measured_is_judged_against_the_experiment(wm_drake, monkeypatch, kind):
    arguments, compared = COMPARED[kind]
    short = "profile: {time: '(0, 2) s', speed: '(0, 100) rpm'}\n"
    Path("own.yaml").write_text(f"extends: reference\nmeasured: [measured.csv]\n{short}")
    Path("mine.yaml").write_text("extends: own.yaml\n")
    Path("profile.yaml").write_text("time: (0, 2) s\nspeed: (0, 90) rpm\n")
    Path("heavy.yaml").write_text("unbalances: [{mass: 2 kg, radius: 200 mm, y: 0 mm}]\n")
    Path("measured.csv").write_text(
        f"load,gasket,source,{','.join(SENSORS)}\nmiddle,yes,experiment,1,1,1,1,1,1\n"
        "heavy,yes,experiment,1,1,1,1,1,1\n"
    )
    machine = () if "--machine" in arguments else ("--machine", "own.yaml")
    load = () if "--load" in arguments else ("--load", "middle")
    monkeypatch.setattr("wm_drake.studies.spin.page._envelopes_plot", lambda *_: None)
    assert wm_drake("spin", *machine, *load, *arguments, "--out", "out").code == 0
    sources = pd.read_csv("out/amplitudes.csv")["source"].tolist()
    assert sources == (["experiment", "wm_drake"] if compared else ["wm_drake"])


def test_load_file_equals_the_same_load_of_the_machine(wm_drake, plain):
    one = load_machine("reference").loads["middle"].unbalances[0]
    place = f"radius: {1e3 * one.radius:g} mm, y: {1e3 * one.y:g} mm"
    Path("towels.yaml").write_text(f"unbalances: [{{mass: 1 kg, {place}, phase: 0 deg}}]\n")
    _, printed = spin(wm_drake, load="towels.yaml")
    assert [run["load"] for run in printed["runs"]] == ["towels"]
    for name in ("sensors", "largest", "mounts", "margins"):
        assert [{**row, "load": "middle"} for row in printed[name]] == plain.shown[name]
    assert Path("out/record_towels.nc").is_file()


@pytest.mark.parametrize("replay", [(), ("--replay",)], ids=["", "replay"])
def test_diverging_run_exits_1_says_when_and_what_and_keeps_its_record(wm_drake, replay):
    Path("violent.yaml").write_text(VIOLENT)
    ended, printed = spin(wm_drake, *replay, load="violent.yaml")
    assert ended.code == 1
    (message,) = (text for text in ended.messages if text.startswith("violent: "))
    assert re.match(r"violent: the run diverged at \d+\.\d+ s: (roll|pitch|yaw|x|y|z) = ", message)
    assert message == f"violent: {printed['runs'][0]['diverged']}"
    record = load_record(Path("out/record_violent.nc"))
    assert f"violent: {record.attrs['diverged']}" == message
    assert record.time.size >= 1
    assert Path("out/amplitudes.csv").is_file()
    assert "diverged" in Path("out/report.html").read_text(encoding="utf-8")


def test_coulomb_friction_is_warned_of(wm_drake):
    Path("dry.yaml").write_text(
        "extends: reference\nname: dry\nprofile: {time: '(0, 0.2) s', speed: '(0, 10) rpm'}\n"
        "damper_types: {dry: {law: coulomb, friction_force: 22 N}}\ndampers: {left: {type: dry}}\n"
    )
    ended = wm_drake("spin", "--machine", "dry.yaml", "--load", "middle", "--out", "out")
    assert ended.code == 0
    assert ended.err.count("notice: Coulomb friction jumps where a damper reverses") == 1
    assert "Coulomb" not in wm_drake("machine", "check", "reference").err


def imported_by(code, folder):
    """Return the names of all modules that are imported after a program has run."""
    program = f"import sys\ntry:\n {code}\nfinally:\n print('\\n' + ' '.join(sys.modules))"
    ended = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True
    )
    return set(ended.stdout.splitlines()[-1].split())


def test_help_does_not_wait_for_slow_libraries(tmp_path):
    slow = {"pydrake", "numpy", "pandas", "scipy", "xarray", "plotly", "matplotlib"}
    imported = imported_by("from wm_drake.cli import main; sys.argv[1:] = ['-h']; main()", tmp_path)
    assert not (slow | {"pydantic", "wm_drake.studies", "wm_drake.report"}) & imported
    every = "from wm_drake.cli import COMMANDS, _command; list(map(_command, COMMANDS))"
    assert not slow & imported_by(every, tmp_path)


def test_a_shown_machine_does_not_wait_for_tables_and_statistics(tmp_path):
    show = "from wm_drake.cli import main; sys.argv[1:] = ['machine', 'show', 'reference']; main()"
    slow = {"pandas", "xarray", "pint", "h5py", "scipy.optimize", "scipy.stats", "matplotlib"}
    slow |= {"wm_drake.studies.run", "rich.progress"}
    imported = imported_by(show, tmp_path)
    assert "wm_drake.model.build" in imported
    assert not slow & imported


def test_a_spin_page_does_not_wait_for_solvers_and_statistics(tmp_path):
    modules = "wm_drake.studies.spin.page, wm_drake.studies.spin.task, wm_drake.studies.modes.study"
    slow = {"scipy.optimize", "scipy.stats", "scipy.signal", "matplotlib", "plotly"}
    assert not slow & imported_by(f"import {modules}", tmp_path)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_each_command_says(wm_drake, name):
    line = COMMANDS[name][1]
    assert line in " ".join(wm_drake("-h").out.split())
    assert line in " ".join(wm_drake(name, "-h").out.split())
