"""Test claims of processes on what they compile."""

import subprocess
import sys

import pytest

from wm_drake.compiler import claims

pytest.importorskip("fcntl")

HOLD = """
import sys
from pathlib import Path
from wm_drake.compiler.claims import claimed
with claimed(Path(sys.argv[1]), "law"):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Return a process that holds the claim of "law" in the temporary folder."""
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        yield process
        process.kill()


@pytest.fixture
def pauses(monkeypatch):
    """Return the pauses in which a claim has waited; the third one is the last."""
    made = []
    monkeypatch.setattr(claims.time, "sleep", made.append)
    monkeypatch.setattr(claims.time, "monotonic", lambda: len(made) * claims.LONGEST_WAIT / 3)
    return made


def test_a_claim_waits_for_the_process_that_holds_it(holder, tmp_path, pauses):
    with claims.claimed(tmp_path, "other law"), claims.claimed(tmp_path / "missing", "law"):
        assert not pauses
    with claims.claimed(tmp_path, "law"):  # a stopped process does not hold others up
        assert len(pauses) == 3
    pauses.clear()
    holder.kill()
    holder.communicate()
    with claims.claimed(tmp_path, "law"):
        assert not pauses
