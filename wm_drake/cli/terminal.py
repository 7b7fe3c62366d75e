"""Text on the terminal or in a pipe: tables, sentences, and what `--quiet` leaves out."""

import functools
import inspect
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Annotated, Any, TextIO

import rich.console
import typer

from wm_drake.errors import InputNotice

QuietOption = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Print errors and what --json asks for, nothing else."),
]

_quiet: ContextVar[bool] = ContextVar("quiet", default=False)

_UNLIMITED = 100_000
"""Width of text that is not for a terminal, in characters."""


def is_quiet() -> bool:
    """Return whether the running command has the option `--quiet`."""
    return _quiet.get()


def give_quiet(app: typer.Typer) -> None:
    """Give every command of an application, and of those below it, the option `--quiet`."""
    for group in app.registered_groups:
        if group.typer_instance is not None:
            give_quiet(group.typer_instance)
    for entry in app.registered_commands:
        if entry.callback is not None:
            entry.callback = _with_quiet(entry.callback)


def _with_quiet(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command with the additional option `--quiet`, which holds while it runs."""

    @functools.wraps(command)
    def run(*arguments: Any, quiet: bool = False, **options: Any) -> Any:
        token = _quiet.set(quiet)
        try:
            with _notices_shown():
                return command(*arguments, **options)
        finally:
            _quiet.reset(token)

    signature = inspect.signature(command)
    option = inspect.Parameter(
        "quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=QuietOption
    )
    parameters = [*signature.parameters.values(), option]
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {**command.__annotations__, "quiet": QuietOption}
    return run


@contextmanager
def _notices_shown() -> Iterator[None]:
    """Print each `InputNotice` on standard error while the context lasts."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputNotice)
        others = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, InputNotice):
                say(f"notice: {message}", err=True)
            else:
                others(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield


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
        if not stream.isatty() and "COLUMNS" not in os.environ:
            options.setdefault("width", _UNLIMITED)
        super().__init__(stderr=stderr, markup=False, emoji=False, quiet=is_quiet(), **options)
