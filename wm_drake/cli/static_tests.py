"""`wm-drake identify gasket --static`: force tables with hysteresis from quasi-static tests."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from wm_drake.cli.channels import LOOP_WORDS, channels_of
from wm_drake.cli.common import command_line, interruptible, pairs_of
from wm_drake.cli.components import Target, axes_of, existing_files
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console
from wm_drake.errors import input_error

if TYPE_CHECKING:
    from wm_drake.studies.identification import StaticCurve


def run_static(
    kind: str,
    files: list[Path],
    axis: str | None,
    units: str | None,
    channels: str | None,
    knots: int,
    target: Target,
    out: Path,
    overwrite: bool,
    as_json: bool,
    sets: list[str] | None,
) -> None:
    """Compute the table and the hysteresis of each axis, and write the results.

    Args:
        kind: bushing or gasket.
        files: AXIS=FILE each, or all of one axis.
        axis: That axis.
        units, channels, knots, out, overwrite, as_json, sets: Options of the command.
        target: Component whose tables are sought.
    """
    from wm_drake.report.identify.static import static_report, static_table
    from wm_drake.studies.identification import static_curve, table_entry, written_fragment

    by_axis = _files_by_axis(files, axis)
    with interruptible(), result_folder(out, Run("identify", overwrite)) as folder:
        curves = [
            static_curve(axes[0], _loops(paths, units, channels, axes[0]))
            for axes, paths in by_axis.items()
        ]
        entries = {}
        for axes, curve in zip(by_axis, curves, strict=True):
            names = ", ".join(loop.name for loop in curve.loops)
            source = f"quasi-static test {names}; half width of hysteresis {_friction_text(curve)}"
            for other in axes:
                field = f"{curve.field[:-1]}{other[-1]}"
                entries[field] = table_entry(curve.table(knots), source)
        head = ["Tables from quasi-static tests: mean of loading and unloading."]
        text = written_fragment(
            entries,
            head,
            target.component,
            target.machine,
            target.key,
            out,
            dict(pairs_of(sets, "--set")),
        )
        (folder / "identified.yaml").write_text(text, encoding="utf-8")
        static_table(curves).to_csv(folder / "static.csv", index=False, float_format="%.7g")
        found = {"component": target.component.name, "axes": [c.as_dict() for c in curves]}
        (folder / "static.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        (folder / "report.html").write_text(
            static_report(
                kind if target.component.name == kind else f"{kind} {target.component.name}",
                curves,
                command_line(),
            ),
            encoding="utf-8",
        )
    if as_json:
        typer.echo(json.dumps(found))
    else:
        _print(curves, out)


def _files_by_axis(files: list[Path], axis: str | None) -> dict[tuple[str, ...], list[Path]]:
    found: dict[tuple[str, ...], list[Path]] = {}
    for path in files:
        word, separator, name = str(path).partition("=")
        if axis is not None:
            word, name = axis, str(path)
        elif not separator:
            raise input_error(
                f"'{path}' names no axis; write for example radial={path}, or --axis", where="FILES"
            )
        found.setdefault(axes_of(word), []).append(Path(name))
    used = [one for axes in found for one in axes]
    for one in used:
        if used.count(one) > 1:
            raise input_error(f"axis {one} is tested under two names", where="FILES")
    return found


def _loops(paths: list[Path], units: str | None, channels: str | None, axis: str):  # type: ignore[no-untyped-def]
    from wm_drake.cli.identify import units_of
    from wm_drake.parameters import read_loops

    loops = read_loops(existing_files(paths), units_of(units), channels_of(channels, LOOP_WORDS))
    if loops[0].rotates != axis.startswith("about"):
        needs = "angles and moments" if axis.startswith("about") else "displacements and forces"
        raise input_error(f"axis {axis} needs {needs}", where=loops[0].path)
    return loops


def _friction_text(curve: "StaticCurve") -> str:
    return f"{curve.friction:.3g} {'N m' if curve.rotates else 'N'}"


def _print(curves: "list[StaticCurve]", out: Path) -> None:
    from rich.table import Table

    from wm_drake.report.identify.static import static_cells, static_header

    console = Console()
    table = Table(title="Quasi-static tests")
    for head in static_header():
        table.add_column(head, no_wrap=head == "axis")
    for cells in static_cells(curves):
        table.add_row(*cells)
    console.print(table)
    console.print(f"Results in {out}: report.html, identified.yaml, static.csv, static.json")
