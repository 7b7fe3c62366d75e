"""Command `wm-drake record`: look at records of runs and at measurements."""

import typer

from wm_drake.cli.options import command_of
from wm_drake.studies.orders.options import ORDERS

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Look at records of runs and at measurements."""


app.command(ORDERS.name)(command_of(ORDERS))
