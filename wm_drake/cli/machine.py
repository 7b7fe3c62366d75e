"""Command `wm-drake machine`: check and show machine files."""

import json
from typing import Annotated

import typer

from wm_drake.cli.common import JsonOption, SetOption, check_buildable, load_parameters, located_in

app = typer.Typer(help="Check and show machine files.", no_args_is_help=True)


@app.command("check")
def machine_check(file: Annotated[str, typer.Argument(metavar="NAME|FILE")]) -> None:
    """Check a machine file. The exit code is 0, or 2 with one line per problem."""
    parameters = load_parameters(file, None)
    check_buildable(file, parameters)
    typer.echo(f"{file}: machine '{parameters.name}' is valid")


@app.command("show")
def machine_show(
    file: Annotated[str, typer.Argument(metavar="[NAME|FILE]")] = "reference",
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Show a machine in SI units.

    The output has bodies, elements, preloads, the equilibrium and the natural frequencies.
    """
    from wm_drake.model.build import build_machine
    from wm_drake.simulation.runs import checked_step
    from wm_drake.studies.description.description import as_text, describe

    parameters = load_parameters(file, sets)
    with located_in(file):
        checked_step(parameters, None)
        description = describe(build_machine(parameters))
    typer.echo(json.dumps(description, indent=1) if as_json else as_text(description))
