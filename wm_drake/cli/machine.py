"""Command `wm-drake machine`: list, start, check and show machine files."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.common import JsonOption, SetOption
from wm_drake.cli.new_machine import machine_new_with_options
from wm_drake.errors import InputError, input_error, shortened
from wm_drake.report.terminal import say
from wm_drake.studies.inputs import (
    built_with_problems,
    load_parameters,
    located_in,
)

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.errors import Problem
    from wm_drake.model.machine import Machine

app = typer.Typer(no_args_is_help=True)


@app.command("check")
def machine_check(
    file: Annotated[str, typer.Argument(metavar="NAME|FILE")],
    strict: Annotated[
        bool, typer.Option("--strict", help="Treat unusual values as errors.")
    ] = False,
    page: Annotated[
        Path | None,
        typer.Option(
            help="Write a page that draws the machine: parts, springs, dampers, gasket and sensors "
            "at rest, natural frequencies, warnings.",
            metavar="FILE.html",
        ),
    ] = None,
) -> None:
    """Check a machine file. The exit code is 0, or 2 with one line per problem.

    Values outside the usual range are warned of.
    """
    parameters = load_parameters(file, None)
    machine, unusual = built_with_problems(file, parameters)
    if page is not None:
        _write_page(page, machine_page_of(machine, unusual))
    if unusual and strict:
        raise InputError(unusual)
    for problem in unusual:
        typer.echo(f"warning: {problem}", err=True)
    if not parameters.clearance:
        say(
            f"{file}: assumption: without 'clearance' the tub point nearest to the detergent box "
            f"is frame '{parameters.clearance_frame}', that of the first sensor"
        )
    say(f"{file}: machine '{parameters.name}' is valid")


def machine_page_of(machine: "Machine", unusual: "Sequence[Problem]") -> str:
    """Return the page of a machine with its unusual values."""
    from wm_drake.studies.description.page import machine_page

    return machine_page(machine, [str(problem) for problem in unusual])


def _write_page(path: Path, text: str) -> None:
    """Write a page.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise input_error(f"cannot be written to: {error.strerror}", where=str(path)) from None
    say(f"{path}: open it in a browser")


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
    from wm_drake.simulation.steps import checked_step
    from wm_drake.studies.description.description import as_text, describe

    parameters = load_parameters(file, sets)
    with located_in(file):
        checked_step(parameters, None)
        description = describe(build_machine(parameters))
    typer.echo(json.dumps(description, indent=1) if as_json else as_text(description))


@app.command("schema")
def machine_schema(
    of: Annotated[
        str,
        typer.Argument(
            help="'file': machine files, for the completion of an editor. 'description': the "
            "output of `machine show --json`.",
            metavar="[file|description]",
        ),
    ] = "file",
) -> None:
    """Print the JSON schema of machine files, or of the output of `machine show --json`."""
    if of == "file":
        from wm_drake.parameters.file_keys import file_schema as schema
    elif of == "description":
        from wm_drake.studies.description.schema import description_schema as schema
    else:
        raise input_error(
            f"no schema of '{shortened(of, 40)}'; allowed are file, description",
            where="machine schema",
        )
    typer.echo(json.dumps(schema(), indent=1))


@app.command("list")
def machine_list(as_json: JsonOption = False) -> None:
    """List the machines that wm_drake contains."""
    from wm_drake.parameters import load_machine
    from wm_drake.parameters.files import shipped_machines

    about = {name: load_machine(name).about for name in shipped_machines()}
    if as_json:
        typer.echo(json.dumps(about))
        return
    width = max(map(len, about))
    for name, text in about.items():
        typer.echo(f"{name:{width}}  {text}")


app.command("new")(machine_new_with_options())
