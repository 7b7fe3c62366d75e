"""Command `wm-drake export`: a machine as a file for other programs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from wm_drake.cli.common import MachineOption, OverwriteOption, SetOption
from wm_drake.cli.options import with_options
from wm_drake.export.options import FmuOptions
from wm_drake.report.terminal import say
from wm_drake.studies.inputs import load_parameters, located_in, machine_warnings
from wm_drake.written_files import check_new

app = typer.Typer(no_args_is_help=True)
DEFAULT_PAGE = Path("machine.html")


@app.callback()
def _group() -> None:
    """Export a machine to other programs."""


def fmu(
    out: Annotated[Path, typer.Option(help="File to write.", metavar="FILE.fmu")],
    machine: MachineOption = "reference",
    load: Annotated[
        str, typer.Option(help="Load with which a run begins.", metavar="NAME")
    ] = "middle",
    sets: SetOption = None,
    overwrite: OverwriteOption = False,
    **chosen: Any,
) -> None:
    """Write a machine as an FMU for co-simulation and model exchange, without Python inside."""
    from wm_drake.export.fmu import export_fmu, host_platform, real_time_factor

    parameters, options = load_parameters(machine, sets), FmuOptions(**chosen)
    for text in machine_warnings(parameters):
        say(f"warning: {text}", err=True)
    with located_in(machine):
        written = export_fmu(parameters, load, out, options, replace=overwrite)
    model = written.model
    speed = ""
    if host_platform() in written.platforms:
        speed = f", {real_time_factor(out):.0f} times real time on one core"
    say(
        f"{out}: FMI {options.fmi}.0, {len(model.variables)} variables, {len(model.states)} "
        f"states, for {', '.join(written.platforms)}; {written.size / 1e3:.0f} kB{speed}"
    )


app.command("fmu")(with_options(fmu, FmuOptions))


@app.command()
def page(
    machine: MachineOption = "reference",
    load: Annotated[
        list[str] | None,
        typer.Option(help="Load that the page runs, repeatable. Default: all.", metavar="NAME"),
    ] = None,
    out: Annotated[Path, typer.Option(help="File to write.", metavar="FILE.html")] = DEFAULT_PAGE,
    sets: SetOption = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Write a machine as one HTML file that runs it in a browser, without installation."""
    from wm_drake.live.exported import export_page

    if out.exists():
        check_new([out], replace=overwrite)
    parameters = load_parameters(machine, sets)
    for text in machine_warnings(parameters):
        say(f"warning: {text}", err=True)
    with located_in(machine):
        written = export_page(parameters, out, load or (), machine, sets or ())
    say(
        f"{out}: {written.movable} numbers to move, {written.fixed} fixed; "
        f"{written.size / 1e3:.0f} kB"
    )
