"""Option `--quiet` of all commands."""

import functools
import inspect
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer

from wm_drake.errors import InputNotice
from wm_drake.report.terminal import QUIET, say

QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print errors and what --json asks for, nothing else.")
]


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
        token = QUIET.set(quiet)
        try:
            with _notices_shown():
                return command(*arguments, **options)
        finally:
            QUIET.reset(token)

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
    """Print each `InputNotice` once on standard error while the context lasts."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputNotice)
        others, known = warnings.showwarning, set[str]()

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if not issubclass(category, InputNotice):
                others(message, category, *place)
            elif str(message) not in known:
                known.add(str(message))
                say(f"notice: {message}", err=True)

        warnings.showwarning = show  # type: ignore[assignment]
        yield
