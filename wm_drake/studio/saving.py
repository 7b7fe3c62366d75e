"""Save what a page has chosen as a machine file that extends another one."""

import os
import re
from pathlib import Path
from typing import Any

from wm_drake.errors import InputError, input_error
from wm_drake.live.machine import OpenMachine
from wm_drake.live.state import DESCRIBED, PageState
from wm_drake.parameters import MachineParameters, load_machine, machine_path, shipped_machines
from wm_drake.parameters.files import extended_files, machine_changes, yaml_text
from wm_drake.report.provenance import now
from wm_drake.studies.run import machine_text
from wm_drake.studio.machines import Machines
from wm_drake.written_files import unwritable, write_files

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,63}")

LONGEST_ABOUT = 300
"""Largest number of characters of the text about a machine."""


class ExistsAlreadyError(InputError):
    """A machine file of this name exists already."""


def save_machine(
    machines: Machines, machine: OpenMachine, state: PageState, name: str, overwrite: bool
) -> Path:
    """Write what a page has chosen as a machine file into the folder of the machines.

    Args:
        name: Name of the new machine, without a suffix.
        overwrite: Whether a file of this name is replaced.

    Raises:
        ExistsAlreadyError: there is such a file, and `overwrite` is false.
        InputError: the name is not allowed, a number is wrong, or the file cannot be written.
    """
    if not _NAME.fullmatch(name):
        raise input_error(
            "is no name of a machine; allowed are up to 64 letters, digits, '_' and '-', a letter "
            "first",
            key="name",
        )
    if name in shipped_machines():
        raise input_error(f"'{name}' is a shipped machine; choose another name", key="name")
    path = machines.folder / f"{name}.yaml"
    base = machine_path(machines.name_or_path(state.machine))
    if path.resolve() in {other.resolve() for other in extended_files(base)}:
        raise input_error(
            f"'{name}' is the machine that the new one extends; choose another name", key="name"
        )
    if path.exists() and not overwrite:
        message = f"'{name}' exists already; save it under another name, or replace it"
        raise ExistsAlreadyError(input_error(message, key="name").problems)
    write_machine(path, machines.name_or_path(state.machine), chosen(machine, state), machine)
    return path


def chosen(machine: OpenMachine, state: PageState) -> MachineParameters:
    """Return the machine that a page has chosen: numbers, described load, gasket in or out."""
    parameters = machine.moved(state.values)
    sources = dict(parameters.sources)
    for key in state.values:
        slider = machine.sliders.get(key)
        whole = key.rpartition(".")[0] if slider is not None and slider.is_entry else key
        sources[whole] = f"set in wm-drake studio, {now()}"
    changes: dict[str, Any] = {"sources": sources}
    if state.masses:
        changes["loads"] = {**parameters.loads, DESCRIBED: state.described_load()}
    if not state.gasket:
        changes["gasket"] = None
    return parameters.model_copy(update=changes)


def mark_of(parameters: MachineParameters, state: PageState) -> str:
    """Return a text that is the same for the same machine: numbers, described load, gasket.

    Args:
        parameters: The machine with the numbers of the state.
    """
    masses = " ".join(mass.model_dump_json() for mass in state.masses)
    return f"{machine_text(parameters)} {masses} {state.gasket}"


def write_machine(
    path: Path,
    base: str | Path,
    parameters: MachineParameters,
    machine: OpenMachine,
    name: str = "",
) -> None:
    """Write a machine file that extends another one and contains only what differs.

    The file is read again before it gets its name, and must give the same machine.

    Args:
        base: Name of a shipped machine, or path of the file to extend.
        name: Name of the new machine; that of the file without.
    """
    extends = base if isinstance(base, str) else os.path.relpath(base.resolve(), path.parent)
    about = f"{machine.parameters.name}, changed in wm-drake studio"[:LONGEST_ABOUT]
    tree = {"extends": str(extends), "name": name or path.stem, "about": about}
    tree |= machine_changes(machine.parameters, parameters)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from None
    write_files(
        {path: yaml_text(tree)},
        replace=True,
        check=lambda part: _check_same(load_machine(part), parameters),
    )


def _check_same(read: MachineParameters, expected: MachineParameters) -> None:
    """Raise InputError if a file that was just written does not give the machine."""
    trees = [
        parameters.model_dump(exclude={"name", "about", "measured", "published", "sources"})
        for parameters in (read, expected)
    ]
    differ = [key for key in trees[0] if trees[0][key] != trees[1].get(key)]
    if differ:
        raise input_error(
            "a file with only what differs cannot hold this change; write the machine file by hand",
            key=differ[0],
        )
