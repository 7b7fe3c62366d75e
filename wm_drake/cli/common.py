"""Options that several commands share, and functions that turn them into parameters and cases."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.errors import input_error
from wm_drake.report.terminal import say
from wm_drake.studies.inputs import machine_warnings, selected_cases

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation.cases import Case

HELP_OPTIONS = {"help_option_names": ["-h", "--help"]}
"""Settings of click: options that print the help."""

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


def folder_of(option: str) -> Callable[[str], Path]:
    """Return the parser of a folder; it refuses an empty text, which is the current folder."""

    def parse(text: str) -> Path:
        if not str(text).strip():
            raise input_error("is empty; name a folder", where=option)
        return Path(text)

    return parse


OutOption = Annotated[
    Path,
    typer.Option("--out", help="Folder for the results.", metavar="DIR", parser=folder_of("--out")),
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


def warn_of(parameters: "MachineParameters") -> None:
    """Print the warnings of a machine on standard error."""
    for text in machine_warnings(parameters):
        say(f"warning: {text}", err=True)


def cases_of(
    parameters: "MachineParameters", loads: list[str] | None, gasket: bool, profile: Path | None
) -> "list[Case]":
    """Return the cases that the options select, and print the warnings of the machine."""
    warn_of(parameters)
    return selected_cases(parameters, loads, gasket, profile)
