"""Result folders: complete or not written at all, also when the disk is full or the process is killed."""

import errno
import os
import resource
import subprocess
import sys

import pytest

from wm_drake.cli.result_folder import SUFFIX, result_folder
from wm_drake.errors import InputError


def test_folder_of_a_dead_process_is_removed_and_that_of_a_living_one_stays(tmp_path):
    out = tmp_path / "results"
    dead = tmp_path / f".results-abcdefgh{SUFFIX}"
    others = [tmp_path / ".results-20240101", tmp_path / f".other-abcdefgh{SUFFIX}"]
    for folder in (dead, *others):
        folder.mkdir()
        (folder / "file").write_text("x", encoding="utf-8")
    with result_folder(out) as living, result_folder(out) as folder:
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
        "from wm_drake.cli.result_folder import result_folder\n"
        f"with result_folder(Path({str(tmp_path / 'out')!r})): os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], check=False)
    assert len(list(tmp_path.iterdir())) == 1
    with result_folder(tmp_path / "out"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_full_disk_ends_with_a_message_and_nothing_written(tmp_path):
    def write():
        with result_folder(tmp_path / "out") as folder:
            (folder / "half.csv").write_text("x", encoding="utf-8")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(InputError, match="out: cannot be written to: No space left on device"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_other_errors_of_the_system_pass(tmp_path):
    with pytest.raises(ConnectionError), result_folder(tmp_path / "out"):
        raise ConnectionResetError(errno.ECONNRESET, "reset")


@pytest.mark.slow
@pytest.mark.parametrize("size", [10_000, 300_000])
def test_spin_whose_files_cannot_grow_ends_with_a_message(tmp_path, size):
    (tmp_path / "short.csv").write_text("time_s,speed_rpm\n0,0\n3,60\n", encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-c", "from wm_drake.cli import main; main()", "spin", "--load", "middle", "--profile", "short.csv"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )  # fmt: skip
    assert ended.returncode == 2, ended.stderr
    assert (
        ended.stderr.strip().splitlines()[-1]
        == "wm-drake-spin: cannot be written to: File too large"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["short.csv"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--workers=0", "--workers"),
        ("--workers=-1", "--workers"),
        ("--seed=-1", "--seed"),
        ("--starts=0", "starts: 0 starts"),
        ("--iterations=-1", "--iterations"),
        ("--resolution=inf", "resolution: inf is not allowed"),
        ("--deviation=nan", "deviation: nan is not allowed"),
        ("--weight=middle=inf", "--weight: middle: 'inf' is not allowed"),
        ("--weight=middle=٣", "--weight: middle: '٣' is not a number"),
        ("--weight=middle", "--weight: 'middle' does not have the form KEY=VALUE"),
        ("--leave-out=middle,middle", "--leave-out: 'middle' is given twice"),
    ],
)
def test_option_that_makes_no_sense_is_refused(wm_drake, tmp_path, option, message):
    (tmp_path / "free.yaml").write_text(
        "quantities:\n  spring: {bounds: '(1, 20) N/mm', prior: '(7, 2) N/mm', "
        "sets: spring_types.suspension.stiffness, source: guess}\n",
        encoding="utf-8",
    )
    ended = wm_drake("calibrate", "--free", "free.yaml", option)
    assert ended.code == 2
    assert message in ended.err
    assert [path.name for path in tmp_path.iterdir()] == ["free.yaml"]
