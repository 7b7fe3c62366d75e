"""What commands share: options, and the way from their texts to parameters."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.errors import InputError, Problem, input_error, nearest_names

if TYPE_CHECKING:  # Drake takes a second to import, and --help should not
    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation import Case

MachineOption = Annotated[str, typer.Option("--machine", help="Shipped machine or machine file.", metavar="NAME|FILE")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="Change a number: gasket.stiffness_x='5 N/mm'. Repeatable.", metavar="KEY=VALUE"),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else there.")]


@contextmanager
def located_in(file: str) -> Iterator[None]:
    """Adds file and line to problems that show only once the machine is built."""
    from wm_drake.parameters import located, machine_path

    try:
        yield
    except InputError as error:
        raise located(error, machine_path(file)) from None


def load_parameters(file: str, sets: list[str] | None) -> "MachineParameters":
    """The machine of a file or a shipped name, with the numbers that `--set` changes."""
    from wm_drake.parameters import load_machine, with_value

    parameters = load_machine(file)
    for entry in sets or []:
        key, separator, value = entry.partition("=")
        if not separator:
            raise input_error(f"'{entry}' is not KEY=VALUE", where="--set")
        try:
            changed = with_value(parameters, key.strip(), value.strip())
        except InputError as error:
            raise InputError(Problem("--set", p.key, p.message) for p in error.problems) from None
        parameters = changed.model_copy(update={"sources": {**changed.sources, key.strip(): "set on the command line"}})
    return parameters


def cases_of(parameters: "MachineParameters", loads: list[str] | None, gasket: bool, profile: Path | None) -> "list[Case]":
    """The cases that `--load`, `--no-gasket` and `--profile` ask for."""
    from wm_drake.parameters import load_load, load_profile
    from wm_drake.simulation import Case

    spin_profile = parameters.profile if profile is None else load_profile(existing_file(profile, "--profile"))
    cases = []
    for name in loads or list(parameters.loads):
        if name in parameters.loads:
            cases.append(Case(name, parameters.loads[name], spin_profile, gasket))
        elif Path(name).is_file():
            cases.append(Case(Path(name).stem, load_load(Path(name)), spin_profile, gasket))
        else:
            hint = nearest_names(name, parameters.loads)
            raise input_error(f"'{name}' is neither a load of machine '{parameters.name}' nor a file{hint}", where="--load")
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise input_error(f"'{name}' is asked for twice; record_{name}.nc can hold one", where="--load")
    return cases


def existing_file(path: Path, option: str) -> Path:
    """The path, if it is a file."""
    if not path.is_file():
        raise input_error(f"no such file '{path}'", where=option)
    return path


def check_buildable(file: str, parameters: "MachineParameters") -> None:
    """Finds the faults that show only in the built machine."""
    from wm_drake.machine import build_machine
    from wm_drake.parameters import measured_amplitudes

    with located_in(file):
        measured_amplitudes(parameters)
        build_machine(parameters).set_up()
