"""Command `wm-drake study spin-cycle`: vibration in a spin cycle for a table of unbalance cases."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.channels import RecordChannelsOption, channels_of
from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    check_buildable,
    command_line,
    existing_file,
    interruptible,
    load_parameters,
)
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import LEDGER, Run, result_folder
from wm_drake.cli.spin_drive import drive_of_run_as_json
from wm_drake.cli.spin_forces import forces_of_run_as_json
from wm_drake.cli.study.common import WorkersOption
from wm_drake.cli.terminal import Console
from wm_drake.errors import InputError, input_error, nearest_names

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import xarray as xr

    from wm_drake.batch.ledger import Ledger
    from wm_drake.parameters import MachineParameters, SpinProfile
    from wm_drake.parameters.unbalance_cases import UnbalanceCase
    from wm_drake.studies.spin_cycle.study import SpinCycleResult

DEFAULT_OUT = Path("wm-drake-spin-cycle")
CycleProfileOption = Annotated[
    str,
    typer.Option(
        help="Name of a shipped profile (spin_cycle, run_up, ifb_9kg), or file with regions.",
        metavar="NAME|FILE",
    ),
]
CasesOption = Annotated[
    Path | None,
    typer.Option(
        help="CSV file of cases: case, front_g, rear_g, phase_deg. Default: the 33 cases of "
        "[A] Table 9.",
        metavar="FILE",
    ),
]
MeasuredRmsOption = Annotated[
    Path | None,
    typer.Option(
        help="CSV file of measured RMS displacements: case, region, sensor, axis, rms_mm.",
        metavar="FILE",
    ),
]
AccelerationsOption = Annotated[
    Path | None,
    typer.Option(
        help="Folder of measured accelerations, one file CASE.csv per case: "
        "time_s, S1_x, S1_y, ... in m/s^2.",
        metavar="DIR",
    ),
]
TERMINAL_HEADS = {
    "case": "case",
    "front_g": "front, g",
    "rear_g": "rear, g",
    "phase_deg": "phase, deg",
    "largest_rms_mm": "RMS, mm",
    "region": "region",
    "sensor_axis": "sensor axis",
    "smallest_gap_mm": "gap, mm",
    "smallest_tension_N": "tension, N",
    "average_error_percent": "error, %",
    "published_error_percent": "error in [A], %",
}
"""Short column heads of the terminal table, by column of the table of cases."""


def spin_cycle(
    machine: MachineOption = "free_stroke",
    profile: CycleProfileOption = "spin_cycle",
    cases: CasesOption = None,
    case: Annotated[
        list[str] | None, typer.Option(help="Run only this case. Repeatable.", metavar="NAME")
    ] = None,
    measured: MeasuredRmsOption = None,
    accelerations: AccelerationsOption = None,
    channels: RecordChannelsOption = None,
    engine: Annotated[
        str,
        typer.Option(
            help="Engine that integrates the motion: compiled, or drake (takes minutes per case).",
            metavar="NAME",
        ),
    ] = "compiled",
    workers: WorkersOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Run a spin cycle with many unbalances, and report RMS displacements per region and sensor."""
    from wm_drake.parameters import load_profile

    if engine not in ("compiled", "drake"):
        raise input_error(
            f"unknown engine '{engine}'{nearest_names(engine, ('compiled', 'drake'))}",
            where="--engine",
        )
    parameters = load_parameters(machine, sets)
    spin_profile = load_profile(profile)
    table = cases_of_table(cases, case)
    comparison = measurement(
        parameters, table, spin_profile, measured, accelerations, channels_of(channels)
    )
    check_buildable(machine, parameters)
    kept = "finished cases are kept; repeat the command to continue"
    writer = Run(
        "study spin-cycle",
        overwrite,
        study_identity(parameters, table, spin_profile, comparison, engine=engine),
    )
    with interruptible(kept), result_folder(out, writer, kept) as folder, open_runs(out) as ledger:
        result = _run(parameters, table, spin_profile, engine, ledger, workers)
        result = result if comparison is None else _with(result, comparison)
        _write(result, folder, engine)
        ledger.mark_finished()
    diverged = [
        f"case {c.name}: {text}"
        for c, text in zip(result.cases, result.diverged, strict=True)
        if text
    ]
    typer.echo(json.dumps(_as_json(result, engine))) if as_json else _print_table(result, out)
    for message in diverged:
        typer.echo(message, err=True)
    if diverged:
        raise typer.Exit(1)


def cases_of_table(path: Path | None, names: list[str] | None) -> "list[UnbalanceCase]":
    """Return the cases that `--cases` and `--case` select."""
    from wm_drake.parameters.unbalance_cases import TABLE_9, load_unbalance_cases

    table = load_unbalance_cases(existing_file(path, "--cases") if path else TABLE_9)
    known = {case.name: case for case in table}
    for name in names or []:
        if name not in known:
            raise input_error(f"unknown case '{name}'{nearest_names(name, known)}", where="--case")
    return [known[name] for name in dict.fromkeys(names)] if names else table


def measurement(
    parameters: "MachineParameters",
    cases: "list[UnbalanceCase]",
    profile: "SpinProfile",
    measured: Path | None,
    accelerations: Path | None,
    channels: Mapping[str, str],
) -> "xr.DataArray | None":
    """Return the measured RMS displacements of `--measured` or `--accelerations`, or None."""
    from wm_drake.studies.spin_cycle.measured import read_accelerations, read_rms
    from wm_drake.studies.spin_cycle.study import labels_of, runs_of

    if measured and accelerations:
        raise input_error("not allowed together with --measured", where="--accelerations")
    if channels and not accelerations:
        raise input_error("is about the files of --accelerations", where="--channels")
    try:
        runs_of(parameters, cases, profile)  # raises an error for cases that cannot be run
    except InputError as error:
        raise InputError(
            replace(p, where="--profile", key="") if p.key == "profile" else p
            for p in error.problems
        ) from None
    labels = labels_of(parameters, cases, profile)
    if measured:
        return read_rms(existing_file(measured, "--measured"), labels)
    if accelerations:
        return read_accelerations(accelerations, labels, profile, channels)
    return None


def study_identity(
    parameters: "MachineParameters",
    cases: "list[UnbalanceCase]",
    profile: "SpinProfile",
    measured: "xr.DataArray | None",
    **others: str,
) -> dict[str, str]:
    """Return the texts that identify a study of a spin cycle: its inputs and the program."""
    from wm_drake.batch import sources_version
    from wm_drake.batch.ledger import key_of
    from wm_drake.batch.remembered import model_version

    numbers = key_of(
        machine=parameters.model_dump(exclude={"sources"}), model=model_version(parameters)
    )
    return {
        "machine": f"{parameters.name} {numbers[:8]}",
        "cases": f"{len(cases)} cases, {key_of(cases=cases)[:8]}",
        "profile": key_of(profile=profile)[:8],
        "measurements": "none" if measured is None else key_of(values=measured.values)[:8],
        "sources": sources_version(),
        **others,
    }


@contextmanager
def open_runs(out: Path) -> "Iterator[Ledger]":
    """Open the ledger of runs in a folder; the runs that it holds are used without `--resume`."""
    from wm_drake.batch.ledger import open_ledger

    out.mkdir(exist_ok=True)
    with open_ledger(out / LEDGER, {"study": "spin cycle"}, resume=True) as ledger:
        yield ledger


def _run(
    parameters: "MachineParameters",
    cases: "list[UnbalanceCase]",
    profile: "SpinProfile",
    engine: str,
    ledger: "Ledger",
    workers: int | None,
) -> "SpinCycleResult":
    from wm_drake.model.build import build_machine
    from wm_drake.studies.spin_cycle.runs import compiled_runs, drake_runs
    from wm_drake.studies.spin_cycle.study import run_spin_cycle

    with progress_bar(len(cases), "cases") as progress:
        if engine == "drake":
            evaluate = drake_runs(parameters, progress=progress)
        else:
            evaluate = compiled_runs(
                build_machine(parameters), ledger, workers=workers, progress=progress
            )
        return run_spin_cycle(parameters, cases, profile, evaluate)


def _with(result: "SpinCycleResult", measured: "xr.DataArray") -> "SpinCycleResult":
    return replace(result, measured=measured)


def _write(result: "SpinCycleResult", folder: Path, engine: str) -> None:
    from wm_drake.report.spin_cycle.drive import drive_frame
    from wm_drake.report.spin_cycle.floor import feet_table
    from wm_drake.report.spin_cycle.report import spin_cycle_report
    from wm_drake.report.spin_cycle.tables import case_table
    from wm_drake.studies.spin_cycle.measured import rms_table

    rms_table(result.displacement).to_csv(folder / "rms.csv", index=False, float_format="%.6g")
    case_table(result).to_csv(folder / "cases.csv", index=False, float_format="%.4g")
    if "turn_margin" in result.forces:
        feet_table(result).to_csv(folder / "feet.csv", index=False, float_format="%.6g")
    if (drive := drive_frame(result)) is not None:
        drive.to_csv(folder / "drive.csv", index=False, float_format="%.6g")
    command = command_line()
    (folder / "report.html").write_text(
        spin_cycle_report(result, engine, command), encoding="utf-8"
    )


def _print_table(result: "SpinCycleResult", out: Path) -> None:
    from rich.table import Table

    from wm_drake.report.spin_cycle.tables import case_table

    numbers = case_table(result)
    table = Table(
        title=f"Spin cycle of machine '{result.parameters.name}': largest RMS displacement, "
        "smallest gap, smallest spring tension"
    )
    for name in numbers.columns:
        table.add_column(TERMINAL_HEADS[str(name)], justify="right", overflow="fold")
    for row in numbers.itertuples(index=False):
        table.add_row(
            *(f"{value:.3g}" if isinstance(value, float) else str(value) for value in row)
        )
    console = Console()
    console.print(table)
    more = ", feet.csv" if "turn_margin" in result.forces else ""
    more += ", drive.csv" if "drive_peak_torque" in result.forces else ""
    console.print(f"Results in {out}: report.html, cases.csv, rms.csv{more}")


def _as_json(result: "SpinCycleResult", engine: str) -> dict[str, Any]:
    import numpy as np

    from wm_drake.studies.spin_cycle.study import (
        average_errors,
        disagreement,
        mean_and_deviation,
        region_errors,
    )

    def plain(values: Any, scale: float = 1.0) -> Any:
        """Return an array as nested lists, with None for NaN, which JSON does not have."""
        if np.ndim(values):
            return [plain(value, scale) for value in np.asarray(values)]
        return scale * float(values) if np.isfinite(values) else None

    shown: dict[str, Any] = {
        "machine": result.parameters.name,
        "engine": engine,
        "regions": [region.name for region in result.profile.regions],
        "sensors": list(map(str, result.displacement.accelerometer.values)),
        "axes": list(map(str, result.displacement.axis.values)),
        "cases": [
            {
                "case": case.name,
                "front_kg": case.front,
                "rear_kg": case.rear,
                "phase_deg": float(np.rad2deg(case.phase)),
                "rms_mm": plain(result.displacement.sel(case=case.name), 1e3),
                "rms_from_acceleration_mm": plain(result.integrated.sel(case=case.name), 1e3),
                "smallest_gap_mm": plain(result.smallest_gap.sel(case=case.name), 1e3),
                "smallest_spring_tension_N": {
                    str(name): plain(result.smallest_tension.sel(case=case.name, spring=name))
                    for name in result.smallest_tension.spring.values
                },
                **forces_of_run_as_json(result.forces.sel(case=case.name)),
                "motor": drive_of_run_as_json(result.forces.sel(case=case.name)),
                "diverged": diverged or None,
            }
            for case, diverged in zip(result.cases, result.diverged, strict=True)
        ],
        "disagreement_of_integration": plain(disagreement(result).max("case")),
    }
    if result.measured is not None:
        errors = region_errors(result.displacement, result.measured)
        mean, deviation = mean_and_deviation(errors)
        shown["relative_error"] = {
            "by_region_mean": plain(mean),
            "by_region_deviation": plain(deviation),
            "by_case_average": plain(average_errors(result.displacement, result.measured)),
        }
    return shown
