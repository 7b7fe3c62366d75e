"""Worker processes: order, progress, errors and ends, and no other child process is touched."""

import multiprocessing
import threading
import time

import pytest
from process_jobs import answer, answer_of_runs, answer_of_workers, doubled

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.studies.spin.processes import (
    WorkerProcessError,
    can_start_processes,
    map_in_processes,
)

SPAWN = multiprocessing.get_context("spawn")


def test_values_come_in_the_order_of_the_items_and_progress_with_their_index():
    reports = []
    values = map_in_processes(doubled, [0.3, 0.0, 0.1], 2, lambda *report: reports.append(report))
    assert values == [0.6, 0.0, 0.2]
    assert sorted(reports) == [(i, fraction) for i in range(3) for fraction in (0.5, 1.0)]
    assert not multiprocessing.active_children()


def test_error_of_a_case_arrives_with_its_problems():
    with pytest.raises(InputError) as raised:
        map_in_processes(doubled, ["mass"], 1, print)
    assert str(raised.value) == "mass: not a number"
    assert raised.value.problems[0].key == "mass"


def test_killed_worker_is_an_error():
    with pytest.raises(WorkerProcessError, match="exit code -9"):
        map_in_processes(doubled, ["SIGKILL", 0.0], 1, print)


def test_failing_progress_ends_the_workers_and_no_other_child():
    def fail(*_report):
        raise KeyboardInterrupt

    child = SPAWN.Process(target=time.sleep, args=(60.0,))
    child.start()
    with pytest.raises(KeyboardInterrupt):
        map_in_processes(doubled, [60.0, 60.0], 2, fail)
    assert multiprocessing.active_children() == [child]
    child.terminate()
    child.join()


def test_daemon_process_cannot_start_others():
    receiver, sender = SPAWN.Pipe()
    daemon = SPAWN.Process(target=answer, args=(sender,), daemon=True)
    daemon.start()
    sender.close()  # a child that fails then ends the wait
    assert receiver.recv() is False
    daemon.join()
    assert can_start_processes()


@pytest.mark.parametrize(
    ("work", "daemon", "expected"),
    [(answer_of_runs, True, 2), (answer_of_workers, False, [0.0, 0.2])],
)
def test_fork_of_a_process_with_threads_gets_its_answer(work, daemon, expected):
    """A daemon computes the runs itself; another child starts workers."""
    assert wm.run_spin  # imported before the fork
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe()
    child = context.Process(target=work, args=(sender,), daemon=daemon)
    child.start()
    sender.close()
    try:
        assert receiver.poll(300.0), "no answer"
        assert receiver.recv() == expected
    finally:
        ended.set()
        child.kill()
        child.join()
