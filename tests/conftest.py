"""Fixtures for all tests: the reference machine and the command `wm-drake`.

Property tests run the same examples every time.
"""

import functools
import os
import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import settings
from simple_machines import SPONGES
from threadpoolctl import threadpool_limits
from upright_springs import with_upright_springs

from wm_drake.cli import main
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine

settings.register_profile("same_every_time", derandomize=True, deadline=None, database=None)
settings.load_profile("same_every_time")


def pytest_configure():
    """Let BLAS use one thread in each process, and let processes share byte code.

    Workers share the cores. Threads of one solution of 200 equations that wait for each other take
    forty times the CPU time of one thread. Without byte code every process of a test, and there are
    hundreds, would compile 2000 modules anew.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of workers and processes of tests
    threadpool_limits(1, "blas")  # of this process, which has numpy already


def pytest_collection_modifyitems(items):
    """Begin with the longest test: at the end, it would keep one of two workers waiting."""
    items.sort(key=lambda item: item.name != "test_each_command_runs_from_an_empty_folder")


@pytest.fixture(scope="session")
def reference():
    """Return the shipped reference machine; it is frozen, so tests may share it."""
    return load_machine("reference")


@pytest.fixture(scope="session")
def sponges():
    """Return a machine with constant gasket stiffnesses and dampers with a sponge."""
    return load_machine(SPONGES)


@pytest.fixture(scope="session")
def shipped():
    """Return a function that builds a shipped machine, each once; tests set up their own Context."""
    return functools.cache(lambda name: build_machine(load_machine(name)))


@pytest.fixture(scope="session")
def machine(shipped):
    """Build the reference machine once; every test sets up its own Context."""
    return shipped("reference")


@pytest.fixture(scope="session")
def upright(machine):
    """Return the reference machine with upright springs, which rests as drawn."""
    return with_upright_springs(machine)


@dataclass(frozen=True)
class CommandResult:
    """Exit code and printed text of a command."""

    code: int
    out: str
    err: str

    @property
    def messages(self):
        """Return the lines on standard error."""
        return self.err.splitlines()


@pytest.fixture
def wm_drake(monkeypatch, capsys, tmp_path):
    """Return a function that runs `wm-drake` in this process, in a temporary folder.

    For example, ``wm_drake("machine check", "reference").code == 0``: the first argument may be
    several words, as in a shell.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("wm_drake.report.progress.LINE_PERIOD", float("inf"))

    def run(words, *arguments):
        monkeypatch.setattr(sys, "argv", ["wm-drake", *shlex.split(words), *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return CommandResult(ended.value.code or 0, *capsys.readouterr())

    return run


@pytest.fixture
def check_refused(wm_drake):
    """Return a function that checks that a machine file is refused with one message."""

    def check(text, message):
        Path("mine.yaml").write_text(text, encoding="utf-8")
        ended = wm_drake("machine check mine.yaml")
        assert ended.code == 2
        assert len(ended.messages) <= 2
        assert re.search(message, ended.err), ended.err

    return check


@pytest.fixture
def no_runs(monkeypatch):
    """Return a function after whose call every simulation of several cases fails in this process."""
    return lambda: monkeypatch.setattr("wm_drake.batch.runs.integrate_runs", None)
