"""Comparison of machines, or of runs with and without gasket, by `wm-drake spin`."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from wm_drake.cli.common import cases_of, interruptible
from wm_drake.cli.spin_results import (
    Pages,
    amplitude_lines,
    case_as_json,
    divergences,
    end_with,
    gap_text,
    write_cases,
)
from wm_drake.errors import InputError, Problem, input_error, shortened
from wm_drake.report.progress import progress_bars
from wm_drake.report.provenance import command_line
from wm_drake.report.terminal import Console
from wm_drake.studies.inputs import (
    check_buildable,
    load_parameters,
    with_drive,
    with_measured,
)
from wm_drake.studies.result_folder import Run, result_folder

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import pandas as pd

    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation.cases import Case
    from wm_drake.studies.spin.comparison import Variant

LONGEST_FILE_PART = 60
"""Largest number of characters of a variant in the name of a file."""


@dataclass(frozen=True)
class Choice:
    """What to compare: the options of the command.

    Attributes:
        machines: Names or files of machines.
        loads: Names or files of loads; None for all that the machines have in common.
        no_gasket: Whether to run without gasket.
        compare_gasket: Whether to run each machine with and without gasket.
        profile: File of the spin profile; None for that of each machine.
        measured: Files of measured amplitudes; None for those of the machine files.
        sets: Changes of numbers, made in every machine.
        drive: Drive of every machine; None for that of its file.
    """

    machines: list[str]
    loads: list[str] | None
    no_gasket: bool
    compare_gasket: bool
    profile: Path | None
    measured: list[Path] | None
    sets: list[str] | None
    drive: str | None = None


@dataclass(frozen=True)
class _Planned:
    """A variant that is not yet run."""

    name: str
    parameters: "MachineParameters"
    cases: "list[Case]"


def compare(
    choice: Choice, engine: str, out: Path, overwrite: bool, pages: Pages, as_json: bool
) -> None:
    """Run the machines of a choice and write the comparison.

    Raises:
        InputError: the machines cannot be compared, or an option is wrong.
    """
    planned = _plan(choice)
    with interruptible(), result_folder(out, Run("spin", overwrite)) as folder:
        variants = _run(planned, choice, engine)
        table = _write(variants, folder, pages)
    if as_json:
        typer.echo(json.dumps(_as_json(variants, table, engine)))
    else:
        _print_tables(variants, out, pages.replay)
    end_with([f"{v.name}: {text}" for v in variants for text in divergences(v.result)])


def _plan(choice: Choice) -> list[_Planned]:
    from wm_drake.studies.spin.comparison import MOST_VARIANTS, check_comparable

    for name in choice.machines:
        if choice.machines.count(name) > 1:
            raise input_error(f"'{name}' is given twice", where="--machine")
    if choice.no_gasket and choice.compare_gasket:
        raise input_error("excludes --no-gasket; give one of them", where="--compare-gasket")
    count = len(choice.machines) * (2 if choice.compare_gasket else 1)
    if count > MOST_VARIANTS:
        raise input_error(
            f"{count} machines or variants are too many for one page; at most {MOST_VARIANTS} can "
            "be compared",
            where="--machine",
        )
    machines = [
        with_measured(_loaded(name, choice), choice.measured, "--measured")
        for name in choice.machines
    ]
    check_comparable(machines, "--machine")
    loads = choice.loads or _common_loads(machines)
    planned = []
    for file, parameters in zip(choice.machines, machines, strict=True):
        for gasket in (True, False) if choice.compare_gasket else (not choice.no_gasket,):
            cases = cases_of(parameters, loads, gasket, choice.profile)
            planned.append(_Planned(_name(parameters, gasket, choice), parameters, cases))
        if choice.compare_gasket and parameters.gasket is None:
            raise input_error(
                f"machine '{parameters.name}' has no gasket", where="--compare-gasket"
            )
        check_buildable(file, parameters)
    return planned


def _loaded(file: str, choice: Choice) -> "MachineParameters":
    """Return a machine with drive and numbers of a choice; its problems name the machine."""
    try:
        return load_parameters(file, choice.sets, partial(with_drive, drive=choice.drive))
    except InputError as error:
        raise InputError(
            Problem(
                f"--set in machine '{file}'" if p.where == "--set" else p.where, p.key, p.message
            )
            for p in error.problems
        ) from None


def _common_loads(machines: "Sequence[MachineParameters]") -> list[str]:
    """Return the loads that all machines have."""
    common = [name for name in machines[0].loads if all(name in m.loads for m in machines)]
    if not common:
        loads = "; ".join(f"'{m.name}' has {', '.join(m.loads)}" for m in machines)
        raise input_error(
            f"the machines have no load of the same name: {loads}; name a load file with --load",
            where="--machine",
        )
    return common


def _name(parameters: "MachineParameters", gasket: bool, choice: Choice) -> str:
    """Return the name of a variant: that of its machine, or what it does with the gasket."""
    if not choice.compare_gasket:
        return shortened(parameters.name, LONGEST_FILE_PART)
    words = "with gasket" if gasket else "without gasket"
    if len(choice.machines) == 1:
        return words
    return f"{shortened(parameters.name, LONGEST_FILE_PART)}, {words}"


def _run(planned: list[_Planned], choice: Choice, engine: str) -> "list[Variant]":
    from wm_drake.studies.spin.comparison import Variant
    from wm_drake.studies.spin.study import compared_cases, run_spin

    names = [f"{one.name}: {case.name}" for one in planned for case in one.cases]
    changes = choice.sets or ([choice.drive] if choice.drive else None)
    comparison = compared_cases(choice.measured, changes)
    variants: list[Variant] = []
    with progress_bars(names) as progress:
        for one in planned:
            before = sum(len(variant.result.results) for variant in variants)

            def of_all(index: int, fraction: float, before: int = before) -> None:
                progress(before + index, fraction)

            result = run_spin(
                one.parameters, one.cases, engine, progress=of_all, comparison=comparison
            )
            variants.append(Variant(one.name, result))
    return variants


def _write(variants: "list[Variant]", folder: Path, pages: Pages) -> "pd.DataFrame":
    from wm_drake.report.spin.comparison import comparison_report
    from wm_drake.report.spin.report import spin_report
    from wm_drake.studies.spin.comparison import difference_table

    parts = file_parts([variant.name for variant in variants])
    command, links = command_line(), {}
    for variant, part in zip(variants, parts, strict=True):
        replays = write_cases(variant.result, folder, pages.replay, part)
        links[variant.name] = page = f"report_{part}.html"
        text = spin_report(variant.result, command, replays, detail=pages.detail)
        (folder / page).write_text(text, encoding="utf-8")
    table = difference_table(variants)
    table.to_csv(folder / "differences.csv", index=False, float_format="%.6g")
    _amplitudes(variants).to_csv(folder / "amplitudes.csv", index=False, float_format="%.4f")
    report = comparison_report(variants, command, links)
    (folder / "report.html").write_text(report, encoding="utf-8")
    return table


def file_parts(names: Sequence[str]) -> list[str]:
    """Return parts of file names for variants: letters, digits and `_ . -` only, all different."""
    parts: list[str] = []
    for index, name in enumerate(names, start=1):
        part = re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("_.")[:LONGEST_FILE_PART]
        taken = {known.lower() for known in parts}  # some file systems ignore case
        parts.append(part if part and part.lower() not in taken else f"{part}_{index}".strip("_"))
    return parts


def _amplitudes(variants: "list[Variant]") -> "pd.DataFrame":
    import pandas as pd

    from wm_drake.report.spin.report import amplitude_table

    tables = []
    for variant in variants:
        table = amplitude_table(variant.result)
        table.insert(0, "variant", variant.name)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _print_tables(variants: "list[Variant]", out: Path, replay: bool) -> None:
    console = Console()
    console.print(amplitude_lines("Displacement amplitudes, in mm", _amplitudes(variants)))
    for variant in variants:
        for case in variant.result.results:
            if case.measures.smallest_gap:
                text = gap_text(case.measures.smallest_gap)
                console.print(f"{variant.name}, {case.case.name}: {text}")
    replays = ", replay_<variant>_<load>.html" if replay else ""
    console.print(
        f"Results in {out}: report.html, report_<variant>.html, differences.csv, amplitudes.csv, "
        f"record_<variant>_<load>.nc{replays}"
    )


def _as_json(variants: "list[Variant]", table: "pd.DataFrame", engine: str) -> dict[str, Any]:
    return {
        "engine": engine,
        "variants": [
            {
                "name": variant.name,
                "machine": variant.result.parameters.name,
                "cases": [case_as_json(case) for case in variant.result.results],
            }
            for variant in variants
        ],
        # JSON has no NaN
        "differences": [
            {key: None if value != value else value for key, value in row.items()}
            for row in table.to_dict("records")
        ],
    }
