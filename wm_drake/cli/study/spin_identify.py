"""Command `wm-drake study spin-identify`: fit numbers of a machine to a spin cycle."""

import json
from functools import partial
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
    interruptible,
    load_parameters,
)
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.study.common import WorkersOption
from wm_drake.cli.study.spin_cycle import (
    AccelerationsOption,
    CasesOption,
    CycleProfileOption,
    MeasuredRmsOption,
    cases_of_table,
    measurement,
    open_runs,
    study_identity,
)
from wm_drake.cli.terminal import Console, say
from wm_drake.errors import input_error

if TYPE_CHECKING:
    from wm_drake.parameters import MachineParameters
    from wm_drake.studies.spin_identification.study import Sought, SpinIdentification

DEFAULT_OUT = Path("wm-drake-spin-identify")
PER_CENT = 100
"""Length of the progress bar of the search."""


def spin_identify(
    machine: MachineOption = "free_stroke",
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            help="Number to find, with or without a range: gasket.stiffness_y='(1, 4) N/mm'. "
            "KEY1+KEY2 are two keys with the same value. Repeatable. Default: the numbers of [A] "
            "Table 8.",
            metavar="KEYS[=RANGE]",
        ),
    ] = None,
    profile: CycleProfileOption = "spin_cycle",
    cases: CasesOption = None,
    case: Annotated[
        list[str] | None,
        typer.Option(
            help="Use only this case. Repeatable. Default: those of --cases, or 2, 5 and 29 of [A] "
            "Table 9.",
            metavar="NAME",
        ),
    ] = None,
    measured: MeasuredRmsOption = None,
    accelerations: AccelerationsOption = None,
    channels: RecordChannelsOption = None,
    noise: Annotated[
        float,
        typer.Option(
            help="Relative standard deviation of the noise in a virtual experiment.", min=0.0
        ),
    ] = 0.005,
    seed: Annotated[
        int,
        typer.Option(
            help="Seed of the planted values of a virtual experiment, and of the search.", min=0
        ),
    ] = 0,
    workers: WorkersOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Fit numbers of a machine to RMS displacements in a spin cycle.

    Without measurements, the displacements come from a virtual experiment.
    """
    from wm_drake.batch.ledger import key_of
    from wm_drake.parameters import load_profile
    from wm_drake.studies.spin_identification.study import DEFAULT_CASES, SpinModel

    parameters = load_parameters(machine, sets)
    spin_profile = load_profile(profile)
    table = cases_of_table(cases, case or (None if cases else list(DEFAULT_CASES)))
    given = measurement(
        parameters, table, spin_profile, measured, accelerations, channels_of(channels)
    )
    sought = unknowns_of(parameters, unknown)
    check_buildable(machine, parameters)
    model = partial(SpinModel, parameters, spin_profile, tuple(table), sought)
    kept = "finished runs are kept; repeat the command to continue"
    identity = study_identity(
        parameters,
        table,
        spin_profile,
        given,
        unknowns=key_of(sought=sought)[:8],
        noise=f"{noise:g}, seed {seed}",
    )
    writer = Run("study spin-identify", overwrite, identity)
    with interruptible(kept), result_folder(out, writer, kept) as folder, open_runs(out) as ledger:
        result = _identify(model, given, noise, seed, ledger, workers)
        _write(result, folder)
        ledger.mark_finished()
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_table(result, out)


def unknowns_of(parameters: "MachineParameters", texts: list[str] | None) -> "tuple[Sought, ...]":
    """Return the unknowns that `--unknown` names, or those of [A] Table 8 if there are none."""
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
                f"machine '{parameters.name}' does not have the numbers of [A] Table 8; give keys "
                "of this machine",
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
    """Return the bounds of a text `(lower, upper) unit` in SI."""
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
    from wm_drake.model.build import build_machine
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

        def show(fraction: float, _least: float) -> None:
            progress(round(PER_CENT * fraction))

        return identify_from_spin(ready, given, planted=planted, seed=seed, progress=show)


def _write(result: "SpinIdentification", folder: Path) -> None:
    from wm_drake.parameters import machine_yaml
    from wm_drake.report.spin_identify.report import spin_identify_report, values_table
    from wm_drake.studies.spin_cycle.measured import rms_table
    from wm_drake.studies.spin_identification.study import identified_machine

    text = machine_yaml(identified_machine(result))
    (folder / "identified.yaml").write_text(text, encoding="utf-8")
    values_table(result).to_csv(folder / "parameters.csv", index=False, float_format="%.7g")
    rms_table(result.measured).to_csv(folder / "measured.csv", index=False, float_format="%.6g")
    rms_table(result.after).to_csv(folder / "rms.csv", index=False, float_format="%.6g")
    command = command_line()
    (folder / "report.html").write_text(spin_identify_report(result, command), encoding="utf-8")


def _print_table(result: "SpinIdentification", out: Path) -> None:

    from wm_drake.report.spin_identify.report import directions, summary, unknowns, warnings_of

    console = Console()
    for text in (summary(result), *warnings_of(result)):
        console.print(text, highlight=False)
    shown = unknowns(result)
    rows = [shown.header[2:], *(group.rows[0].cells[1:] for group in shown.groups)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  " + "  ".join(map(str.rjust, row, widths)) for row in rows]
    # each key has a line of its own, so that no terminal breaks it
    say(f"\n{lines[0]}")
    for sought, line in zip(result.sought, lines[1:], strict=True):
        say("\n= ".join(sought.keys))
        say(line)
    say("")
    for text in directions(result):
        console.print(text, highlight=False, markup=False)
    say(f"Results in {out}: report.html, identified.yaml, parameters.csv, measured.csv, rms.csv")


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
        "average_error_after": result.error_after,
        "verdict": result.verdict,
        **shown,
    }
