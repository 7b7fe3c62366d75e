"""Test claims of processes on what they compile."""

import subprocess
import sys
import time

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


def seconds_to_claim(folder, name):
    begin = time.monotonic()
    with claims.claimed(folder, name):
        return time.monotonic() - begin


def test_a_claim_waits_for_the_process_that_holds_it(holder, tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "LONGEST_WAIT", 0.2)
    assert seconds_to_claim(tmp_path, "law") >= 0.2  # a stopped process does not hold others up
    assert seconds_to_claim(tmp_path, "other law") < 0.2
    holder.kill()
    holder.wait()
    assert seconds_to_claim(tmp_path, "law") < 0.2
    assert seconds_to_claim(tmp_path / "missing", "law") < 0.2
