"""`wm-drake study spin-identify`: numbers of a machine from vibrations of the whole of it in a spin cycle."""

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    SetOption,
    check_buildable,
    command_line,
    interruptible,
    load_parameters,
)
from wm_drake.cli.progress import progress_bar, result_folder
from wm_drake.cli.study.common import WorkersOption
from wm_drake.cli.study.spin_cycle import cases_of_table, measurement, open_runs
from wm_drake.errors import input_error

if TYPE_CHECKING:
    from wm_drake.parameters import MachineParameters
    from wm_drake.studies.spin_identification.study import Sought, SpinIdentification

DEFAULT_OUT = Path("wm-drake-spin-identify")
PER_CENT = 100


def spin_identify(
    machine: MachineOption = "free_stroke",
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            help="Number to find, with or without a range: gasket.stiffness_x+gasket.stiffness_z='(4, 12) N/mm', where + joins "
            "equal numbers. Repeatable; those of [A] Table 8 by default.",
            metavar="KEYS[=RANGE]",
        ),
    ] = None,
    profile: Annotated[
        str,
        typer.Option(
            help="Shipped profile (spin_cycle, run_up, ifb_9kg), or file with regions.",
            metavar="NAME|FILE",
        ),
    ] = "spin_cycle",
    cases: Annotated[
        Path | None,
        typer.Option(help="CSV of cases: case,front_g,rear_g,phase_deg.", metavar="FILE"),
    ] = None,
    case: Annotated[
        list[str] | None,
        typer.Option(
            help="Use this case. Repeatable; of [A] Table 9, 2, 5 and 29 by default.",
            metavar="NAME",
        ),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(help="Measured RMS: CSV case,region,sensor,axis,rms_mm.", metavar="FILE"),
    ] = None,
    accelerations: Annotated[
        Path | None, typer.Option(help="Folder of measured accelerations, CASE.csv.", metavar="DIR")
    ] = None,
    noise: Annotated[
        float,
        typer.Option(help="Of a virtual experiment: relative errors of its numbers.", min=0.0),
    ] = 0.005,
    seed: Annotated[
        int, typer.Option(help="Of what a virtual experiment plants, and of the search.")
    ] = 0,
    workers: WorkersOption = None,
    out: Annotated[
        Path,
        typer.Option(
            help="Folder for the results; runs found there are not run again.", metavar="DIR"
        ),
    ] = DEFAULT_OUT,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Find numbers of a machine from RMS displacements; without measurements, from those of a virtual experiment."""
    from wm_drake.parameters import load_profile
    from wm_drake.studies.spin_identification.study import DEFAULT_CASES, SpinModel

    parameters = load_parameters(machine, sets)
    spin_profile = load_profile(profile)
    table = cases_of_table(cases, case or (None if cases else list(DEFAULT_CASES)))
    given = measurement(parameters, table, spin_profile, measured, accelerations)
    sought = unknowns_of(parameters, unknown)
    check_buildable(machine, parameters)
    model = partial(SpinModel, parameters, spin_profile, tuple(table), sought)
    kept = "runs that had ended are kept, the same command goes on from there"
    with interruptible(kept), result_folder(out) as folder, open_runs(out) as ledger:
        result = _identify(model, given, noise, seed, ledger, workers)
        _write(result, folder)
        ledger.mark_finished()
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_table(result, out)


def unknowns_of(parameters: "MachineParameters", texts: list[str] | None) -> "tuple[Sought, ...]":
    """The unknowns that `--unknown` names."""
    from wm_drake.errors import InputError, Problem
    from wm_drake.studies.spin_identification.study import JOIN, TABLE_8, sought_of

    if not texts:
        names = {key for keys in TABLE_8 for key in keys}
        missing = [
            name
            for name in sorted(names)
            if name.split(".")[0] == "bushing_types" and not parameters.bushing_types
        ]
        if missing or parameters.gasket is None:
            raise input_error(
                f"machine '{parameters.name}' has not the numbers of [A] Table 8; name others",
                where="--unknown",
            )
        return tuple(sought_of(parameters, keys) for keys in TABLE_8)
    found = []
    for text in texts:
        names_text, separator, range_text = text.partition("=")
        keys = [key.strip() for key in names_text.split(JOIN)]
        try:
            found.append(
                sought_of(
                    parameters, keys, _range(parameters, keys[0], range_text) if separator else None
                )
            )
        except InputError as error:
            raise InputError(
                Problem("--unknown", p.key, p.message) for p in error.problems
            ) from None
    return tuple(found)


def _range(parameters: "MachineParameters", key: str, text: str) -> tuple[float, float]:
    """`(lower, upper) unit` in SI."""
    from wm_drake.parameters.units import convert
    from wm_drake.studies.spin_identification.study import unit_of_key

    unit = unit_of_key(parameters, key)
    inside, _, unit_text = text.strip().removeprefix("(").partition(")")
    parts = [part.strip() for part in inside.split(",")]
    try:
        lower, upper = (convert(float(part), unit_text.strip() or None, unit) for part in parts)
    except ValueError as error:
        reason = str(error) if "unit" in str(error) else f"'{text.strip()}' is not a range"
        raise input_error(f"{reason}; write for example '(1, 2) {unit.shown}'", key=key) from None
    return lower, upper


def _identify(
    model: Any, given: Any, noise: float, seed: int, ledger: Any, workers: int | None
) -> "SpinIdentification":
    from wm_drake.batch import simulate_remembered
    from wm_drake.model.machine import build_machine
    from wm_drake.studies.spin_identification.study import (
        identify_from_spin,
        planted_values,
        virtual_experiment,
    )

    built = build_machine(model.args[0])
    regions = partial(
        simulate_remembered, built, ledger=ledger, measures=("regions",), workers=workers
    )
    with progress_bar(PER_CENT, "search, %") as progress:
        ready, planted = model(regions), None
        if given is None:
            planted = planted_values(ready.sought, seed)
            given = virtual_experiment(ready, planted, noise, seed)
        tell = lambda fraction, least: progress(round(PER_CENT * fraction))  # noqa: E731
        return identify_from_spin(ready, given, planted=planted, seed=seed, progress=tell)


def _write(result: "SpinIdentification", folder: Path) -> None:
    from wm_drake.report.spin_identify.report import spin_identify_report
    from wm_drake.studies.spin_cycle.measured import rms_table

    rms_table(result.measured).to_csv(folder / "measured.csv", index=False, float_format="%.6g")
    rms_table(result.after).to_csv(folder / "rms.csv", index=False, float_format="%.6g")
    command = command_line()
    (folder / "report.html").write_text(spin_identify_report(result, command), encoding="utf-8")


def _print_table(result: "SpinIdentification", out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    from wm_drake.report.spin_identify.report import directions, summary, unknowns

    console = Console()
    console.print(summary(result))
    shown = unknowns(result)
    table = Table()
    for name in shown.header:
        table.add_column(
            name,
            justify="left" if name in ("unknown", "equal numbers") else "right",
            overflow="fold",
        )
    for group in shown.groups:
        table.add_row(group.heading, *group.rows[0].cells)
    console.print(table)
    for text in directions(result):
        console.print(text)
    console.print(f"Results in {out}: report.html, measured.csv, rms.csv")


def _as_json(result: "SpinIdentification") -> dict[str, Any]:
    from wm_drake.studies.spin_cycle.study import average_errors

    shown = result.fit.as_dict()
    for k, (sought, entry) in enumerate(
        zip(result.sought, shown["unknowns"].values(), strict=True)
    ):
        entry |= {
            "keys": list(sought.keys),
            "found": result.fit.estimates[k].value,
            "identifiable": result.identifiable[k],
        }
        if result.planted is not None and result.recovered is not None:
            entry |= {"planted": float(result.planted[k]), "error": float(result.recovered[k])}
    return {
        "machine": result.parameters.name,
        "virtual_experiment": result.planted is not None,
        "cases": [case.name for case in result.cases],
        "average_error_before": float(average_errors(result.before, result.measured).mean()),
        "average_error_after": float(average_errors(result.after, result.measured).mean()),
        **shown,
    }
