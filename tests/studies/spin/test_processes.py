"""Runs in worker processes: order, progress, errors and ends."""

import multiprocessing
import threading

import pytest
from process_jobs import answer_of_runs, doubled

import wm_drake as wm
from wm_drake.errors import InputError, WmDrakeError
from wm_drake.studies.spin import study


@pytest.fixture
def in_processes(monkeypatch):
    """Return the function that runs items in processes, for items that need no machine."""
    monkeypatch.setattr(study, "_build_and_run", doubled)
    return study._run_in_processes


def test_values_come_in_the_order_of_the_items_and_progress_with_their_index(in_processes):
    reports = []
    values = in_processes([0.3, 0.0, 0.1], 2, lambda *report: reports.append(report))
    assert values == [0.6, 0.0, 0.2]
    assert sorted(reports) == [(index, 1.0) for index in range(3)]
    assert not multiprocessing.active_children()


def test_error_of_a_case_arrives_with_its_problems(in_processes):
    with pytest.raises(InputError) as raised:
        in_processes(["mass"], 1, print)
    assert str(raised.value) == "mass: not a number"
    assert raised.value.problems[0].key == "mass"


@pytest.mark.parametrize(("end", "reason"), [("SIGKILL", r"\(SIGKILL\)"), ("exit", "__main__")])
def test_a_worker_that_ends_is_an_error_with_its_cause(in_processes, end, reason):
    with pytest.raises(WmDrakeError, match=reason):
        in_processes([end, 0.0], 1, print)


@pytest.mark.parametrize("daemon", [True, False])
def test_fork_of_a_process_with_threads_gets_its_answer(daemon):
    """A daemon computes the runs itself; another child starts workers."""
    assert wm.run_spin  # imported before the fork
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe()
    child = context.Process(target=answer_of_runs, args=(sender,), daemon=daemon)
    child.start()
    sender.close()
    try:
        assert receiver.poll(300.0), "no answer"
        assert receiver.recv() == 2
    finally:
        ended.set()
        child.kill()
        child.join()
