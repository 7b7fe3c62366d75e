"""Tests of what a user expects of any command: version, help, quiet, pipes, a module to run."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from ordinary_machine import ORDINARY

import wm_drake as wm
from wm_drake.parameters import load_machine, shipped_machines
from wm_drake.report.progress import progress_bar

RIG = ("rig", "damper", "-f", "1 Hz", "-a", "5 mm", "--out", "out")
VERSION = r"wm_drake \d+\.\d+\.\d+, revision \w+.*\n"


def test_version(wm_drake):
    ended = wm_drake("--version")
    assert ended.code == 0
    assert re.fullmatch(VERSION, ended.out)
    assert wm.__version__ in ended.out


def test_module_runs_as_the_command(tmp_path):
    ended = subprocess.run(
        [sys.executable, "-m", "wm_drake", "--version"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.fullmatch(VERSION, ended.stdout)


@pytest.mark.parametrize("command", [(), ("spin",), ("rig", "gasket"), ("study", "gasket")])
def test_short_help(wm_drake, command):
    ended = wm_drake(*command, "--help")
    assert (ended.code, "Usage: " in ended.out) == (0, True)
    assert wm_drake(*command, "-h").out == ended.out


def test_completion_is_offered(wm_drake):
    assert "--install-completion" in wm_drake("--help").out


def test_package_shows_its_names_only():
    names = [name for name in dir(wm) if not name.startswith("__")]
    assert names == wm.__all__
    assert {"load_machine", "build_machine", "simulate", "register_measure"} <= set(names)
    assert all(hasattr(wm, name) for name in names)


def test_quiet_prints_errors_and_json_only(wm_drake):
    assert wm_drake(*RIG, "--quiet").out == ""
    ended = wm_drake(*RIG, "-q", "--overwrite", "--json")
    assert json.loads(ended.out)["measures"][0]["peak_force_N"] > 0.0
    assert wm_drake(*RIG).out == ""  # refused
    assert "Results in out" in wm_drake(*RIG, "--overwrite").out
    ended = wm_drake(*RIG, "--quiet")
    assert (ended.code, len(ended.messages)) == (2, 1)
    assert wm_drake("machine", "check", "reference", "--quiet").out == ""


def test_tables_in_a_pipe_are_not_wrapped(wm_drake, monkeypatch):
    monkeypatch.delenv("COLUMNS")
    rig = ("rig", "damper", "-f", "1,2 Hz", "-a", "5 mm", "--overwrite")
    wide = wm_drake(*rig).out.splitlines()
    monkeypatch.setenv("COLUMNS", "80")
    narrow = wm_drake(*rig).out.splitlines()
    assert len(wide) < len(narrow)
    assert max(map(len, narrow[:-2])) <= 80 < max(map(len, wide[:-2]))  # sentences are the last


def test_progress_in_a_pipe_is_lines(capsys, monkeypatch):
    monkeypatch.setattr("wm_drake.report.progress.LINE_PERIOD", 0.0)
    with progress_bar(3, "loops") as progress:
        progress(1)
        progress(3)
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"loops: 1 of 3, 0 s\nloops: 3 of 3, 0 s\n", err)


def test_quiet_progress_prints_nothing(wm_drake, monkeypatch):
    monkeypatch.setattr("wm_drake.report.progress.LINE_PERIOD", 0.0)
    assert wm_drake(*RIG, "--quiet").err == ""
    assert wm_drake(*RIG, "--overwrite").err.startswith("loops: 1 of 1")


def test_brackets_in_a_name_are_printed_as_they_are(wm_drake):
    Path("[b]d[b].yaml").write_text("law: coulomb\nfriction_force: 20 N\n")
    ended = wm_drake("rig", "damper", "-f", "1 Hz", "-a", "5 mm", "--component", "[b]d[b].yaml")
    assert (ended.code, ended.err) == (0, "")
    assert "damper [b]d[b], law coulomb" in ended.out


def test_list_of_machines(wm_drake):
    names = list(shipped_machines())
    assert {"reference", "free_stroke"} <= set(names)
    lines = wm_drake("machine", "list").out.splitlines()
    assert [line.split()[0] for line in lines] == names
    assert sorted(json.loads(wm_drake("machine", "list", "--json").out)) == names


@pytest.mark.parametrize("base", ["reference", "free_stroke"])
def test_new_machine_is_valid_and_equals_its_base(wm_drake, base):
    ended = wm_drake("machine", "new", "mine", "--extends", base)
    assert ended.code == 0
    assert "wm-drake machine check mine.yaml" in ended.out
    assert wm_drake("machine", "check", "mine.yaml").code == 0
    kept = {"name", "about", "measured", "published"}
    assert load_machine("mine.yaml").model_dump(exclude=kept) == load_machine(base).model_dump(
        exclude=kept
    )


def test_comments_of_a_new_machine_are_its_numbers(wm_drake):
    """Remove all comment signs: the file then states every number of the base itself."""
    wm_drake("machine", "new", "mine")
    lines = Path("mine.yaml").read_text().splitlines()
    body = [line.removeprefix("# ") for line in lines[lines.index("") :]]
    Path("all.yaml").write_text("\n".join(["extends: reference", "name: all", *body]))
    kept = {"name", "about", "measured", "published", "sources"}
    assert load_machine("all.yaml").model_dump(exclude=kept) == load_machine(
        "reference"
    ).model_dump(exclude=kept)
    assert any(line.startswith("gasket:") for line in body)


def test_new_machine_extends_a_file_in_another_folder(wm_drake):
    wm_drake("machine", "new", "base")
    Path("variants").mkdir()
    assert wm_drake("machine", "new", "variants/soft", "--extends", "base.yaml").code == 0
    assert wm_drake("machine", "check", "variants/soft.yaml").code == 0


UNUSUAL = (
    "extends: reference\nname: bad\nloads: {middle: {unbalances: [{mass: 800 kg, radius: 240 mm, "
    "y: 0 mm}]}}\nspring_types: {suspension: {stiffness: 6.5 N/m}}\n"
)


def test_unusual_values_are_warned_of_and_strict_refuses_them(wm_drake):
    Path("bad.yaml").write_text(UNUSUAL)
    ended = wm_drake("machine", "check", "bad.yaml")
    assert (ended.code, ended.out) == (0, "bad.yaml: machine 'bad' is valid\n")
    assert ended.messages[:2] == [
        "warning: bad.yaml:4: spring_types.suspension.stiffness: 0.0065 N/mm is unusual; usual is "
        "1 to 60 N/mm",
        "warning: bad.yaml:3: loads.middle.unbalances.0.mass: 800 kg is unusual; usual is 0 to 5 "
        "kg",
    ]
    assert "springs.left: is too soft" in ended.messages[2]
    strict = wm_drake("machine", "check", "bad.yaml", "--strict")
    assert (strict.code, strict.out) == (2, "")
    assert [f"warning: {line}" for line in strict.messages] == ended.messages
    Path("ordinary.yaml").write_text(ORDINARY)
    assert wm_drake("machine", "check", "ordinary.yaml", "--strict").code == 0


def test_phase_error_without_effect_is_said(wm_drake):
    Path("profile.yaml").write_text("time: (0, 2) s\nspeed: (0, 100) rpm\n")
    ended = wm_drake(
        *("spin", "--load", "middle", "--profile", "profile.yaml", "--out", "out"),
        *("--set", "imperfections.phase_error=5 deg"),
    )
    (message,) = ended.messages
    assert message.startswith("warning: imperfections.phase_error has no effect on the loads")
    assert "imperfections.phase_error has no effect" in Path("out/report.html").read_text()


def test_set_null_removes_an_element(wm_drake):
    shown = json.loads(wm_drake("machine", "show", "--json", "--set", "dampers.left=null").out)
    assert list(shown["dampers"]) == ["right_rear", "right_front"]
