"""The command `wm-drake`, a module per command. No physics and no statistics here: it reads, calls a study, and writes."""

import sys

import typer

from wm_drake.cli import calibrate, identify, machine, rig, spin, study
from wm_drake.errors import WmDrakeError

app = typer.Typer(
    help="Dynamics of front-loading washing machines.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.add_typer(identify.app, name="identify")
app.add_typer(machine.app, name="machine")
app.add_typer(rig.app, name="rig")
app.add_typer(study.app, name="study")
app.command()(spin.spin)
app.command()(calibrate.calibrate)


def main() -> None:
    """Runs the command; the user's mistakes end it with their message and exit code 2."""
    try:
        app()
    except WmDrakeError as error:
        typer.echo(str(error), err=True)
        sys.exit(2)
