"""Test that every analysis script runs with --quick and writes its result."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ANALYSES = Path(__file__).parents[2] / "analyses"


@pytest.mark.parametrize("script", sorted(path.name for path in ANALYSES.glob("*.py")))
def test_script_runs_quickly_and_writes_its_output(script, tmp_path):
    out = tmp_path / "out.txt"
    command = [sys.executable, str(ANALYSES / script), "--quick", "--out", str(out)]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=tmp_path, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    assert out.read_text().strip() in done.stdout
    assert script in (ANALYSES / "README.md").read_text()
