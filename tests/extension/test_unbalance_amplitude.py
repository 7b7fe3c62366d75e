"""A study in one file outside the package goes through every door; no file of wm_drake knows it.

Two processes use it: one that registers it by a function, and one that finds it by an entry point.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

FOLDER = Path(__file__).parent
NAME = "unbalance-amplitude"
PROFILE = "time: (0, 1.5) s\nspeed: (60, 200) rpm\n"
ENTRY_POINT = f"[wm_drake.studies]\n{NAME} = unbalance_amplitude:UNBALANCE_AMPLITUDE\n"

IN_PROCESS = """
import json
from distributed import LocalCluster
import unbalance_amplitude as mine
import wm_drake as wm
from wm_drake.studies.study import STUDIES

wm.register_study(mine.UNBALANCE_AMPLITUDE)
small = dict(profile="p.yaml", quick=True, quiet=True)
here = wm.run_study(mine.UNBALANCE_AMPLITUDE.name, **small)
with LocalCluster(n_workers=1, threads_per_worker=1, processes=False,
                  dashboard_address=None) as cluster:
    there = wm.run_study(mine.UNBALANCE_AMPLITUDE.name, **small, cluster=cluster.scheduler_address)
try:
    wm.run_study(mine.UNBALANCE_AMPLITUDE.name, count=1)
except Exception as error:
    fault = f"{type(error).__name__}: {error}"
print(json.dumps({
    "same": here.to_dataframe().equals(there.to_dataframe()),
    "rows": len(here.to_dataframe()),
    "schema": mine.UNBALANCE_AMPLITUDE.options.model_json_schema()["properties"],
    "fault": fault,
}))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a profile, and the metadata of a package beside the file."""
    path = tmp_path_factory.mktemp("package")
    (path / "p.yaml").write_text(PROFILE)
    metadata = path / "unbalance-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: unbalance\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(ENTRY_POINT)
    return path


def environment(folder, has_entry_point=True):
    paths = [str(FOLDER), *([str(folder)] if has_entry_point else [])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "200"}


def command(*words):
    return [sys.executable, "-m", "wm_drake", *words]


def run(folder, *words):
    return subprocess.run(
        command(*words), cwd=folder, env=environment(folder), capture_output=True, text=True,
        check=False,
    )  # fmt: skip


def test_registered_by_a_function_it_runs_here_and_on_a_cluster(folder):
    ended = subprocess.run(
        [sys.executable, "-c", IN_PROCESS], cwd=folder, env=environment(folder, False),
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    seen = json.loads(ended.stdout.splitlines()[-1])
    assert (seen["same"], seen["rows"]) == (True, 4)
    assert seen["schema"]["count"]["minimum"] == 2
    assert seen["schema"]["count"]["description"] == "Number of factors."
    assert seen["fault"].startswith("InputError: count: ")


def test_found_by_an_entry_point_it_is_a_command_with_help_json_and_page(folder):
    listed = run(folder, "study", "--help")
    assert NAME in listed.stdout
    described = run(folder, "study", NAME, "--help").stdout
    assert all(word in described for word in ("--largest", "--cluster", "--resume", "Number of"))
    words = ("study", NAME, "--profile", "p.yaml", "--count", "3", "--json", "--out", "out")
    ended = run(folder, *words)
    assert (ended.returncode, ended.stderr) == (0, "")
    printed = json.loads(ended.stdout)
    rows = printed["amplitudes"]
    assert [row["mass_kg"] for row in rows] == sorted(row["mass_kg"] for row in rows)
    assert all(row["Xr_mm"] > 0.0 for row in rows)
    table = pd.read_csv(folder / "out" / "amplitudes.csv")
    assert table["Xr_mm"].tolist() == pytest.approx([row["Xr_mm"] for row in rows], rel=1e-5)
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert printed["answer"] in page
    assert "data-picture" in page
    made = json.loads((folder / "out" / "run.json").read_text())
    assert (made["command"], made["options"]["count"]) == (f"study {NAME}", 3)
    refused = run(folder, *words, "--set", "gravity=9.8 m/s^2")
    assert refused.returncode == 2
    assert "machine is" in refused.stderr
    misspelled = run(folder, "study", "unbalance-amplitud")
    assert misspelled.returncode == 2
    assert NAME in misspelled.stderr


def test_killed_it_goes_on_with_resume(folder):
    words = ("study", NAME, "--profile", "p.yaml", "--workers", "1", "--count", "400")
    killed = subprocess.Popen(command(*words, "--out", "killed"), cwd=folder,
                              env=environment(folder), stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)  # fmt: skip
    ledger = folder / "killed" / "ledger.sqlite"
    while not ledger.exists() and killed.poll() is None:
        time.sleep(0.01)
    time.sleep(0.3)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    ended = run(folder, *words, "--out", "killed", "--resume")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert run(folder, *words, "--out", "whole").returncode == 0
    tables = [(folder / name / "amplitudes.csv").read_bytes() for name in ("killed", "whole")]
    assert tables[0] == tables[1]
