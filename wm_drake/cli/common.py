"""Options that several commands share."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from wm_drake.errors import input_error

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
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output instead of tables.")
]

OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Replace a file that exists already.")
]


def folder_of(option: str) -> Callable[[str], Path]:
    """Return the parser of a folder; it refuses an empty text, which is the current folder."""

    def parse(text: str) -> Path:
        if not str(text).strip():
            raise input_error("is empty; name a folder", where=option)
        return Path(text)

    return parse
