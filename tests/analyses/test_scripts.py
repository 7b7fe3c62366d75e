"""Test that every analysis script runs with --quick and writes its result."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ANALYSES = Path(__file__).parents[2] / "analyses"
LONG = {  # more than five seconds
    "benchmark_engines.py",
    "benchmark_rival_laws.py",
    "benchmark_tolerances.py",
    "calibrate_reference.py",
    "check_spin_of_tubes.py",
    "choose_step.py",
    "compare_dampers.py",
    "compare_designs.py",
    "compare_mujoco.py",
    "compare_searches.py",
    "fit_coulomb_to_mstv.py",
    "measure_studio.py",
    "write_validation.py",
}
SCRIPTS = [
    pytest.param(path.name, marks=[pytest.mark.slow] if path.name in LONG else [])
    for path in sorted(ANALYSES.glob("*.py"))
]


@pytest.mark.parametrize("script", SCRIPTS)
def test_script_runs_quickly_and_writes_its_output(script, tmp_path):
    out = tmp_path / "out.txt"
    command = [sys.executable, str(ANALYSES / script), "--quick", "--out", str(out)]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=tmp_path, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    assert out.read_text().strip() in done.stdout
    assert script in (ANALYSES / "README.md").read_text()
