"""Tests of `wm-drake study gasket`: output, bad input, kills, full disks, parallel processes."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from simple_machines import SPONGES

import wm_drake as wm
from wm_drake.parameters import load_machine
from wm_drake.studies.inputs import changed_parameters

WITH_TABLE = """extends: reference
gasket:
  stiffness_x: {displacement: '(-30, -15, 0, 15, 30) mm', force: '(-140, -46, 0, 46, 140) N'}
"""
PROFILE = "time: (0, 2) s\nspeed: (60, 200) rpm\n"
NAMES = ("contributions", "design", "effects", "leading_terms", "runs", "variance")
TABLES = [f"{name}.csv" for name in NAMES]
FRICTION = "damper_types.friction.friction_force"
FACTORS = ("--factor", "K_Lx", "--factor", "C_L", "--factor", f"{FRICTION}=20 N..30 N")
SMALL = ("--design", "full", *FACTORS, "--profile", "p.yaml")


@pytest.fixture
def study(wm_drake):
    """Return a function that runs a small study (27 trials, four loads) with extra arguments."""
    Path("p.yaml").write_text(PROFILE)
    return lambda *arguments: wm_drake("study", "gasket", *SMALL, "--out", "out", *arguments)


@pytest.fixture
def study_without_page(study, monkeypatch):
    """Return the small study without its figures, which take most of its time."""
    monkeypatch.setattr("wm_drake.studies.answer.Answer.page", lambda *_: "")
    return study


def tables(folder="out"):
    return {name: (Path(folder) / name).read_bytes() for name in TABLES}


def test_study_writes_tables_and_prints_them(study):
    ended = study()
    assert (ended.code, ended.err.strip()) == (0, "")
    assert "Percent of the variance explained (full, 27 trials, D-efficiency 100.00 %)" in ended.out
    assert set(TABLES) < {path.name for path in Path("out").iterdir()}
    runs = pd.read_csv("out/runs.csv")
    assert len(runs) == 108
    assert set(runs["load"]) == {"middle", "counter", "back", "front"}
    assert (runs[["Dx_mm", "Fy_N", "Mz_Nm"]] > 0.0).all(axis=None)
    # the tub of this short run is nearest to the housing before it moves: the gap does not vary
    percents = pd.read_csv("out/contributions.csv").drop(columns=["gap_percent", "term"])
    assert percents.groupby("load").sum().to_numpy() == pytest.approx(100.0)
    assert (runs["gap_mm"] > 0.0).all()
    assert runs["touches"].isna().all()
    stiffness = 1e-3 * load_machine("reference").gasket.stiffness_x.nominal_stiffness  # N/mm
    proposal = pd.read_csv("out/proposal_runs.csv")
    assert set(proposal["load"]) == set(runs["load"])
    assert "Line to copy: wm-drake spin --set" in ended.out
    levels = sorted(pd.read_csv("out/design.csv")["K_Lx_N_per_mm"].unique())
    assert levels == pytest.approx(stiffness * np.array([0.5, 1.0, 1.5]))


def test_json_says_how_well_the_model_predicts(study_without_page):
    ended = study_without_page("--json", "--load", "middle", "--response", "Dx")
    printed = json.loads(ended.out)
    (response,) = printed["variance"]
    assert response["residual_df"] == 8
    assert 0.9 < response["predicted_r2"] < response["adjusted_r2"] <= 1.0


def test_central_composite_design_of_a_program_has_a_quadratic_model(wm_drake):
    Path("p.yaml").write_text(PROFILE)
    star = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    star += [tuple(s if k == j else 0 for k in range(3)) for j in range(3) for s in (-1, 1)]
    rows = [f"{k},1,1,{x},{y},{z}" for k, (x, y, z) in enumerate([*star, *3 * [(0, 0, 0)]], 1)]
    head = "StdOrder,PtType,Blocks,C_L,K_Lx,K_Ly"
    Path("own.csv").write_text("\n".join([head, *rows]))
    factors = [word for name in ("C_L", "K_Lx", "K_Ly") for word in ("--factor", name)]
    own = ("--design", "own.csv", *factors, "--profile", "p.yaml", "--load", "middle")
    ended = wm_drake("study", "gasket", *own, "--response", "D", "--out", "out")
    assert ended.code == 0, ended.err
    assert "2 repeated trials run once" in ended.err
    assert len(pd.read_csv("out/runs.csv")) == 15
    assert set(pd.read_csv("out/coefficients.csv")["term"]) >= {"C_L^2", "C_L:K_Lx"}
    given = wm_drake("study", "gasket", *own, "--model", "main+2fi", "--out", "other")
    assert given.code == 2
    assert "use --model main" in given.err


@pytest.mark.slow
def test_own_design_factor_file_and_one_worker_give_the_same(study_without_page, wm_drake):
    study_without_page()
    shutil.copy("out/design.csv", "mine.csv")
    own = ("study", "gasket", *FACTORS, "--design", "mine.csv", "--profile", "p.yaml")
    assert wm_drake(*own, "--out", "own").code == 0
    assert tables("own") == tables()
    Path("factors.yaml").write_text(
        "vary:\n"
        "  K_Lx: {keys: [gasket.stiffness_x], low: 50 %, high: 150 %}\n"
        "  C_L:\n"
        "    keys: [gasket.damping_x, gasket.damping_y, gasket.damping_z]\n"
        "    low: 50 %\n"
        "    high: 150 %\n"
        f"  {FRICTION}: {{low: 20 N, high: 30 N}}\n"
    )
    command = "study gasket --vary factors.yaml --design full --profile p.yaml --workers 1"
    assert wm_drake(command, "--out", "other").code == 0
    assert tables("other") == tables()


def test_disk_that_is_full_at_the_end_costs_no_run(study_without_page, monkeypatch, no_runs):
    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as changed:
        changed.setattr("wm_drake.studies.answer.Answer.tables", full)
        ended = study_without_page()
    assert (ended.code, len(ended.err.strip().splitlines())) == (2, 1)
    assert "out: cannot be written to: No space left on device; all runs are kept" in ended.err
    assert [path.name for path in Path("out").iterdir()] == ["ledger.sqlite"]
    no_runs()
    assert study_without_page().code == 0


def test_other_study_or_sources_in_the_folder_are_refused_and_kept(study_without_page, monkeypatch):
    study_without_page()
    before = tables()
    for arguments, word in (
        (("--load", "middle"), "loads is"),
        (("--set", "gravity=9.8 m/s^2"), "machine is"),
        (("--factor", "K_Ty"), "design is"),
    ):
        ended = study_without_page(*arguments, "--resume")
        assert ended.code == 2
        assert "out: holds another study or version: " in ended.err
        assert word in ended.err
    assert tables() == before
    monkeypatch.setattr("wm_drake.batch.sources_version", lambda: "0123")
    ended = study_without_page("--resume")
    assert ended.code == 2
    assert "and '0123' now" in ended.err


def test_diverging_trial_is_said_and_left_out(study):
    Path("violent.yaml").write_text("unbalances: [{mass: 800 kg, radius: 300 mm, y: 100 mm}]\n")
    ended = study("--load", "violent.yaml")
    assert ended.code == 2
    assert "runs failed; the others do not determine the effects" in ended.err


def test_trial_too_stiff_for_the_step_is_refused_by_name(study):
    ended = study("--factor", "spring_types.suspension.stiffness=8 N/mm..4e4 N/mm")
    assert ended.code == 2
    assert re.search(r"case \d+ '.*': step: 2.5 ms is too long for the tub", ended.err)


# a study in a process of its own: one load, runs of one second, 65 trials of a D-optimal design
OWN = (
    "study gasket --factor K_Lx --factor K_Lz --factor C_L --factor C_T --trials 65 "
    "--load middle --profile p.yaml --workers 1"
)


def start(folder, *arguments, **options):
    (folder / "p.yaml").write_text("time: (0, 8) s\nspeed: (0, 60) rpm\n")
    page = "from wm_drake.studies.answer import Answer as R; R.page = lambda *_: ''"
    code = f"{page}; from wm_drake.cli import main; main()"  # no figures: most of its time
    command = [sys.executable, "-c", code, *OWN.split(), *arguments]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    )


@pytest.mark.slow
def test_second_study_on_the_folder_is_refused_while_the_first_runs(tmp_path):
    first = start(tmp_path, "--out", "out")
    ledger = tmp_path / "out" / "ledger.sqlite"
    while not (ledger.exists() and ledger.stat().st_size):  # locked once it holds something
        time.sleep(0.01)
    first.send_signal(signal.SIGSTOP)
    second = start(tmp_path, "--out", "out", "--resume")
    message = second.communicate()[1]
    first.send_signal(signal.SIGCONT)
    assert second.returncode == 2
    assert "out/ledger.sqlite: is in use by another study that runs now" in message
    first.communicate()
    assert first.returncode == 0
    assert set(TABLES) < {path.name for path in (tmp_path / "out").iterdir()}


def test_published_results_that_a_user_names_are_beside_ours(study_without_page):
    Path("known.csv").write_text(
        "load,response,term,percent,effects\nmiddle,Dx,constant,,1000\nmiddle,Dx,C_L,50,1 -1\n"
    )
    Path("with_table.yaml").write_text(WITH_TABLE)
    machine = ("--machine", "with_table.yaml", "--published", "known.csv")
    ended = study_without_page(*machine, "--load", "middle", "--response", "Dx")
    assert ended.code == 0
    assert pd.read_csv("out/variance.csv")["published_mean"].tolist() == [1000.0]
    table = pd.read_csv("out/published.csv")
    assert list(table["term"]) == ["C_L", "C_L", "C_L"]
    assert list(table["published_effect"]) == [1.0, -1.0, 0.0]
    zero = pd.read_csv("out/level_zero.csv")
    assert (zero["machine"] > 0.0).all()


def test_another_profile_is_not_compared_with_published_results(study_without_page):
    one = ("--machine", SPONGES, "--load", "middle", "--response", "Dx")
    printed = json.loads(study_without_page("--json", *one).out)
    assert "published" not in printed
    assert "published_mean" not in printed["variance"][0]
    assert "level_zero" not in printed  # without tables, level 0 is the machine


def test_level_zero_of_a_machine_with_tables_is_beside_the_machine(study_without_page):
    Path("with_table.yaml").write_text(WITH_TABLE)
    ended = study_without_page(
        "--machine", "with_table.yaml", "--json", "--load", "middle", "--response", "Dx"
    )
    printed = json.loads(ended.out)
    (row,) = printed["level_zero"]
    assert row["unit"] == "mm"


def test_own_design_of_values_is_that_of_single_runs(wm_drake):
    Path("p.yaml").write_text(PROFILE)
    places = np.array([(x, y) for x in (-1.0, 0.3, 1.2) for y in (-0.8, 0.1, 1.0)])
    rows = [f"{100 + 50 * x:.6g} %,{100 + 50 * y:.6g} %" for x, y in places]
    Path("own.csv").write_text("\n".join(["K_Lx,C_L", *rows]))
    own = ("--design", "own.csv", "--factor", "K_Lx", "--factor", "C_L", "--profile", "p.yaml")
    chosen = ("--load", "middle", "--response", "amplitude_Xr")
    ended = wm_drake("study", "gasket", *own, *chosen, "--out", "out")
    assert ended.code == 0, ended.err
    runs = pd.read_csv("out/runs.csv")
    np.testing.assert_allclose(runs[["K_Lx", "C_L"]], places, atol=1e-9)
    stiffness, damping = rows[6].split(",")  # beyond the range
    changed = changed_parameters(load_machine("reference"), [f"K_Lx={stiffness}", f"C_L={damping}"])
    case = wm.Case("middle", changed.loads["middle"], wm.load_profile("p.yaml"))
    measured = wm.measure(wm.simulate(wm.build_machine(changed), case))
    amplitude = 1e3 * float(measured.amplitude.sel(sensor="Xr"))
    (column,) = [name for name in runs.columns if name.startswith("value")]
    assert runs[column][6] == pytest.approx(amplitude, rel=1e-6)
    # three places each determine squares: the quadratic model has 6 of the 9
    fits = pd.read_csv("out/fits.csv")
    assert fits["r2"].between(0.0, 1.0).all()
    levels = wm_drake("study", "gasket", *own, "--model", "main", "--out", "main")
    assert levels.code == 2
    assert "quadratic" in levels.err
