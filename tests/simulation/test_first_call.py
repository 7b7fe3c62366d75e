"""Test the second process of the first call after an installation."""

import os
import subprocess
import sys

import pytest

from wm_drake.elements.mount import mount_wrench_history
from wm_drake.engines.compiled.integration import integrate_lanes
from wm_drake.engines.compiled.linear import growth_lanes
from wm_drake.engines.compiled.samples import torque_history
from wm_drake.simulation import first_call
from wm_drake.simulation.histories import output_history
from wm_drake.simulation.signals import filter_both_ways

OF_RECORDS = (mount_wrench_history, output_history, torque_history)


@pytest.mark.parametrize(("batch", "readers"), [(True, (integrate_lanes,)), (False, OF_RECORDS)])
def test_the_second_process_compiles_what_follows_set_up(reference, batch, readers):
    first_call.compile_meanwhile(reference, batch=batch)
    assert all(function.signatures for function in (growth_lanes, filter_both_ways, *readers))


def test_one_process_is_started_for_a_folder_of_compiled_code(reference, tmp_path, monkeypatch):
    ended = [sys.executable, "-c", "import sys; sys.stdin.buffer.read()"]
    real, started = subprocess.Popen, []

    def start(_command, **options):
        started.append(real(ended, **options))
        return started[-1]

    monkeypatch.setattr(first_call, "CACHE_FOLDER", str(tmp_path))
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(subprocess, "Popen", start)
    first_call.compile_in_two_processes(reference)
    first_call.compile_in_two_processes(reference)
    assert [process.wait() for process in started] == [0]


def test_no_process_is_started_without_a_folder_or_a_second_core(reference, tmp_path, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", None)
    monkeypatch.setattr(first_call, "CACHE_FOLDER", "")
    first_call.compile_in_two_processes(reference)
    monkeypatch.setattr(first_call, "CACHE_FOLDER", str(tmp_path))
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    first_call.compile_in_two_processes(reference)
    assert not list(tmp_path.iterdir())
