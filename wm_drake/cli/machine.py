"""Command `wm-drake machine`: list, start, check and show machine files."""

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from wm_drake.cli.common import JsonOption, OverwriteOption, SetOption
from wm_drake.cli.new_machine import NewOptions, machine_new
from wm_drake.cli.options import with_options
from wm_drake.errors import InputError, WmDrakeError, input_error, shortened
from wm_drake.report.provenance import command_line
from wm_drake.report.terminal import say
from wm_drake.studies.inputs import built_with_problems, load_parameters, located_in
from wm_drake.written_files import check_new, write_files

app = typer.Typer(no_args_is_help=True)


@app.command("check")
def machine_check(
    files: Annotated[list[str], typer.Argument(metavar="NAME|FILE...")],
    strict: Annotated[
        bool, typer.Option("--strict", help="Treat unusual values as errors.")
    ] = False,
    page: Annotated[
        Path | None,
        typer.Option(
            help="Write a page that draws the machine: parts, springs, dampers, gasket and sensors "
            "at rest, natural frequencies, warnings. For several machines: a folder, with a page "
            "for each, written if all are valid.",
            metavar="FILE.html|FOLDER",
        ),
    ] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Check machine files. The exit code is 0, or 2 with one line per problem of any file.

    Values outside the usual range are warned of.
    """
    files = list(dict.fromkeys(files))
    paths = dict[str, Path]()
    if page:
        paths = {files[0]: page} if len(files) == 1 else _pages_in(page, files)
        check_new(paths.values(), replace=overwrite)
    texts: dict[Path, str] = {}
    errors: list[InputError] = []
    for file in files:
        try:
            _check(file, strict, partial(texts.__setitem__, paths[file]) if page else None)
        except InputError as error:
            errors.append(error)
    if errors:
        raise WmDrakeError("\n".join(map(str, errors)))
    for path, text in texts.items():
        with suppress(OSError):  # the message is that of the file
            path.parent.mkdir(parents=True, exist_ok=True)
        write_files({path: text}, replace=overwrite)
        say(f"{path}: open it in a browser")


def _check(file: str, strict: bool, draw: Callable[[str], None] | None) -> None:
    """Check a machine file and say what is unusual."""
    begin = perf_counter()
    parameters = load_parameters(file, None)
    machine, unusual = built_with_problems(file, parameters)
    if draw is not None:
        from wm_drake.studies.facts import Facts
        from wm_drake.studies.machine_show.page import machine_answer

        shown = machine_answer(machine, [str(problem) for problem in unusual])
        draw(shown.page(Facts(command_line(), perf_counter() - begin)))
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


def _pages_in(folder: Path, files: Sequence[str]) -> dict[str, Path]:
    """Return the path of the page of each of several machines.

    Raises:
        InputError: the folder is a file, or two machines would have the same page.
    """
    if folder.is_file() or folder.suffix == ".html":
        raise input_error(
            f"several machines have a folder of pages; {folder} is a file", where="--page"
        )
    paths = {file: folder / f"{Path(file).stem}.html" for file in files}
    for path in paths.values():
        same = [file for file in files if paths[file] == path]
        if len(same) > 1:
            raise input_error(
                f"{' and '.join(same)} would have the same page, {path}", where="--page"
            )
    return paths


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
    from wm_drake.studies.machine_show.description import as_text, describe

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
        from wm_drake.studies.machine_show.description import description_schema as schema
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


app.command("new")(with_options(machine_new, NewOptions))
