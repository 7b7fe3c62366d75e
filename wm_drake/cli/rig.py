"""`wm-drake rig`: a component on a bench, its force loops, and their measures."""

import typer

from wm_drake.cli.components import DamperCommand
from wm_drake.cli.options import command_of
from wm_drake.studies.rig.options import RIG

app = typer.Typer(no_args_is_help=True)
for study in RIG.values():
    app.command(study.name, cls=DamperCommand)(command_of(study))
