"""A study on a dask cluster returns the tables of one computer, also if a worker dies."""

import math
import os
import signal
from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path

import pytest

from wm_drake.batch import cluster, simulate_many, simulate_remembered
from wm_drake.batch.cluster import (
    check_workers,
    cluster_client,
    map_on_cluster,
    run_on_cluster,
    run_work_item,
)
from wm_drake.batch.ledger import Ledger, open_ledger
from wm_drake.batch.runs import BatchOptions
from wm_drake.errors import InputError, WmDrakeError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, with_value
from wm_drake.simulation.cases import Case

SHORT = SpinProfile(time=(0.0, 3.0), speed=(5.0, 20.0))


def cases_of(reference, count):
    for index in range(count):
        changed = with_value(reference, "gasket.damping_x", 10.0 + index)
        yield Case(f"case {index}", reference.loads["middle"], SHORT, parameters=changed)


@pytest.mark.slow
def test_no_scheduler_at_the_address(monkeypatch):
    monkeypatch.setattr("wm_drake.batch.cluster.ANSWER_TIME", 0.5)
    with pytest.raises(
        InputError, match=r"--cluster: no scheduler answers at 'tcp://127\.0\.0\.1:9'"
    ):
        cluster_client("tcp://127.0.0.1:9").__enter__()


def test_worker_with_other_sources_is_refused():
    class Client:
        def run(self, function):
            return {"tcp://one": function(), "tcp://two": "0123"}

    with pytest.raises(InputError, match="worker tcp://two has other sources or versions"):
        check_workers(Client())


def test_work_item_returns_results_by_number(reference, machine):
    cases = list(cases_of(reference, 3))
    options = BatchOptions(("extremes",), 2.5e-3)
    results = run_work_item(reference, tuple(zip((7, 8, 9), cases, strict=True)), options)
    table = simulate_many(machine, cases, measures=("extremes",))
    assert list(results) == [7, 8, 9]
    assert results[8].values["gasket_force"].tolist() == table.gasket_force.values[1].tolist()


def test_cluster_uses_step_and_integrator_of_the_machine(reference, tmp_path):
    """Compare the results of a machine with numbers of its own with those here, bit by bit."""
    from distributed import Client

    fine = with_value(with_value(reference, "step", 0.5e-3), "integrator", "runge_kutta")
    built = build_machine(fine)
    (case,) = cases_of(fine, 1)
    here = simulate_many(built, [case], measures=("extremes",))
    with (
        Client(processes=False, dashboard_address=None, n_workers=1) as client,
        open_ledger(tmp_path / "ledger.sqlite", {}, resume=False) as ledger,
    ):
        run = partial(run_on_cluster, client=client)
        there = simulate_remembered(built, [case], ledger, measures=("extremes",), run=run)
    assert there.equals(here)
    of_default = simulate_many(built, [case], measures=("extremes",), step=2.5e-3)
    assert not of_default.equals(here)


def test_function_runs_on_a_cluster_for_each_item_and_its_error_is_a_message():
    from distributed import Client

    with Client(processes=False, dashboard_address=None, n_workers=1) as client:
        found = dict(map_on_cluster(math.sqrt, [4.0, 9.0, 16.0], client))
        assert found == {0: 2.0, 1: 3.0, 2: 4.0}
        with pytest.raises(ValueError, match=r"\w") as refused:  # its words depend on Python
            math.sqrt(-1.0)
        with pytest.raises(WmDrakeError, match=f"--cluster: ValueError: {refused.value}"):
            list(map_on_cluster(math.sqrt, [4.0, -1.0], client))


class Running:
    """Work items of which none ends."""

    def __init__(self, ready=()):
        self.ready = list(ready)

    def is_empty(self):
        return False

    def has_ready(self):
        return bool(self.ready)

    def __next__(self):
        return self.ready.pop()


class Lost:
    """Client of a cluster in a given state."""

    def __init__(self, status, workers):
        self.status, self.workers = status, workers

    def scheduler_info(self):
        return {"workers": self.workers}


def test_study_without_workers_says_so_and_ends(monkeypatch, caplog):
    monkeypatch.setattr(cluster, "WAIT_FOR_WORKERS", 0.2)
    ended = cluster._as_they_end(Running(["first"]), Lost("running", {}))
    assert next(ended) == "first"
    with pytest.raises(WmDrakeError, match=r"no workers for 0\.2 s; finished runs are kept"):
        next(ended)
    assert caplog.messages == ["--cluster: the cluster has no workers; waiting 0.2 s for one"]


def test_worker_that_comes_back_ends_the_wait(monkeypatch, caplog):
    monkeypatch.setattr(cluster, "WAIT_FOR_WORKERS", 0.2)
    running, client = Running(), Lost("running", {})

    def sleep(_):
        client.workers = {"tcp://one": {}}
        running.ready = ["first"]

    monkeypatch.setattr(cluster.time, "sleep", sleep)
    assert next(cluster._as_they_end(running, client)) == "first"
    assert len(caplog.messages) == 1


def test_lost_scheduler_ends_the_study():
    with pytest.raises(
        WmDrakeError, match="connection to the scheduler is lost; finished runs are kept"
    ):
        next(cluster._as_they_end(Running(), Lost("connecting", {"tcp://one": {}})))
    with pytest.raises(WmDrakeError, match="scheduler is lost"), cluster._cluster_errors():
        raise CancelledError


@pytest.mark.slow
def test_command_writes_the_same_tables_if_the_cluster_loses_a_worker(
    wm_drake, monkeypatch, no_runs
):
    from distributed import LocalCluster

    Path("p.yaml").write_text("time: (0, 8) s\nspeed: (0, 60) rpm\n")
    factors = ("--factor", "K_Lx", "--factor", "C_L", "--factor", "K_Ty")
    study = ("study", "gasket", "--design", "full", *factors, "--profile", "p.yaml")
    monkeypatch.setattr("wm_drake.studies.answer.Answer.page", lambda *_: "")
    assert wm_drake(*study, "--out", "here").code == 0
    no_runs()
    put_all, killed = Ledger.put_all, []

    def put_and_kill(ledger, results):
        put_all(ledger, results)
        if not killed:
            killed.append(victim)
            os.kill(victim, signal.SIGKILL)

    monkeypatch.setattr(Ledger, "put_all", put_and_kill)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit=0
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        ended = wm_drake(*study, "--out", "there", "--cluster", cluster.scheduler_address)
    assert (ended.code, killed) == (0, [victim])
    for name in (
        "runs.csv",
        "contributions.csv",
        "effects.csv",
        "variance.csv",
        "leading_terms.csv",
    ):
        assert (Path("here") / name).read_bytes() == (Path("there") / name).read_bytes()
