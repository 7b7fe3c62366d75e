"""Command `wm-drake study gasket-effect`: a machine without and with its gasket, in one run."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    MeasuredOption,
    OutOption,
    OverwriteOption,
    ProfileOption,
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
from wm_drake.cli.spin_results import compared_cases
from wm_drake.cli.terminal import Console, say

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import pandas as pd

    from wm_drake.studies.gasket_effect.study import GasketEffect

DEFAULT_OUT = Path("wm-drake-gasket-effect")


def gasket_effect(
    machine: MachineOption = "reference",
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable. Default: middle and counter, or "
            "all loads of a machine without them.",
            metavar="NAME|FILE",
        ),
    ] = None,
    profile: ProfileOption = None,
    measured: MeasuredOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Compare runs without and with the gasket: envelopes, amplitudes and the steady state."""
    from wm_drake.errors import input_error
    from wm_drake.report.gasket_effect.report import gasket_effect_report, summary
    from wm_drake.simulation.records import save_record
    from wm_drake.studies.gasket_effect.study import LOADS, effect_table, run_gasket_effect

    parameters = with_measured(load_parameters(machine, sets), measured, "--measured")
    if parameters.gasket is None:
        raise input_error(f"machine '{parameters.name}' has no gasket", key="gasket")
    default = [name for name in LOADS if name in parameters.loads]
    cases = cases_of(parameters, load or default, True, profile)
    check_buildable(machine, parameters)
    names = [f"{c.name}, {text}" for text in ("without gasket", "with gasket") for c in cases]
    with (
        interruptible(),
        result_folder(out, Run("study gasket-effect", overwrite)) as folder,
    ):
        with progress_bars(names) as progress:
            effect = run_gasket_effect(
                parameters, cases, progress=progress, comparison=compared_cases(measured, sets)
            )
        table = effect_table(effect)
        for variant in effect.variants:
            for result in variant.result.results:
                name = f"record_{variant.name.replace(' ', '_')}_{result.case.name}.nc"
                save_record(result.record, folder / name)
        table.to_csv(folder / "effect.csv", index=False, float_format="%.6g")
        page = gasket_effect_report(effect, command_line())
        (folder / "report.html").write_text(page, encoding="utf-8")
    if as_json:
        typer.echo(json.dumps(_as_json(effect, table), allow_nan=False))
    else:
        _print_table(effect, table)
        say(summary(table))
        say(f"Results in {out}: report.html, effect.csv, record_<variant>_<load>.nc")
    diverged = [
        f"{case.case.name}, {variant.name}: {case.record.attrs['diverged']}"
        for variant in effect.variants
        for case in variant.result.results
        if case.record.attrs["diverged"]
    ]
    for message in diverged:
        typer.echo(message, err=True)
    if diverged:
        raise typer.Exit(1)


def _as_json(effect: "GasketEffect", table: "pd.DataFrame") -> dict[str, object]:
    from wm_drake.studies.gasket_effect.study import steady_window

    rows = [
        {key: None if value != value else value for key, value in row.items()}  # JSON has no NaN
        for row in table.to_dict("records")
    ]
    return {
        "machine": effect.without.parameters.name,
        "steady_window_s": steady_window(effect.without.results[0].case.profile),
        "amplitudes": rows,
    }


def _print_table(effect: "GasketEffect", table: "pd.DataFrame") -> None:
    from rich.table import Table

    name = effect.without.parameters.name
    shown = Table(title=f"Amplitudes of machine '{name}' without and with gasket, in mm")
    for title in ("load", "sensor"):
        shown.add_column(title)
    columns = {
        "without_mm": "with-\nout",
        "with_mm": "with",
        "percent": "differ-\nence, %",
        "experiment_percent": "experi-\nment, %",
        "steady_without_mm": "steady,\nwithout",
        "steady_with_mm": "steady,\nwith",
        "steady_percent": "differ-\nence, %",
    }
    kept = [key for key in columns if table[key].notna().any()]
    for key in kept:
        shown.add_column(columns[key], justify="right")
    for row in table.to_dict("records"):
        texts = (f"{row[k]:+.0f}" if "percent" in k else f"{row[k]:.1f}" for k in kept)
        shown.add_row(
            row["load"], row["sensor"], *("–" if text.endswith("nan") else text for text in texts)
        )
    Console().print(shown)
