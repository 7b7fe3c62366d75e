"""Fixtures for all rooms: the reference machine, the command `wm-drake`; property tests run the same examples every time."""

import sys
from dataclasses import dataclass

import pytest
from hypothesis import settings

from wm_drake.cli import main
from wm_drake.model.machine import build_machine
from wm_drake.parameters import load_machine

settings.register_profile("same_every_time", derandomize=True, deadline=None, database=None)
settings.load_profile("same_every_time")


@pytest.fixture(scope="session")
def reference():
    """The shipped reference machine; frozen, so that tests may share it."""
    return load_machine("reference")


@pytest.fixture(scope="session")
def machine(reference):
    """The reference machine, built; every test sets up a Context of its own."""
    return build_machine(reference)


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def messages(self):
        """Lines on standard error."""
        return self.err.splitlines()


@pytest.fixture
def wm_drake(monkeypatch, capsys, tmp_path):
    """Runs `wm-drake` in this process, in a folder of its own: wm_drake("machine", "check", "reference").code == 0."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("wm_drake.cli.progress.LINE_PERIOD", float("inf"))

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["wm-drake", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return Ended(ended.value.code or 0, *capsys.readouterr())

    return run
