"""Machines that pages open: one at a time for each file, without holding up the others."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from wm_drake.errors import InputError, input_error
from wm_drake.studio import machines as machines_module
from wm_drake.studio.machines import MOST_OPEN, Machines


@pytest.fixture
def machines(tmp_path, monkeypatch):
    """Return machines whose files are not read: a machine is the name of its file."""
    monkeypatch.setattr(machines_module, "load_machine", lambda path: path)
    monkeypatch.setattr(Machines, "_opened", lambda self, name: [name])
    return Machines("reference", tmp_path)


def test_machine_that_is_built_does_not_hold_up_others(machines, monkeypatch):
    (machines.folder / "slow.yaml").write_text("")
    go_on, opened = threading.Event(), []

    def opened_slowly(_machines, name):
        if name != "reference":
            assert go_on.wait(20.0)
        opened.append(name)
        return [name]

    monkeypatch.setattr(Machines, "_opened", opened_slowly)
    with ThreadPoolExecutor(2) as pool:
        slow = [pool.submit(machines.open, "slow.yaml") for _ in range(2)]
        assert machines.open("reference") == ["reference"]
        go_on.set()
        assert slow[0].result() is slow[1].result()
    assert opened == ["reference", machines.folder / "slow.yaml"]


def test_machine_with_an_error_is_read_again(machines, monkeypatch):
    def failed(_machines, _name):
        raise input_error("is wrong")

    with monkeypatch.context() as patch:
        patch.setattr(Machines, "_opened", failed)
        with pytest.raises(InputError, match="is wrong"):
            machines.open("reference")
    assert machines.open("reference") == ["reference"]


def test_only_some_machines_are_kept_open(machines):
    for number in range(MOST_OPEN + 5):
        (machines.folder / f"m{number}.yaml").write_text("")
        machines.open(f"m{number}.yaml")
    assert len(machines._open) == MOST_OPEN


def test_folders_and_other_files_are_not_listed(machines):
    (machines.folder / "folder.yaml").mkdir()
    (machines.folder / "notes.txt").write_text("")
    assert [name for name, kind in machines.listed().items() if kind == "saved"] == []
