"""`wm-drake identify`: the numbers of a component from measured loops."""

import typer

from wm_drake.cli.components import ValidatingCommand
from wm_drake.cli.options import command_of
from wm_drake.studies.identification.options import IDENTIFY

app = typer.Typer(no_args_is_help=True)
for study in IDENTIFY:
    app.command(study.name, cls=ValidatingCommand)(command_of(study))
