"""Option `--figures` of all commands that write pages."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from wm_drake.cli.common import folder_of
from wm_drake.studies.result_folder import FIGURES

FiguresOption = Annotated[
    Path | None,
    typer.Option(
        "--figures",
        help="Write each picture of the page to this folder as PDF, SVG and PNG, 180 mm wide, with "
        "its data as CSV.",
        metavar="DIR",
        parser=folder_of("--figures"),
    ),
]


def writes_pages(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the option `--figures`; `result_folder` writes the pictures.

    Args:
        command: Function of a command that writes pages into a `result_folder`.
    """

    @functools.wraps(command)
    def run(*arguments: Any, figures: Path | None = None, **options: Any) -> None:
        token = FIGURES.set(figures)
        try:
            command(*arguments, **options)
        finally:
            FIGURES.reset(token)

    signature = inspect.signature(command)
    option = inspect.Parameter(
        "figures", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=FiguresOption
    )
    described: Any = run
    described.__signature__ = signature.replace(parameters=[*signature.parameters.values(), option])
    described.__annotations__ = {**command.__annotations__, "figures": FiguresOption}
    return run
