"""Groups of commands of studies: help that names the damper laws, files after `--validate`."""

from collections.abc import Iterable
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from wm_drake.cli.common import HELP_OPTIONS
from wm_drake.cli.options import command_of
from wm_drake.cli.quiet import give_quiet
from wm_drake.studies.study import STUDIES, Study


class DamperCommand(TyperCommand):
    """A command whose help names the registered damper laws, which take a second to import.

    ``{laws}`` in the help of an option becomes the names of all laws, ``{laws_with_mass}`` the
    names of those whose sponge may have a mass on the bench.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help with the names of the laws."""
        from wm_drake.parameters import DAMPER_LAWS

        with_mass = [law.name for law in DAMPER_LAWS.values() if law.sponge_with_mass is not None]
        names = {"{laws}": ", ".join(DAMPER_LAWS), "{laws_with_mass}": " or ".join(with_mass)}
        described: list[Any] = [option for option in self.params if getattr(option, "help", None)]
        for option in described:
            for mark, text in names.items():
                option.help = option.help.replace(mark, text)
        super().format_help(ctx, formatter)


class ValidatingCommand(DamperCommand):
    """A command whose option ``--validate`` takes all names that follow it, as a shell expands it.

    Without this, of ``--validate held/*.csv`` only the first file would be held out, and the fit
    would see the others.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option before each name that follows it."""
        spread, follows = list[str](), False
        for word in args:
            if word == "--validate":
                follows = True
                continue
            follows = follows and not word.startswith("-")
            spread += ["--validate", word] if follows else [word]
        if args and args[-1] == "--validate":
            spread.append("--validate")  # click says that its value is missing
        return super().parse_args(ctx, spread)


def group_of(studies: Iterable[Study]) -> typer.Typer:
    """Return a group with the commands of studies."""
    group = typer.Typer(no_args_is_help=True)
    group.callback()(lambda: None)  # else a single command would have no name
    for study in studies:
        cls = ValidatingCommand if study.group in ("identify", "rig") else None
        group.command(study.name, cls=cls)(command_of(study))
    return group


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
"""Command `wm-drake study`: questions that need many runs, made from the declared studies."""
