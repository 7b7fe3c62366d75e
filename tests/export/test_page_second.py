"""The second process of an export: it ends with the first one, and nothing depends on it."""

import pickle
import subprocess
import sys

import numpy as np
import pytest
from numba import cfunc, types

from wm_drake.elements.ball_ring import ring_of
from wm_drake.elements.kind import registered_laws
from wm_drake.elements.liquid_ring import LIQUID_RING
from wm_drake.export import page_second
from wm_drake.export.kernel import OPTIONS, POINTER, numbers_at
from wm_drake.export.object_code import function_here

ECHO = "import sys, pickle; print(pickle.load(sys.stdin.buffer))"


@pytest.fixture
def started(monkeypatch):
    """Return the processes that an export starts."""
    processes, real = [], subprocess.Popen

    def start(*arguments, **options):
        processes.append(real(*arguments, **options))
        return processes[-1]

    monkeypatch.setattr(page_second.subprocess, "Popen", start)
    monkeypatch.setattr(page_second.os, "cpu_count", lambda: 2)
    return processes


def test_ctrl_c_ends_it(started):
    with pytest.raises(KeyboardInterrupt), page_second.SecondProcess():
        raise KeyboardInterrupt
    assert [process.poll() is not None for process in started] == [True]


def test_it_ends_when_the_first_process_is_gone(started):
    with page_second.SecondProcess():
        started[0].stdin.close()  # as the system does with a process that was killed
        assert started[0].wait() != 0


@pytest.mark.parametrize("plan", [lambda: None, "no plan", (ring_of(3),)])
def test_a_plan_that_it_cannot_compile_is_no_error(started, plan):
    with page_second.SecondProcess() as second:
        second.compile(plan)
        second.wait()
    assert [process.returncode != 0 for process in started] == [True]


@pytest.mark.parametrize(("folder", "cores"), [("", 2), ("folder", 1)])
def test_there_is_none_without_a_folder_or_a_second_core(started, monkeypatch, folder, cores):
    monkeypatch.setattr(page_second, "CACHE_FOLDER", folder)
    monkeypatch.setattr(page_second.os, "cpu_count", lambda: cores)
    with page_second.SecondProcess() as second:
        second.compile("a plan")
        second.wait()
    assert not started


def test_laws_of_elements_reach_another_process():
    laws = registered_laws((LIQUID_RING, ring_of(2)), (3, 9), (0, 4))
    sent = pickle.dumps(laws)
    ended = subprocess.run([sys.executable, "-c", ECHO], input=sent, capture_output=True)
    assert ended.stdout.decode().strip() == repr(laws)
    assert " at 0x" not in repr(laws)


def test_a_function_from_its_text_is_the_compiled_one():
    @cfunc(types.float64(POINTER, POINTER), **OPTIONS)
    def wm_norm(v, c):
        numbers, factors = numbers_at(v, 0), numbers_at(c, 0)
        numbers[2] = np.sqrt(numbers[0] ** 2 + numbers[1] ** 2)
        return factors[0] * numbers[2]

    numbers = np.array([3.0, 4.0, 0.0])
    assert function_here("wm_norm", wm_norm.inspect_llvm())(numbers, np.array([2.0])) == 10.0
    assert numbers[2] == 5.0
