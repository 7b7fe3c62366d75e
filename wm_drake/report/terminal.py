"""Write text to the terminal or a pipe: tables, and sentences that `--quiet` leaves out."""

import os
import sys
from contextvars import ContextVar
from typing import Any

import rich.console
import typer

QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether the running command has the option `--quiet`."""

_UNLIMITED = 100_000
"""Width of text that is not for a terminal, in characters."""


def is_quiet() -> bool:
    """Return whether the running command has the option `--quiet`."""
    return QUIET.get()


def say(text: str, *, err: bool = False) -> None:
    """Print a sentence about results or progress, unless the command is quiet."""
    if not is_quiet():
        typer.echo(text, err=err)


class Console(rich.console.Console):
    """Console for tables and sentences.

    In a pipe or a file, lines are not wrapped; the variable COLUMNS sets another width. Square
    brackets and colons in names are printed as they are. With `--quiet` nothing is printed.
    """

    def __init__(self, *, stderr: bool = False, **options: Any) -> None:
        """Choose the width from the stream."""
        stream = sys.stderr if stderr else sys.stdout
        if not (stream and stream.isatty()) and "COLUMNS" not in os.environ:
            options.setdefault("width", _UNLIMITED)
        super().__init__(stderr=stderr, markup=False, emoji=False, quiet=is_quiet(), **options)
