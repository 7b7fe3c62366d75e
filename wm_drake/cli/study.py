"""Command `wm-drake study`: questions that need many runs, made from the declared studies."""

from typing import Any

import typer
from typer.core import TyperGroup

from wm_drake.cli.common import HELP_OPTIONS
from wm_drake.cli.options import command_of
from wm_drake.cli.quiet import give_quiet
from wm_drake.studies.study import STUDIES, Study


class StudyGroup(TyperGroup):
    """Group of commands that has the registered studies too; they are imported when needed."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all studies."""
        return sorted({*super().list_commands(ctx), *_names()})

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a study, or None if there is no such study."""
        if cmd_name not in self.commands:
            # all of them, for the names that typer proposes in place of an unknown one
            known = _names()
            names = [cmd_name] if cmd_name in known else known
            self.commands.update({name: _command(STUDIES[name]) for name in names})
        return super().get_command(ctx, cmd_name)


def _names() -> list[str]:
    """Return the names of the studies of this group."""
    return [name for name, study in STUDIES.items() if study.group == "study"]


def _command(study: Study) -> Any:
    single = typer.Typer(add_completion=False, context_settings=HELP_OPTIONS)
    single.command(study.name)(command_of(study))
    give_quiet(single)
    return typer.main.get_command(single)


app = typer.Typer(cls=StudyGroup, no_args_is_help=True)
