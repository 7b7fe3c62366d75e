"""Options that several commands share, and functions that turn them into parameters and cases."""

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.terminal import say
from wm_drake.errors import InputError, Problem, input_error, nearest_names

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine
    from wm_drake.parameters import MachineParameters
    from wm_drake.parameters.keys import Tree
    from wm_drake.simulation.cases import Case

MachineOption = Annotated[
    str,
    typer.Option(
        "--machine", help="Name of a shipped machine, or machine file.", metavar="NAME|FILE"
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Change a number of the machine file: gasket.stiffness_x='5 N/mm'; null removes an "
        "element: dampers.left=null. Repeatable.",
        metavar="KEY=VALUE",
    ),
]

ProfileOption = Annotated[
    Path | None,
    typer.Option(
        help="Spin profile, YAML or CSV (time_s, speed_rpm). Default: that of the machine.",
        metavar="FILE",
    ),
]
MeasuredOption = Annotated[
    list[Path] | None,
    typer.Option(
        help="Measured amplitudes to compare with: load, gasket, source, and a column per sensor "
        "in mm. Repeatable. Default: those of the machine file, for its own numbers, loads and "
        "profile.",
        metavar="CSV",
    ),
]


def _out_folder(text: str) -> Path:
    """Return the path of a result folder; refuse an empty text, which is the current folder."""
    if not str(text).strip():
        raise input_error("is empty; name a folder", where="--out")
    return Path(text)


OutOption = Annotated[
    Path,
    typer.Option("--out", help="Folder for the results.", metavar="DIR", parser=_out_folder),
]
OverwriteOption = Annotated[
    bool,
    typer.Option(
        "--overwrite", help="Replace the results of an earlier run of this command in the folder."
    ),
]
JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object on standard output instead of tables."),
]


def command_line() -> str:
    """Return the running command as a user would type it."""
    return shlex.join(["wm-drake", *sys.argv[1:]])


@contextmanager
def interruptible(kept: str = "nothing was written") -> Iterator[None]:
    """End the command with exit code 130 on Ctrl-C, and print which results are kept.

    Args:
        kept: What is kept, for the message.
    """
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"interrupted; {kept}", err=True)
        raise typer.Exit(130) from None


@contextmanager
def located_in(file: str) -> Iterator[None]:
    """Add file and line of a machine file to the problems that the block raises."""
    from wm_drake.parameters import located, machine_path

    try:
        yield
    except InputError as error:
        raise located(error, machine_path(file)) from None


def load_parameters(
    file: str,
    sets: list[str] | None,
    change: "Callable[[MachineParameters], MachineParameters]" = lambda machine: machine,
) -> "MachineParameters":
    """Return the machine of a file or a shipped name, changed by the `--set` options.

    Args:
        file: Name or path.
        sets: Changes of numbers.
        change: Change of the machine before them.
    """
    from wm_drake.parameters import load_machine

    parameters = change(load_machine(file))
    changed, sources = with_sets(parameters, parameters.sources, sets)
    return changed.model_copy(update={"sources": sources})


def with_sets(
    parameters: "Tree", sources: Mapping[str, str], sets: list[str] | None
) -> "tuple[Tree, dict[str, str]]":
    """Return parameters and the sources of their numbers, changed by the `--set` options.

    All changes are applied before the result is checked, so their order does not matter: two
    numbers may need each other. Of two values of one key the last one counts.
    """
    from wm_drake.parameters import with_values

    changes: dict[str, str | None] = {}
    for key, text in pairs_of(sets, "--set"):
        changes.pop(key, None)
        changes[key] = None if text in ("null", "~") else text
    if not changes:
        return parameters, dict(sources)
    try:
        changed = with_values(parameters, changes)
    except InputError as error:
        raise InputError(Problem("--set", p.key, p.message) for p in error.problems) from None
    return changed, {**sources, **dict.fromkeys(changes, "set on the command line")}


def pairs_of(entries: list[str] | None, option: str) -> list[tuple[str, str]]:
    """Return the keys and values of a repeatable option KEY=VALUE."""
    found = []
    for entry in entries or []:
        key, separator, text = entry.partition("=")
        if not separator:
            raise input_error(f"'{entry}' does not have the form KEY=VALUE", where=option)
        found.append((key.strip(), text.strip()))
    return found


def warn_of_phase_error(parameters: "MachineParameters") -> None:
    """Print a warning if a machine has a phase error, which runs of its loads do not use."""
    from wm_drake.simulation.cases import UNUSED_PHASE_ERROR

    if parameters.imperfections.phase_error:
        say(f"warning: {UNUSED_PHASE_ERROR}", err=True)


def warn_of_jumping_friction(parameters: "MachineParameters") -> None:
    """Print a warning if a damper has Coulomb friction, which no fixed step resolves."""
    types = {damper.type for damper in parameters.dampers.values()}
    types |= {damper.type for damper in parameters.telescopic_dampers.values()}
    if any(parameters.damper_types[name].law == "coulomb" for name in types):
        say(
            "warning: Coulomb friction jumps where a damper reverses. Amplitudes of the compiled "
            "engine were 5 to 80 % off in tests (docs/performance.md); the law mstv does not jump.",
            err=True,
        )


def cases_of(
    parameters: "MachineParameters", loads: list[str] | None, gasket: bool, profile: Path | None
) -> "list[Case]":
    """Return the cases that `--load`, `--no-gasket` and `--profile` select."""
    from wm_drake.parameters import load_load, load_profile
    from wm_drake.parameters.text_files import is_file
    from wm_drake.simulation.cases import Case

    warn_of_phase_error(parameters)
    warn_of_jumping_friction(parameters)
    spin_profile = (
        parameters.profile if profile is None else load_profile(existing_file(profile, "--profile"))
    )
    cases = []
    for name in loads or list(parameters.loads):
        if name in parameters.loads:
            cases.append(Case(name, parameters.loads[name], spin_profile, gasket))
        elif is_file(Path(name)):
            cases.append(Case(Path(name).stem, load_load(Path(name)), spin_profile, gasket))
        else:
            hint = nearest_names(name, parameters.loads)
            raise input_error(
                f"'{name}' is neither a load of machine '{parameters.name}' nor a file{hint}",
                where="--load",
            )
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise input_error(
                f"'{name}' is given twice, but file record_{name}.nc can hold only one run",
                where="--load",
            )
    return cases


def with_measured(
    parameters: "MachineParameters", files: list[Path] | None, option: str
) -> "MachineParameters":
    """Return the machine with other files of measured amplitudes, if any are given."""
    if not files:
        return parameters
    paths = tuple(str(existing_file(path, option).resolve()) for path in files)
    return parameters.model_copy(update={"measured": paths})


def existing_file(path: Path, option: str) -> Path:
    """Return the path if it is a file; otherwise raise an InputError for the option."""
    from wm_drake.parameters.text_files import is_file

    if not is_file(path):
        raise input_error(f"no such file '{path}'", where=option)
    return path


def check_buildable(file: str, parameters: "MachineParameters") -> "tuple[Problem, ...]":
    """Raise an InputError for faults that only building the machine reveals.

    Returns:
        Values of the machine that are legal but unusual, with file and line.
    """
    return _built(file, parameters)[1]


def build_checked(file: str, parameters: "MachineParameters") -> "Machine":
    """Return the built machine, after the checks of `check_buildable`."""
    return _built(file, parameters)[0]


def _built(file: str, parameters: "MachineParameters") -> "tuple[Machine, tuple[Problem, ...]]":
    from wm_drake.engines.compiled.packing import pack
    from wm_drake.engines.compiled.stepping import choose_stepping
    from wm_drake.model.build import build_machine
    from wm_drake.model.expectations import unexpected
    from wm_drake.model.plausibility import unusual_values
    from wm_drake.model.scene import Scene
    from wm_drake.parameters import located, machine_path, measured_amplitudes, published_results
    from wm_drake.parameters.files import check_tables
    from wm_drake.simulation.runs import checked_step

    with located_in(file):
        check_tables(parameters)
        measured_amplitudes(parameters)
        published_results(parameters.published)
        step = checked_step(parameters, None)
        machine = build_machine(parameters)
        setup = machine.set_up()
        choose_stepping(setup, *pack(setup), parameters.profile, step, parameters.integrator)
        scene = Scene(parameters)
    unusual = [*unusual_values(setup), *unexpected(setup, scene)]
    problems = located(InputError(unusual), machine_path(file)).problems if unusual else ()
    return machine, problems
