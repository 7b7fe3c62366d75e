"""Command `wm-drake spin`: simulate a spin run and report the motion of the tub."""

import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    cases_of,
    check_buildable,
    command_line,
    interruptible,
    load_parameters,
    with_measured,
)
from wm_drake.cli.progress import progress_bars
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console
from wm_drake.errors import input_error, nearest_names

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation.cases import Case
    from wm_drake.simulation.measures import Measures
    from wm_drake.studies.spin.study import CaseResult, SpinResult

DEFAULT_OUT = Path("wm-drake-spin")


def spin(
    machine: MachineOption = "reference",
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable. Default: all loads of the "
            "machine.",
            metavar="NAME|FILE",
        ),
    ] = None,
    no_gasket: Annotated[bool, typer.Option("--no-gasket", help="Run without the gasket.")] = False,
    profile: Annotated[
        Path | None,
        typer.Option(
            help="Spin profile, YAML or CSV (time_s, speed_rpm). Default: that of the machine.",
            metavar="FILE",
        ),
    ] = None,
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
    measured: Annotated[
        list[Path] | None,
        typer.Option(
            help="Measured amplitudes to compare with: load, gasket, source, and a column per "
            "sensor in mm. Repeatable. Default: those of the machine file, for its own numbers, "
            "loads and profile.",
            metavar="CSV",
        ),
    ] = None,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Simulate the run-up of the drum through the resonances, and report the motion of the tub."""
    from wm_drake.simulation.runs import DEFAULT_ENGINE, ENGINES

    engine = engine or DEFAULT_ENGINE
    if engine not in ENGINES:
        raise input_error(
            f"unknown engine '{engine}'{nearest_names(engine, ENGINES)}", where="--engine"
        )
    parameters = with_measured(load_parameters(machine, sets), measured, "--measured")
    cases = cases_of(parameters, load, not no_gasket, profile)
    check_buildable(machine, parameters)
    with interruptible(), result_folder(out, Run("spin", overwrite)) as folder:
        comparison = "all" if measured else "none" if sets else "as measured"
        result = _run(parameters, cases, engine, comparison)
        _write(result, folder, replay)
    diverged = [
        f"{r.case.name}: {r.record.attrs['diverged']}"
        for r in result.results
        if r.record.attrs["diverged"]
    ]
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_tables(result, out, replay)
    for message in diverged:
        typer.echo(message, err=True)
    if diverged:
        raise typer.Exit(1)


def _run(
    parameters: "MachineParameters", cases: "list[Case]", engine: str, comparison: str
) -> "SpinResult":
    from wm_drake.studies.spin.study import Comparison, run_spin

    with progress_bars([case.name for case in cases]) as progress:
        return run_spin(
            parameters, cases, engine, progress=progress, comparison=Comparison(comparison)
        )


def _write(result: "SpinResult", folder: Path, replay: bool) -> None:
    from wm_drake.report.spin.report import amplitude_table, spin_report
    from wm_drake.simulation.records import save_record

    replays = {}
    for case in result.results:
        save_record(case.record, folder / f"record_{case.case.name}.nc")
        if replay:
            replays[case.case.name] = name = f"replay_{case.case.name}.html"
            (folder / name).write_text(_replay(result, case), encoding="utf-8")
    amplitude_table(result).to_csv(folder / "amplitudes.csv", index=False, float_format="%.4f")
    command = command_line()
    (folder / "report.html").write_text(spin_report(result, command, replays), encoding="utf-8")


def _replay(result: "SpinResult", case: "CaseResult") -> str:
    from wm_drake.model.scene import replay_page
    from wm_drake.simulation.measures import largest_motion

    # Meshcat would print the address of its server
    logging.getLogger("drake").setLevel(logging.WARNING)
    time, positions = largest_motion(case.record)
    return replay_page(result.parameters, time, positions)


def _print_tables(result: "SpinResult", out: Path, replay: bool) -> None:
    from rich.table import Table

    from wm_drake.parameters.units import Unit
    from wm_drake.report.spin.report import amplitude_table

    table = Table(title=f"Displacement amplitudes of machine '{result.parameters.name}', in mm")
    amplitudes = amplitude_table(result)
    for name in amplitudes.columns:
        table.add_column(
            str(name),
            justify="left" if name in ("load", "gasket", "source") else "right",
            overflow="fold",
        )
    for row in amplitudes.itertuples(index=False):
        table.add_row(
            *(f"{value:.1f}" if isinstance(value, float) else str(value) for value in row)
        )
    millimetre = Unit("m", "mm")
    console = Console()
    console.print(table)
    for case in result.results:
        gap = case.measures.smallest_gap
        if gap:
            console.print(
                f"{case.case.name}: smallest gap {millimetre.from_si(gap.distance):.1f} mm between "
                f"{gap.moving} and {gap.fixed}, at {gap.time:.2f} s"
            )
    replays = ", replay_<load>.html" if replay else ""
    console.print(f"Results in {out}: report.html, amplitudes.csv, record_<load>.nc{replays}")


def _as_json(result: "SpinResult") -> dict[str, Any]:
    return {
        "machine": result.parameters.name,
        "engine": result.engine,
        "cases": [_case_as_json(case) for case in result.results],
    }


def _case_as_json(case: "CaseResult") -> dict[str, Any]:
    from wm_drake.parameters.units import Unit

    measures = case.measures
    millimetre = Unit("m", "mm")

    def numbers(values: Any, unit: Unit, prefix: str = "") -> dict[str, float | None]:
        labels = [f"{prefix}{label}" for label in values[values.dims[0]].values]
        # JSON has no NaN
        shown = [unit.from_si(float(value)) if value == value else None for value in values.values]
        return dict(zip(labels, shown, strict=True))

    return {
        "load": case.case.name,
        "gasket": case.record.attrs["gasket"] == "yes",
        "amplitudes_mm": numbers(measures.amplitude, millimetre),
        "detergent_box_mm": numbers(measures.detergent_displacement, millimetre, "D"),
        "gasket_force_N": numbers(measures.gasket_force, Unit("N", "N"), "F"),
        "gasket_moment_Nm": numbers(measures.gasket_moment, Unit("N*m", "N*m"), "M"),
        "mount_force_N": _mount_forces(measures),
        "smallest_gap_mm": millimetre.from_si(measures.smallest_gap.distance)
        if measures.smallest_gap
        else None,
        "critical_rpm": numbers(measures.critical_speed, Unit("rad/s", "rpm")),
        "diverged": case.record.attrs["diverged"] or None,
        "wall_s": case.wall_s,
    }


def _mount_forces(measures: "Measures") -> dict[str, dict[str, float | None]]:
    """Return peak and RMS values of the force of each mount on the cabinet, by mount. [N]"""
    found: dict[str, dict[str, float | None]] = {}
    for kind in ("peak", "rms", "dynamic_rms"):
        values = getattr(measures, f"mount_force_{kind}")
        for mount, value in zip(values.mount.values, map(float, values.values), strict=True):
            found.setdefault(str(mount), {})[kind] = value if value == value else None
    return found
