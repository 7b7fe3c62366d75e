"""Command `wm-drake gasket`: the gasket as a part, from its drawing."""

import typer

from wm_drake.cli.options import command_of
from wm_drake.studies.gasket_curves.options import GASKET_CURVES

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Compute a gasket from its drawing."""


app.command(GASKET_CURVES.name)(command_of(GASKET_CURVES))
