"""Command `wm-drake rerun`: run the study of an archive again, and compare."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from wm_drake.report.provenance import source_revision, version
from wm_drake.report.terminal import say
from wm_drake.written_files import temporary_folder


def rerun(
    archive: Annotated[Path, typer.Argument(help="File of --archive.", metavar="FILE")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the new results.", metavar="DIR")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace earlier results in the folder.")
    ] = False,
) -> None:
    """Run the study of an archive again, and compare.

    Say what differs; the exit code is 1 if anything does.
    """
    from wm_drake.studies.archive import differences, libraries, read_archive, study_of
    from wm_drake.studies.run import execute, order_of

    with temporary_folder() as folder:
        archived, about, tables = read_archive(archive, folder)
        study = study_of(archived.study, str(archive))
        say(f"{archived.command}  ({about['date']}, revision {about['revision']})")
        here = {"wm_drake": version(), "revision": source_revision(), **libraries()}
        there = {"wm_drake": about["version"], "revision": about["revision"], **about["libraries"]}
        for name in here:
            if here[name] != there.get(name):
                say(f"{name}: {there.get(name, 'not known')} in the archive, {here[name]} here")
        machines = list(archived.machines)
        defaults = study.all_options.model_construct().model_dump(mode="json")
        options = {  # a default that is given may be refused beside other options
            name: value
            for name, value in archived.options.items()
            if name in archived.chosen or value != defaults.get(name)
        }
        given = {**options, **archived.run, "out": out, "overwrite": overwrite}
        if study.has_runs:
            given["resume"] = True  # what an earlier, interrupted command has left
        if machines:
            is_one = study.all_options.model_fields["machine"].annotation is str
            given["machine"] = machines[0] if is_one else machines
        order = replace(order_of(study, given, archived.command), parameters=archived.machines)
        result, *_ = execute(order)
        names = {str(folder / name): text for name, text in about["files"].items()}
    lines = list(differences(tables, result.tables(), names))
    for line in lines:
        typer.echo(line)
    count = len(tables)
    say(f"{count - len(lines)} of {count} tables are the same")
    if lines:
        raise typer.Exit(1)
