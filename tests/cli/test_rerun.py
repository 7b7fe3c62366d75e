"""Tests of `wm-drake rerun` and `wm-drake cite`: a study again from one file; the citation."""

import io
import re
import shutil
import sqlite3
import zipfile
from pathlib import Path

import pandas as pd
import pytest

from wm_drake.model.bodies import SDF_FOLDER
from wm_drake.report.provenance import version

PROFILE = "time: (0, 2) s\nspeed: (0, 300) rpm\n"


@pytest.fixture
def archive(wm_drake):
    """Return the archive of a study whose machine, SDF and profile are gone."""
    folder = Path("inputs")
    folder.mkdir()
    shutil.copy(SDF_FOLDER / "oscillating_group.sdf", folder / "mine.sdf")
    (folder / "p.yaml").write_text(PROFILE)
    (folder / "mine.yaml").write_text("extends: reference\nname: mine\nmodel: mine.sdf\n")
    study = ("--machine", "inputs/mine.yaml", "--profile", "inputs/p.yaml", "--load", "middle")
    sizes = ("--factor", "K_Lx", "--factor", "C_L", "--design", "full", "--workers", "1")
    words = ("--set", "gasket.stiffness_y=3 N/mm", *study, *sizes, "--archive", "a.zip")
    ended = wm_drake("study gasket", *words, "--out", "out")
    assert ended.code == 0, ended.err
    again = wm_drake("study gasket", *words, "--out", "other")
    assert again.code == 2
    assert "a.zip: exists" in again.err
    shutil.rmtree(folder)
    return Path("a.zip")


def test_study_is_the_same_again_from_one_file(wm_drake, archive):
    with zipfile.ZipFile(archive) as content:
        names = content.namelist()
    assert {"archive.json", "machine_0.json", "ledger.sqlite", "tables/runs.csv"} <= set(names)
    inputs = sorted(Path(name).name for name in names if name.startswith("inputs/"))
    assert inputs == ["mine.sdf", "p.yaml"]
    ended = wm_drake("rerun", archive, "--out", "again")
    assert ended.code == 0, ended.err + ended.out
    pd.testing.assert_frame_equal(pd.read_csv("again/runs.csv"), pd.read_csv("out/runs.csv"))


@pytest.mark.parametrize(
    "words", [("rig gasket", "--axis", "axial", "-f", "3 Hz", "-a", "5 mm"), ("calibrate",)]
)
def test_files_that_files_name_are_in_the_archive(wm_drake, words):
    folder = Path("inputs/below")
    folder.mkdir(parents=True)
    shutil.copy(SDF_FOLDER / "oscillating_group.sdf", folder.parent / "mine.sdf")
    (folder.parent / "base.yaml").write_text("extends: reference\nname: base\nmodel: mine.sdf\n")
    profile = "profile: {time: '(0, 4, 6) s', speed: '(60, 250, 250) rpm'}"
    (folder / "mine.yaml").write_text(f"extends: ../base.yaml\nname: mine\n{profile}\n")
    if words[0] == "calibrate":
        (folder / "free.yaml").write_text(
            "vary:\n  k: {sets: damper_types.friction.friction_force, bounds: '(10, 60) N', prior: '(30, 10) N', source: test}\n"
        )
        table = "load,gasket,source,Xr,Yr,Zr,Xf,Yf,Zf\nmiddle,yes,experiment,16,5,12,17,5,13\n"
        (folder / "measured.csv").write_text(table)
        files = ("--vary", folder / "free.yaml", "--targets", folder / "measured.csv")
        words = (*words, *files, "--starts", "1", "--iterations", "1")
    given = ("--machine", folder / "mine.yaml", "--archive", "a.zip", "--out", "out")
    ended = wm_drake(*words, *given)
    assert ended.code == 0, ended.err
    shutil.rmtree(folder.parent)
    ended = wm_drake("rerun", "a.zip")
    assert ended.code == 0, ended.err + ended.out


def test_a_rerun_that_was_killed_goes_on(wm_drake, archive):
    assert wm_drake("rerun", archive, "--out", "again").code == 0
    for path in Path("again").iterdir():
        if path.name != "ledger.sqlite":
            path.unlink()
    with sqlite3.connect("again/ledger.sqlite") as ledger:
        ledger.execute("DELETE FROM header WHERE name = 'finished'")
        (count,) = ledger.execute("SELECT count(*) FROM results").fetchone()
        ledger.execute("DELETE FROM results WHERE rowid = (SELECT max(rowid) FROM results)")
    ledger.close()
    ended = wm_drake("rerun", archive, "--out", "again")
    assert ended.code == 0, ended.err
    with sqlite3.connect("again/ledger.sqlite") as ledger:
        assert ledger.execute("SELECT count(*) FROM results").fetchone() == (count,)
    ledger.close()


def test_what_differs_is_named(wm_drake, archive):
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile("b.zip", "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "tables/runs.csv":
                table = pd.read_csv(io.BytesIO(data))
                table.loc[0, "Dx_mm"] *= 1.001
                data = table.to_csv(index=False).encode()
            new.writestr(name, data)
    ended = wm_drake("rerun", "b.zip")
    assert ended.code == 1
    assert re.search(r"^runs: column Dx_mm differs by \S+ of", ended.out, re.MULTILINE)
    Path("c.zip").write_text("nothing")
    ended = wm_drake("rerun", "c.zip")
    assert ended.code == 2
    assert "is no archive" in ended.err


def test_citation_has_program_and_papers(wm_drake):
    ended = wm_drake("cite")
    entries = re.findall(r"@(\w+)\{(\w+),", ended.out)
    assert [kind for kind, _ in entries] == ["software", "article", "article", "article"]
    assert f"version = {{{version()}}}" in ended.out
    assert "doi = {10.3390/s20226636}" in ended.out
    assert wm_drake("cite", "--format", "cff").out == (
        Path(__file__).parents[2] / "CITATION.cff"
    ).read_text(encoding="utf-8")
