"""Command `wm-drake`, one module per command.

Enters: options and files. Leaves: printed results and result files. A command reads its input,
calls a study, and writes the results; this room contains no physics and no statistics.
May import: all other rooms; neither pydrake nor a plotting library.
"""

import atexit
import gc
import sys
from typing import Annotated

import typer

from wm_drake.cli import export, gasket, identify, machine, record, rig, studio, study
from wm_drake.cli.common import HELP_OPTIONS
from wm_drake.cli.options import command_of
from wm_drake.cli.quiet import give_quiet
from wm_drake.errors import Problem, WmDrakeError, reason_of
from wm_drake.studies.calibration.options import CALIBRATE
from wm_drake.studies.spin.options import SPIN
from wm_drake.studies.verdict.options import VERDICT

app = typer.Typer(
    help="Dynamics of front-loading washing machines.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings=HELP_OPTIONS,
)
app.add_typer(export.app, name="export")
app.add_typer(gasket.app, name="gasket")
app.add_typer(identify.app, name="identify")
app.add_typer(machine.app, name="machine")
app.add_typer(record.app, name="record")
app.add_typer(rig.app, name="rig")
app.add_typer(study.app, name="study")
for declared in (VERDICT, SPIN, CALIBRATE):
    app.command(declared.name)(command_of(declared))
app.command()(studio.studio)
give_quiet(app)


def _print_version(requested: bool) -> None:
    if requested:
        from wm_drake.report.provenance import program

        typer.echo(program())
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Print version and source revision, and exit.",
            callback=_print_version,
            is_eager=True,
        ),
    ] = False,
) -> None:
    """Dynamics of front-loading washing machines."""


def main() -> None:
    """Run the command; an error of the input or the disk ends it with a message and exit code 2."""
    # Imports and studies make a million objects that stay; looking through them would take a
    # quarter of the time of the imports. Results are freed without the collector.
    gc.set_threshold(1_000_000, 20, 20)
    atexit.register(gc.freeze)  # the end of Python would look through them once more
    try:
        app()
    except WmDrakeError as error:
        typer.echo(str(error), err=True)
    except OSError as error:  # a disk that is full, a folder that cannot be read
        typer.echo(str(Problem(str(error.filename or "file"), "", reason_of(error))), err=True)
    except MemoryError:
        typer.echo("out of memory", err=True)
    else:
        return
    sys.exit(2)
