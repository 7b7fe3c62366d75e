"""Command `wm-drake`, one module per command.

Enters: options and files. Leaves: printed results and result files. A command reads its input,
calls a study, and writes the results; this room contains no physics and no statistics.
May import: all other rooms; neither pydrake nor a plotting library.
"""

import atexit
import codecs
import copy
import functools
import gc
import os
import pkgutil
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from wm_drake.cli.common import HELP_OPTIONS
from wm_drake.errors import Problem, WmDrakeError, libraries_named, reason_of

COMMANDS = {
    "verdict": (
        "wm_drake.studies.verdict.options:VERDICT",
        "Say whether the tub touches the housing, how likely that is, and what to change.",
    ),
    "spin": (
        "wm_drake.studies.spin.options:SPIN",
        "Simulate the run-up of the drum through the resonances, and report the motion of the tub.",
    ),
    "calibrate": (
        "wm_drake.studies.calibrate.options:CALIBRATE",
        "Fit unknown numbers of a machine to measured amplitudes, or to records of its sensors.",
    ),
    "studio": (
        "wm_drake.cli.studio:studio",
        "Open a page on this computer that runs a machine again at each move of a slider.",
    ),
    "export": ("wm_drake.cli.export:app", "Export a machine to other programs."),
    "gasket": (
        "wm_drake.studies.gasket_curves.options:GASKET_CURVES",
        "Compute a gasket from its drawing.",
    ),
    "identify": (
        "wm_drake.studies.identify.options:IDENTIFY",
        "Find the numbers of a component from measured loops.",
    ),
    "machine": ("wm_drake.cli.machine:app", "List, start, check and show machine files."),
    "record": (
        "wm_drake.cli.record:app",
        "Look at records of runs and at measurements.",
    ),
    "rig": (
        "wm_drake.studies.rig.options:RIG",
        "Test a component on a bench: harmonic motion, steady force loops.",
    ),
    "rerun": ("wm_drake.cli.rerun:rerun", "Run the study of an archive again, and compare."),
    "cite": ("wm_drake.cli.cite:cite", "Print how to cite the program and its papers."),
    "study": ("wm_drake.cli.components:app", "Run a study of many runs and write a report."),
}
"""Home and line of help of each command: a function, declared studies, or a group of commands."""


class Commands(TyperGroup):
    """Group of `COMMANDS`; each is imported when it is called, none for the list of them."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return list(dict.fromkeys((*COMMANDS, *super().list_commands(ctx))))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command, or None if there is no such command."""
        if cmd_name not in self.commands:
            # all of them, for the names that typer proposes in place of an unknown one
            names = [cmd_name] if cmd_name in COMMANDS else list(COMMANDS)
            self.commands.update({name: _command(name) for name in names})
        return super().get_command(ctx, cmd_name)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, with the lines of `COMMANDS`."""
        listed = copy.copy(self)
        listed.commands = {
            name: TyperCommand(name, help=text) for name, (_, text) in COMMANDS.items()
        }
        super(Commands, listed).format_help(ctx, formatter)


@functools.cache
def _command(name: str) -> Any:
    """Import a command."""
    from wm_drake.cli.components import group_of
    from wm_drake.cli.options import command_of
    from wm_drake.cli.quiet import give_quiet
    from wm_drake.studies.study import Study

    home, text = COMMANDS[name]
    declared = pkgutil.resolve_name(home)
    single = typer.Typer(add_completion=False)
    if isinstance(declared, Study) and not declared.group:
        single.command(name)(command_of(declared))
    elif isinstance(declared, typer.Typer):
        single.add_typer(declared, name=name, help=text)
    elif callable(declared):
        single.command(name)(declared)
    else:
        studies = (declared,) if isinstance(declared, Study) else declared
        single.add_typer(group_of(studies), name=name, help=text)
    give_quiet(single)
    return typer.main.get_group(single).commands[name]


app = typer.Typer(
    cls=Commands,
    help="Dynamics of front-loading washing machines.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings=HELP_OPTIONS,
)


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
    if codecs.lookup(sys.getfilesystemencoding()).name == "ascii" and not sys.flags.utf8_mode:
        # Drake cannot be imported in such a locale, as LC_ALL=C with PYTHONUTF8=0 makes it
        command = [sys.executable, "-X", "utf8", "-m", "wm_drake", *sys.argv[1:]]
        os.execve(sys.executable, command, {**os.environ, "PYTHONUTF8": "1"})
    # Imports and studies make a million objects that stay; looking through them would take a
    # quarter of the time of the imports. Results are freed without the collector.
    gc.set_threshold(1_000_000, 20, 20)
    atexit.register(gc.freeze)  # the end of Python would look through them once more
    try:
        with libraries_named():
            app()
    except SystemExit as end:
        error: BaseException | None = end
        while error is not None and not isinstance(error, KeyboardInterrupt):
            error = error.__cause__ or error.__context__
        if error is None:
            raise
        typer.echo(str(error) or "interrupted", err=True)
        sys.exit(130)
    except WmDrakeError as error:
        typer.echo(str(error), err=True)
    except OSError as error:  # a disk that is full, a folder that cannot be read
        typer.echo(str(Problem(str(error.filename or ""), "", reason_of(error))), err=True)
    except MemoryError:
        typer.echo("out of memory", err=True)
    else:
        return
    sys.exit(2)
