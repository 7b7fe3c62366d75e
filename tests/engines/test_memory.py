"""Runs that have no place in memory are refused before they begin."""

import subprocess
import sys

import pytest

import wm_drake as wm
from wm_drake.engines import memory
from wm_drake.engines.memory import available_memory, check_size
from wm_drake.errors import InputError


@pytest.mark.parametrize(("duration", "step"), [(1e6, 2.5e-3), (1e15, 5e-3), (70.0, 5e-12)])
def test_run_that_is_too_large_is_refused(machine, duration, step):
    profile = machine.parameters.profile.model_copy(
        update={"time": (0.0, duration), "speed": (0.0, 1.0)}
    )
    with pytest.raises(InputError, match=r"needs about .* GB of memory and .* s; .* available"):
        check_size(profile, step, 5e-3)


def test_memory_is_that_of_this_computer(reference, monkeypatch):
    assert 1e7 < available_memory() < 1e14
    check_size(reference.profile, reference.step, 5e-3)
    monkeypatch.setattr(memory, "available_memory", lambda: 1e6)
    with pytest.raises(InputError, match=r"0\.001 GB are available"):
        check_size(reference.profile, reference.step, 5e-3)


def test_batches_are_counted_by_threads_and_records(machine, monkeypatch):
    parameters = machine.parameters
    one = memory.needed_memory(parameters.profile, parameters.step, parameters.output_period)
    monkeypatch.setattr(memory, "available_memory", lambda: 3.0 * one)
    for options in ({"workers": 2}, {"workers": 1, "histories": True}):
        wm.simulate_many(machine, ["middle"], **options)
    for options in ({"workers": 4}, {"workers": 2, "histories": True}):
        with pytest.raises(InputError, match="GB are available"):
            wm.simulate_many(machine, ["middle"], **options)


def test_file_is_named(wm_drake, tmp_path):
    path = tmp_path / "long.yaml"
    path.write_text("time: (0, 1e9) s\nspeed: (0, 100) rpm\n", encoding="utf-8")
    ended = wm_drake("spin", "--profile", str(path), "--out", str(tmp_path / "out"))
    assert ended.code == 2
    assert ended.err.startswith(f"{path}: profile: a run of 1e+09 s")
    machine = tmp_path / "machine.yaml"
    machine.write_text("extends: reference\nprofile:\n  time: (0, 1e9) s\n  speed: (0, 9) rpm\n")
    ended = wm_drake("machine", "check", str(machine))
    assert ended.err.startswith(f"{machine}:2: profile: a run of 1e+09 s")
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError):
        wm.simulate_many(
            wm.build_machine(wm.load_machine("reference")),
            [wm.Case("long", wm.load_machine("reference").loads["middle"], wm.load_profile(path))],
        )


PEAK = r"""
import gc, re
from pathlib import Path
import wm_drake as wm
from wm_drake.engines.memory import needed_memory

def size(name):
    return 1024 * int(re.search(name + r":\s+(\d+)", Path("/proc/self/status").read_text())[1])

def profile(duration):
    return given.profile.model_copy(update={"time": (0.0, duration), "speed": (0.0, 60.0)})

given = wm.load_machine("reference")
machine = wm.build_machine(given)
wm.simulate(machine, wm.Case("short", given.loads["middle"], profile(2.0)))
gc.collect()
Path("/proc/self/clear_refs").write_text("5")  # resets the peak
before = size("VmRSS")
wm.simulate(machine, wm.Case("long", given.loads["middle"], profile(300.0)))
period = profile(300.0).sample_period(given.output_period)
print((size("VmHWM") - before) / needed_memory(profile(300.0), given.step, period))
"""


@pytest.mark.slow  # a new process, whose memory no other test has used
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_estimate_is_that_of_a_run():
    printed = subprocess.check_output([sys.executable, "-c", PEAK], text=True)
    assert 0.5 < float(printed) < 1.0
