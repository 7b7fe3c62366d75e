"""`wm-drake identify table2`: the Coulomb model fitted to each test, as in [C] Table 2."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    command_line,
    interruptible,
)
from wm_drake.cli.components import existing_files, quantities_of
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console
from wm_drake.errors import input_error

if TYPE_CHECKING:
    from wm_drake.rigs.measured import HarmonicMotion

FREQUENCIES = (1.0, 3.0, 6.67, 10.0)
"""Frequencies of [C] Table 1. [Hz]"""

AMPLITUDE = 1e-3
"""Amplitude of [C] Fig. 7. [m]"""


def identify_table2(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Measured sines; by default loops of the shipped MSTV damper.",
            metavar="[FILES...]",
        ),
    ] = None,
    friction_force: Annotated[
        str | None,
        typer.Option(
            help="f_max of the Coulomb model, not printed in [C]; 45 N by default.", metavar="FORCE"
        ),
    ] = None,
    units: Annotated[
        str | None,
        typer.Option(help="Of time, displacement, force: 's,mm,N'.", metavar="UNITS"),
    ] = None,
    out: OutOption = Path("wm-drake-table2"),
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit k1 and c1 of the Coulomb model to each test alone, beside [C] Table 2."""
    from wm_drake.report.identify.table2 import HEADER, fit_cells, sentences, table2_report
    from wm_drake.studies.identification.drift import coulomb_fits, frequency_trend

    damper = _damper(friction_force)
    f_max = float(damper.friction_force)
    slider_damping = float(damper.slider_damping)
    if files:
        source = f"{len(files)} measured tests, f_max = {f_max:g} N."
        motions = _measured_motions(files, units)
    else:
        source = f"Loops of the MSTV damper of [C] section 4.2, f_max = {f_max:g} N."
        motions = _printed_motions(damper)
    with interruptible(), result_folder(out, Run("identify table2", overwrite)) as folder:
        with progress_bar(len(motions), "fits") as progress:
            fits = coulomb_fits(motions, f_max, slider_damping, progress)
        trend = frequency_trend(damper, FREQUENCIES, AMPLITUDE)
        fits.to_csv(folder / "table2.csv", index=False, float_format="%.6g")
        page = table2_report(fits, trend, source, command_line())
        (folder / "report.html").write_text(page, encoding="utf-8")
    if as_json:
        rows = json.loads(fits.to_json(orient="records", double_precision=15))
        typer.echo(json.dumps({"tests": rows, "peak_force_over_frequency": asdict(trend)}))
        return
    _print(source, HEADER, fit_cells(fits), sentences(fits, trend), out)


def _damper(friction_force: str | None) -> Any:
    """Return the MSTV damper of [C], with f_max of the option `--friction-force` if it is given."""
    from wm_drake.parameters.units import Unit
    from wm_drake.studies.identification.drift import mstv_of_c

    damper = mstv_of_c()
    if friction_force is None:
        return damper
    force = quantities_of(friction_force, Unit("N", "N"), "--friction-force")[0]
    if not force > 0.0:
        raise input_error(f"is {force:g} N; allowed is > 0", where="--friction-force")
    return damper.model_copy(update={"friction_force": force})


def _measured_motions(files: list[Path], units: str | None) -> "list[HarmonicMotion]":
    """Return the motions of measured files, which have to be sines of displacement."""
    from wm_drake.cli.identify import units_of
    from wm_drake.parameters import read_loops
    from wm_drake.rigs.measured import HarmonicMotion, measured_motion

    motions = []
    for loop in read_loops(existing_files(files), units_of(units)):
        motion = measured_motion(loop)
        if not isinstance(motion, HarmonicMotion) or loop.rotates:
            raise input_error(
                "is no sine of displacement; [C] Table 2 is of sines", where=loop.path
            )
        motions.append(motion)
    return motions


def _printed_motions(damper: Any) -> "list[HarmonicMotion]":
    """Return loops of the MSTV damper at the tests of [C] Table 2."""
    from wm_drake.rigs import Harmonic
    from wm_drake.studies.identification.drift import MM, mstv_motions, printed_table

    table = printed_table()
    pairs = zip(table.frequency_hz, table.amplitude_mm, strict=True)
    return mstv_motions(damper, [Harmonic(f, a * MM) for f, a in pairs])


def _print(
    source: str, header: tuple[str, ...], cells: list[tuple[str, ...]], told: list[str], out: Path
) -> None:
    from rich.table import Table

    console = Console()
    table = Table(title=source)
    for head in header:
        table.add_column(head, justify="right")
    for row in cells:
        table.add_row(*row)
    console.print(table)
    for sentence in told:
        console.print(sentence, highlight=False)
    console.print(f"Results in {out}: report.html, table2.csv")
