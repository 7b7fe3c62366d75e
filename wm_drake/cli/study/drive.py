"""Command `wm-drake study drive`: how strong a drive must be, and unbalance seen by the drive."""

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    ProfileOption,
    SetOption,
    cases_of,
    check_buildable,
    command_line,
    load_parameters,
)
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.spin_drive import with_drive
from wm_drake.cli.study.common import (
    RUNS_KEPT,
    ClusterOption,
    ResumeOption,
    SeedOption,
    WorkersOption,
    batch_runner,
    study_identity,
    study_ledger,
    with_progress,
)
from wm_drake.cli.terminal import Console, say

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.studies.drive.study import DriveResult

DEFAULT_OUT = Path("wm-drake-drive")


def drive(
    machine: Annotated[
        str,
        typer.Option(
            help="Name of a shipped machine, or machine file. A prescribed speed is replaced by "
            "the default motor.",
            metavar="NAME|FILE",
        ),
    ] = "motor",
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable. Default: all loads.",
            metavar="NAME|FILE",
        ),
    ] = None,
    profile: ProfileOption = None,
    torques: Annotated[
        int, typer.Option(help="Torque limits of the map.", min=2, max=50, metavar="N")
    ] = 9,
    unbalances: Annotated[
        int, typer.Option(help="Unbalances of the map.", min=2, max=50, metavar="N")
    ] = 6,
    loads: Annotated[
        int,
        typer.Option(
            help="Random loads of the estimation of unbalance; 0 for none.", min=0, metavar="N"
        ),
    ] = 48,
    speed: Annotated[
        float, typer.Option(help="Speed of the estimation. [rpm]", min=30.0, max=300.0)
    ] = 90.0,
    seed: SeedOption = 0,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    resume: ResumeOption = False,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Find the weakest motor that passes every critical speed, and estimate the unbalance."""
    begin = time.perf_counter()
    from wm_drake.model.build import build_machine
    from wm_drake.studies.drive.study import MEASURES, motor_with_limit, run_drive

    parameters = load_parameters(machine, sets, partial(with_drive, drive="motor"))
    motor_with_limit(parameters)
    cases = cases_of(parameters, load, True, profile)
    check_buildable(machine, parameters)
    built = build_machine(parameters)
    identity = study_identity("drive", parameters, MEASURES, seed, profile=cases[0].profile)
    writer = Run("study drive", overwrite, identity)
    with study_ledger(out, writer, identity, resume) as ledger:
        with batch_runner(built, ledger, MEASURES, workers, cluster) as batch:
            run = with_progress(batch)
            result = run_drive(built, cases, run, (torques, unbalances), (loads, speed, seed))
        ledger.mark_finished()
        with result_folder(out, writer, RUNS_KEPT) as folder:
            _write(result, folder, time.perf_counter() - begin)
    _print_result(result, out, as_json)


def _write(result: "DriveResult", folder: Path, wall_s: float) -> None:
    from wm_drake.report.drive.report import drive_report
    from wm_drake.studies.drive.tables import estimation_table, map_table, thresholds_table

    thresholds_table(result).to_csv(folder / "thresholds.csv", index=False, float_format="%.6g")
    map_table(result).to_csv(folder / "map.csv", index=False, float_format="%.6g")
    if result.estimation is not None:
        estimation_table(result).to_csv(folder / "estimation.csv", index=False, float_format="%.6g")
    page = drive_report(result, command_line(), wall_s)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _print_result(result: "DriveResult", out: Path, as_json: bool) -> None:
    from rich.table import Table

    from wm_drake.report.drive.report import summary, threshold_cells
    from wm_drake.studies.drive.tables import as_plain_data
    from wm_drake.studies.gasket.tables import to_json

    if as_json:
        typer.echo(to_json(as_plain_data(result)))
        return
    table = Table(title=f"Smallest torque limit of machine '{result.parameters.name}'")
    for name in ("load", "at the motor, N m", "at the drum, N m", "caught just below at"):
        table.add_column(name, justify="left" if name == "load" else "right")
    for threshold in result.thresholds:
        table.add_row(threshold.load, *threshold_cells(result, threshold))
    Console().print(table)
    say(summary(result))
    estimated = ", estimation.csv" if result.estimation is not None else ""
    say(f"Results in {out}: report.html, thresholds.csv, map.csv{estimated}")
