"""Command `wm-drake spin`: simulate a spin run and report the motion of the tub."""

import json
import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    MeasuredOption,
    OutOption,
    OverwriteOption,
    ProfileOption,
    SetOption,
    cases_of,
    interruptible,
)
from wm_drake.cli.spin_comparison import Choice, compare
from wm_drake.cli.spin_results import (
    Pages,
    amplitude_lines,
    case_as_json,
    divergences,
    drive_text,
    end_with,
    gap_text,
    measure_lines,
    write_cases,
)
from wm_drake.errors import input_error, nearest_names
from wm_drake.report.progress import progress_bars
from wm_drake.report.provenance import command_line
from wm_drake.report.terminal import Console, say
from wm_drake.studies.inputs import (
    check_buildable,
    load_parameters,
    with_drive,
    with_measured,
)
from wm_drake.studies.result_folder import Run, result_folder

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.studies.spin.study import SpinResult

DEFAULT_OUT = Path("wm-drake-spin")
DriveOption = Annotated[
    str | None,
    typer.Option(
        help="Drive in place of that of the machine file: prescribed (follows the profile exactly) "
        "or motor (the default motor with torque limit and speed controller, or the motor of the "
        "machine file).",
        metavar="NAME",
    ),
]


def spin(
    machine: Annotated[
        list[str] | None,
        typer.Option(
            help="Name of a shipped machine, or machine file. Repeatable: several machines are "
            "compared on one page. Default: reference.",
            metavar="NAME|FILE",
        ),
    ] = None,
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable. Default: all loads of the "
            "machine; of several machines, those that all have.",
            metavar="NAME|FILE",
        ),
    ] = None,
    no_gasket: Annotated[bool, typer.Option("--no-gasket", help="Run without the gasket.")] = False,
    compare_gasket: Annotated[
        bool,
        typer.Option("--compare-gasket", help="Compare with and without the gasket on one page."),
    ] = False,
    profile: ProfileOption = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="Engine that integrates the motion: compiled (default) or drake (slow reference).",
            metavar="NAME",
        ),
    ] = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    replay: Annotated[
        bool,
        typer.Option(
            "--replay", help="Also write a 3D replay around the largest amplitude of each load."
        ),
    ] = False,
    detail: Annotated[
        bool,
        typer.Option(
            "--detail",
            help="Draw mount forces, accelerations and spectra of every load, not only of the load "
            "with the largest amplitude.",
        ),
    ] = False,
    measured: MeasuredOption = None,
    drive: DriveOption = None,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Simulate the run-up of the drum through the resonances, and report the motion of the tub."""
    from wm_drake.simulation.runs import DEFAULT_ENGINE, ENGINES
    from wm_drake.studies.spin.study import compared_cases, run_spin

    engine = engine or DEFAULT_ENGINE
    if engine not in ENGINES:
        raise input_error(
            f"unknown engine '{engine}'{nearest_names(engine, ENGINES)}", where="--engine"
        )
    machines = machine or ["reference"]
    if len(machines) > 1 or compare_gasket:
        choice = Choice(machines, load, no_gasket, compare_gasket, profile, measured, sets, drive)
        compare(choice, engine, out, overwrite, Pages(replay, detail), as_json)
        return
    loaded = load_parameters(machines[0], sets, partial(with_drive, drive=drive))
    parameters = with_measured(loaded, measured, "--measured")
    cases = cases_of(parameters, load, not no_gasket, profile)
    check_buildable(machines[0], parameters)
    with interruptible(), result_folder(out, Run("spin", overwrite)) as folder:
        with progress_bars([case.name for case in cases]) as progress:
            result = run_spin(
                parameters,
                cases,
                engine,
                progress=progress,
                comparison=compared_cases(measured, sets or ([drive] if drive else None)),
                modes=True,
            )
        _write(result, folder, Pages(replay, detail))
    diverged = divergences(result)
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_tables(result, out, replay)
    _warn_of_slack_springs(result)
    end_with(diverged)


def _warn_of_slack_springs(result: "SpinResult") -> None:
    from wm_drake.report.spin.report import slack_springs_warning

    for text in slack_springs_warning(result):
        say(f"warning: {text}", err=True)


def _write(result: "SpinResult", folder: Path, pages: Pages) -> None:
    from wm_drake.report.spin.report import amplitude_table, spin_report

    replays = write_cases(result, folder, pages.replay)
    amplitude_table(result).to_csv(folder / "amplitudes.csv", index=False, float_format="%.4f")
    command = command_line()
    page = spin_report(result, command, replays, detail=pages.detail)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _print_tables(result: "SpinResult", out: Path, replay: bool) -> None:
    from wm_drake.report.spin.report import amplitude_table

    title = f"Displacement amplitudes of machine '{result.parameters.name}', in mm"
    console = Console()
    console.print(amplitude_lines(title, amplitude_table(result)))
    for case in result.results:
        if case.measures.smallest_gap:
            console.print(f"{case.case.name}: {gap_text(case.measures.smallest_gap)}")
        tensions = case.measures.smallest_tension
        shown = zip(tensions.spring.values, tensions.values, strict=True)
        console.print(
            f"{case.case.name}: smallest spring tension "
            + ", ".join(f"{name} {tension:.1f} N" for name, tension in shown)
        )
        if result.parameters.drive.kind == "motor":
            console.print(f"{case.case.name}: {drive_text(case.measures)}")
        for line in measure_lines(case):
            console.print(line)
        if (walk := case.measures.walk) is not None:
            console.print(
                f"{case.case.name}: the cabinet walks {1e3 * walk.distance:.1f} mm and turns by "
                f"{math.degrees(walk.turn):.1f} deg"
            )
    replays = ", replay_<load>.html" if replay else ""
    console.print(f"Results in {out}: report.html, amplitudes.csv, record_<load>.nc{replays}")


def _as_json(result: "SpinResult") -> dict[str, Any]:
    return {
        "machine": result.parameters.name,
        "engine": result.engine,
        "cases": [case_as_json(case) for case in result.results],
    }
