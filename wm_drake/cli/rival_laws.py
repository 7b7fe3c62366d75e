"""Command output of several laws that are fitted to the same tests and compared."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from wm_drake.cli.common import command_line, interruptible
from wm_drake.cli.components import Target
from wm_drake.cli.progress import progress_bars
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console

if TYPE_CHECKING:
    from wm_drake.rigs.measured import MeasuredMotion
    from wm_drake.studies.identification import Comparison, ComponentModel


def run_comparison(
    title: str,
    target: Target,
    models: "dict[str, ComponentModel]",
    motions: "list[MeasuredMotion]",
    validation: "list[MeasuredMotion]",
    copies: Mapping[str, dict[str, str]],
    *,
    method: str,
    seed: int,
    out: Path,
    overwrite: bool,
    as_json: bool,
    sets: list[str] | None,
) -> None:
    """Fit the laws, compare them, and write the results.

    Args:
        title: Component, for headings.
        target: Component whose numbers are sought.
        models: Model of each law.
        motions, validation: Tests to fit and to predict.
        copies: Fields of each law that get the value of another field.
        method, seed: Of the search.
        out, overwrite, as_json, sets: Options of the command.
    """
    from wm_drake.cli.identify import write_fragment
    from wm_drake.report.identify.comparison import (
        comparison_report,
        errors_by_law,
        laws_table,
        loops_by_law,
        parameters_by_law,
    )
    from wm_drake.studies.identification import compare_laws

    names = list(models)
    with interruptible(), result_folder(out, Run("identify", overwrite)) as folder:
        with progress_bars(names) as bars:
            comparison = compare_laws(
                models,
                motions,
                validation,
                method,
                seed=seed,
                progress=lambda law, fraction: bars(names.index(law), fraction),
            )
        told = []
        for result in comparison.results:
            path = folder / f"identified_{result.law}.yaml"
            sentence = write_fragment(
                path,
                result.fit,
                result.model,
                target,
                copies.get(result.law, {}),
                out,
                result.judgement.sentences,
                sets,
            )
            told += [sentence] if sentence else []
        laws_table(comparison).to_csv(folder / "laws.csv", index=False)
        parameters_by_law(comparison).to_csv(folder / "parameters.csv", index=False)
        errors_by_law(comparison).to_csv(folder / "errors.csv", index=False)
        loops_by_law(comparison).to_csv(folder / "loops.csv", index=False, float_format="%.7g")
        found = comparison.as_dict()
        (folder / "fit.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        (folder / "report.html").write_text(
            comparison_report(title, comparison, told, command_line()), encoding="utf-8"
        )
        written = sorted(path.name for path in folder.glob("identified_*.yaml"))
    if as_json:
        typer.echo(json.dumps({"component": title, **found}))
    else:
        _print(title, comparison, told, written, out)


def _print(
    title: str, comparison: "Comparison", told: list[str], written: list[str], out: Path
) -> None:
    from rich.table import Table

    from wm_drake.report.identify.comparison import bounds_sentences, law_cells, law_header
    from wm_drake.report.identify.report import motion_sentences

    console = Console()
    motions = (*comparison.motions, *comparison.validation)
    for sentence in (*comparison.sentences, *motion_sentences(motions)):
        console.print(sentence, highlight=False)
    table = Table(title=title)
    for head in law_header(comparison):
        table.add_column(head, no_wrap=head == "law")
    for cells in law_cells(comparison):
        table.add_row(*cells)
    console.print(table)
    for sentence in (*bounds_sentences(comparison), *told):
        console.print(sentence, highlight=False)
    files = ", ".join(
        ["report.html", *written, "laws.csv", "parameters.csv", "errors.csv", "loops.csv"]
    )
    console.print(f"Results in {out}: {files}, fit.json")
