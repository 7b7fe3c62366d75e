"""Result folders: written by one run, complete or not at all, replaced only on request."""

import errno
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest

from wm_drake.errors import InputError
from wm_drake.studies.result_folder import RUN_FILE, SUFFIX, CommandRun, check_folder, result_folder

OUT = Path("out")


@pytest.fixture(autouse=True)
def _own_folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


def written(run, *names, out=OUT):
    with result_folder(out, run) as folder:
        for name in names:
            (folder / name).write_text(f"{run.command} {name}")


def content(out=OUT):
    return {path.name: path.read_text() for path in out.iterdir() if path.name != RUN_FILE}


def test_second_run_needs_overwrite_and_leaves_nothing_stale():
    written(CommandRun("spin"), "report.html", "record_middle.nc")
    before = content()
    with pytest.raises(InputError, match=r"out: holds an earlier run .*add --overwrite"):
        written(CommandRun("spin"), "report.html", "record_front.nc")
    assert content() == before
    Path("out/notes.txt").write_text("mine")
    written(CommandRun("spin", overwrite=True), "report.html", "record_front.nc")
    assert sorted(content()) == ["notes.txt", "record_front.nc", "report.html"]
    assert json.loads((OUT / RUN_FILE).read_text())["files"] == ["record_front.nc", "report.html"]


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", ["report.html", "thesis.tex", "ledger.sqlite"])
def test_files_that_no_run_wrote_are_never_touched(name, overwrite):
    OUT.mkdir()
    (OUT / name).write_text("mine")
    with pytest.raises(InputError, match=r"out: holds .* choose an empty or a new folder"):
        written(CommandRun("spin", overwrite), "report.html")
    assert content() == {name: "mine"}


def test_file_of_the_user_with_the_name_of_a_result_is_kept():
    written(CommandRun("spin"), "report.html")
    (OUT / "record_a.nc").write_text("mine")
    with pytest.raises(InputError, match=r"'record_a.nc' that no run wrote"):
        written(CommandRun("spin", overwrite=True), "report.html", "record_a.nc")
    assert content() == {"record_a.nc": "mine", "report.html": "spin report.html"}


def test_empty_folder_and_hidden_files_are_no_obstacle():
    OUT.mkdir()
    (OUT / ".DS_Store").write_text("")
    written(CommandRun("spin"), "report.html")
    assert "report.html" in content()


def test_study_continues_and_another_one_is_named():
    first = CommandRun("study gasket", identity={"machine": "a", "design": "full"})
    OUT.mkdir()
    (OUT / "ledger.sqlite").write_text("")
    (OUT / "ledger.sqlite-wal").write_text("")
    written(first, "report.html")
    written(first, "report.html")
    other = CommandRun("study gasket", identity={"machine": "a", "design": "d-optimal"})
    with pytest.raises(InputError, match=r"design is 'full' there and 'd-optimal' now"):
        written(other, "report.html")
    written(CommandRun("study gasket", overwrite=True, identity=other.identity), "report.html")
    check_folder(OUT, other)
    assert "ledger.sqlite" in content()


def test_run_file_has_date_version_and_revision():
    written(CommandRun("spin"), "report.html")
    run = json.loads((OUT / RUN_FILE).read_text())
    assert run["command"] == "spin"
    assert time.strptime(run["date"], "%Y-%m-%d %H:%M %z")
    assert all(run[name] for name in ("version", "revision", "command_line"))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[1]",
        '{"command": "spin", "date": "", "identity": {}, "files": ["../thesis.tex"]}',
        '{"command": "spin", "date": "", "identity": 3, "files": []}',
    ],
)
def test_damaged_run_file_is_refused(text):
    Path("thesis.tex").write_text("mine")
    OUT.mkdir()
    (OUT / RUN_FILE).write_text(text)
    with pytest.raises(InputError, match="does not describe a run"):
        written(CommandRun("spin", overwrite=True), "report.html")
    assert Path("thesis.tex").read_text() == "mine"


def test_two_runs_at_once_do_not_mix():
    def second_during_first():
        with result_folder(OUT, CommandRun("spin")) as folder:
            (folder / "record_a.nc").write_text("a")
            written(CommandRun("spin"), "record_b.nc")

    with pytest.raises(InputError, match="holds an earlier run"):
        second_during_first()
    assert sorted(content()) == ["record_b.nc"]
    assert [path.name for path in Path().iterdir()] == ["out"]


def test_run_killed_while_moving_can_be_replaced(monkeypatch):
    written(CommandRun("spin"), "report.html", "record_a.nc")
    replace, moves = Path.replace, []

    def killed(path, target):
        moves.append(target)
        if len(moves) == 3:
            raise KeyboardInterrupt
        return replace(path, target)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            written(CommandRun("spin", overwrite=True), "report.html", "record_b.nc")
    written(CommandRun("spin", overwrite=True), "report.html", "record_c.nc")
    assert sorted(content()) == ["record_c.nc", "report.html"]


def test_folder_of_a_dead_process_is_removed_and_that_of_a_living_one_stays(tmp_path):
    out = tmp_path / "results"
    dead = tmp_path / f".results-abcdefgh{SUFFIX}"
    others = [tmp_path / ".results-20240101", tmp_path / f".other-abcdefgh{SUFFIX}"]
    for folder in (dead, *others):
        folder.mkdir()
        (folder / "file").write_text("x", encoding="utf-8")
    run = CommandRun("spin", overwrite=True)
    with result_folder(out, run) as living, result_folder(out, run) as folder:
        assert not dead.exists()
        assert living.is_dir()
        (folder / "report.html").write_text("x", encoding="utf-8")
    assert all(other.is_dir() for other in others)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["results", *(other.name for other in others)]
    )


def test_killed_process_leaves_a_folder_that_the_next_run_removes(tmp_path):
    code = (
        "import os, signal; from pathlib import Path\n"
        "from wm_drake.studies.result_folder import CommandRun, result_folder\n"
        f"with result_folder(Path({str(tmp_path / 'out')!r}), CommandRun('spin')):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], check=False)
    assert len(list(tmp_path.iterdir())) == 1
    with result_folder(tmp_path / "out", CommandRun("spin")):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_full_disk_ends_with_a_message_and_nothing_written(tmp_path):
    def write():
        with result_folder(tmp_path / "out", CommandRun("spin")) as folder:
            (folder / "half.csv").write_text("x", encoding="utf-8")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(InputError, match="out: cannot be written to: No space left on device"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_other_errors_of_the_system_pass(tmp_path):
    with pytest.raises(ConnectionError), result_folder(tmp_path / "out", CommandRun("spin")):
        raise ConnectionResetError(errno.ECONNRESET, "reset")


@pytest.mark.slow
def test_spin_whose_files_cannot_grow_ends_with_a_message(tmp_path):
    (tmp_path / "short.csv").write_text("time_s,speed_rpm\n0,0\n3,60\n", encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-c", "from wm_drake.cli import main; main()", "spin", "--load", "middle", "--profile", "short.csv"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000)),
    )  # fmt: skip
    assert ended.returncode == 2, ended.stderr
    assert (
        ended.stderr.strip().splitlines()[-1]
        == "wm-drake-spin/record_middle.nc: cannot be written to: File too large"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["short.csv"]


def test_file_system_without_locks_is_refused_and_left_clean(monkeypatch):
    def no_locks(*_):
        raise OSError("no locks")

    monkeypatch.setattr("wm_drake.studies.result_folder.fcntl.flock", no_locks)
    with pytest.raises(InputError, match="out: cannot be written to: No locks available"):
        written(CommandRun("spin"), "report.html")
    assert list(Path().iterdir()) == []
