"""Tests of `wm-drake study drive`: output, interruption, resumption, workers, cluster."""

import json
from pathlib import Path

import pandas as pd
import pytest

PROFILE = "time: (0, 2, 3) s\nspeed: (60, 150, 150) rpm\n"
TABLES = ("thresholds.csv", "map.csv", "estimation.csv")


@pytest.fixture
def study(wm_drake):
    """Return a function that runs a small study in a folder, with extra arguments."""
    Path("p.yaml").write_text(PROFILE)
    small = ("--load", "middle", "--torques", "2", "--unbalances", "2", "--loads", "3")
    return lambda out, *arguments: wm_drake(
        "study", "drive", *small, "--profile", "p.yaml", "--out", out, *arguments
    )


def tables(folder):
    return [pd.read_csv(Path(folder) / name) for name in TABLES]


def test_interrupted_it_is_resumed_without_a_run_and_workers_do_not_matter(study, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("wm_drake.report.drive.report.drive_report", interrupted)
        assert study("out", "--workers", "1").code == 130
    assert [path.name for path in Path("out").iterdir()] == ["ledger.sqlite"]
    with monkeypatch.context() as patched:
        patched.setattr("wm_drake.batch.runs.integrate_runs", None)  # whoever runs now, fails
        ended = study("out", "--resume", "--json")
    assert ended.code == 0
    shown = json.loads(ended.out)
    assert [row["load"] for row in shown["thresholds"]] == ["middle"]
    assert len(shown["map"]) == 4
    assert "Smallest torque limit" in Path("out/report.html").read_text(encoding="utf-8")
    assert study("others", "--workers", "3").code == 0
    for one, other in zip(tables("out"), tables("others"), strict=True):
        pd.testing.assert_frame_equal(one, other)


def test_without_random_loads_no_file_of_the_estimation_is_written_or_named(study):
    ended = study("out", "--loads", "0")
    assert ended.code == 0
    assert not Path("out/estimation.csv").exists()
    assert "estimation.csv" not in ended.out


@pytest.mark.slow
def test_a_cluster_writes_the_same_tables(study, monkeypatch):
    from distributed import LocalCluster

    assert study("here").code == 0
    monkeypatch.setattr("wm_drake.batch.runs.integrate_runs", None)  # this process runs nothing
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit=0
    ) as cluster:
        assert study("there", "--cluster", cluster.scheduler_address).code == 0
    for one, other in zip(tables("here"), tables("there"), strict=True):
        pd.testing.assert_frame_equal(one, other)


def interrupted(*_):
    raise KeyboardInterrupt
