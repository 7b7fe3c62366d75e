"""Batches with the Drake engine: worker processes, their errors and ends, and the ledger."""

import multiprocessing
import threading
from types import SimpleNamespace

import numpy as np
import process_jobs
import pytest

import wm_drake as wm
from wm_drake.batch import drake_runs, simulate_remembered
from wm_drake.batch.ledger import open_ledger
from wm_drake.batch.many import _run_all
from wm_drake.batch.runs import BatchOptions
from wm_drake.errors import InputError, WmDrakeError


@pytest.fixture
def in_processes(monkeypatch):
    """Return a function that passes items through two worker processes, without a machine."""
    monkeypatch.setattr(drake_runs, "_begin", process_jobs.begin)
    monkeypatch.setattr(drake_runs, "_run", process_jobs.doubled)

    def run(items):
        ended, options = [], BatchOptions((), workers=2)
        pool = drake_runs.drake_pool(SimpleNamespace(parameters=None), items, options, print)
        with pool as (workers, jobs, stop):
            _run_all(workers, jobs, 2, stop, ended.extend)
        return sorted(ended)

    return run


def test_values_come_back_and_no_process_is_left(in_processes):
    assert in_processes([0.3, 0.0, 0.1]) == [(0, 0.6), (1, 0.0), (2, 0.2)]
    assert not multiprocessing.active_children()


def test_error_of_a_case_arrives_with_its_problems(in_processes):
    with pytest.raises(InputError) as raised:
        in_processes(["mass", 0.0])
    assert str(raised.value) == "mass: not a number"
    assert raised.value.problems[0].key == "mass"


@pytest.mark.parametrize(("end", "cause"), [("SIGKILL", "by SIGKILL"), ("exit", "__main__")])
def test_a_worker_that_ends_is_an_error_with_its_cause(in_processes, end, cause):
    with pytest.raises(WmDrakeError, match=cause):
        in_processes([end, 0.0])


@pytest.fixture(scope="module")
def short_run():
    """Return the reference machine and a tenth of a second of it."""
    machine = wm.build_machine(wm.load_machine("reference"))
    profile = machine.parameters.profile.model_copy(
        update={"time": (0.0, 0.1), "speed": (30.0, 31.0)}
    )
    return machine, [wm.Case("middle", machine.parameters.loads["middle"], profile)]


def test_batch_of_drake_measures_what_its_record_has(short_run):
    machine, cases = short_run
    names = ("extremes", "gap", "mounts", "spring tensions")
    table = wm.simulate_many(machine, cases, measures=names, engine="drake")
    alone = wm.measure(wm.simulate(machine, cases[0], "drake"), wm.Scene(machine.parameters), names)
    for name, values in alone.table.items():
        np.testing.assert_array_equal(table[name].values[0], values.values, err_msg=name)
    ours = wm.simulate_many(machine, cases, measures=names)
    assert table.gasket_force.values == pytest.approx(ours.gasket_force.values, rel=1e-3)


def test_ledger_keeps_the_runs_of_both_engines_apart(short_run, tmp_path):
    machine, cases = short_run
    counts, tables = [], []
    with open_ledger(tmp_path / "ledger.sqlite", {"study": "engines"}) as ledger:
        for engine in ("compiled", "drake", "drake"):
            tables.append(simulate_remembered(machine, cases, ledger, engine=engine))
            counts.append(len(ledger))
    assert counts == [1, 2, 2]
    assert not tables[0].gasket_force.equals(tables[1].gasket_force)
    assert tables[1].identical(tables[2])


def test_integrator_of_the_compiled_engine_is_refused(short_run):
    machine, cases = short_run
    with pytest.raises(InputError, match="integrator: is of the compiled engine, not of 'drake'"):
        wm.simulate_many(machine, cases, engine="drake", integrator="midpoint")


@pytest.mark.parametrize("daemon", [True, False])
def test_fork_of_a_process_with_threads_gets_its_answer(daemon):
    """A daemon computes the runs itself; another child starts workers."""
    assert wm.run_spin  # imported before the fork
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe()
    child = context.Process(target=process_jobs.answer_of_runs, args=(sender,), daemon=daemon)
    child.start()
    sender.close()
    try:
        assert receiver.poll(300.0), "no answer"
        assert receiver.recv() == 2
    finally:
        ended.set()
        child.kill()
        child.join()
