"""Results of a spin run on the terminal, in files and as JSON, for one machine or several."""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from wm_drake.cli.spin_drive import drive_as_json
from wm_drake.cli.spin_forces import forces_as_json

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import pandas as pd
    from rich.table import Table

    from wm_drake.model.scene import Gap
    from wm_drake.studies.spin.study import CaseResult, Comparison, SpinResult


@dataclass(frozen=True)
class Pages:
    """Which pages and pictures are written beside the usual ones.

    Attributes:
        replay: A 3D replay for each case.
        detail: Pictures of vibration for every case, not only for the main one.
    """

    replay: bool
    detail: bool


def compared_cases(measured: list[Path] | None, sets: list[str] | None) -> "Comparison":
    """Return which cases are compared with measured amplitudes, from the options of a command."""
    from wm_drake.studies.spin.study import Comparison

    if measured:
        return Comparison.ALL
    return Comparison.NONE if sets else Comparison.AS_MEASURED


def write_cases(
    result: "SpinResult", folder: Path, replay: bool, variant: str = ""
) -> dict[str, str]:
    """Write the record of each case, and a 3D replay if wanted.

    Args:
        result: The result.
        folder: Where to write.
        replay: Whether to write replays.
        variant: Part of the file names that tells machines apart; empty for a single machine.

    Returns:
        Names of the files with a replay, by name of the case.
    """
    from wm_drake.simulation.records import save_record

    replays = {}
    for case in result.results:
        name = "_".join(filter(None, [variant, case.case.name]))
        save_record(case.record, folder / f"record_{name}.nc")
        if replay:
            replays[case.case.name] = file = f"replay_{name}.html"
            (folder / file).write_text(_replay(result, case), encoding="utf-8")
    return replays


def _replay(result: "SpinResult", case: "CaseResult") -> str:
    import numpy as np

    from wm_drake.model.replay import Motion, replay_page
    from wm_drake.simulation.measures import largest_motion

    # Meshcat would print the address of its server
    logging.getLogger("drake").setLevel(logging.WARNING)
    time, positions = largest_motion(case.record)
    cabinet = None
    if "cabinet_angle" in case.record:
        shown = case.record.sel(time=time)
        cabinet = np.hstack([shown.cabinet_angle.values, shown.cabinet_position.values])
    speed = case.record.drum_speed.sel(time=time).values
    parameters, gasket = result.parameters, case.record.attrs["gasket"] == "yes"
    words = "" if gasket or parameters.gasket is None else ", without gasket"
    return replay_page(
        parameters,
        Motion(time, positions, speed, cabinet),
        title=f"Machine {parameters.name}, load {case.case.name}{words}",
        load=case.case.load,
        gasket=gasket,
    )


def amplitude_lines(title: str, amplitudes: "pd.DataFrame") -> "Table":
    """Return amplitudes as a table for the terminal: words at the left, numbers at the right."""
    from rich.table import Table

    table = Table(title=title)
    for name, column in amplitudes.items():
        is_number = column.dtype.kind == "f"
        table.add_column(str(name), justify="right" if is_number else "left", overflow="fold")
    for row in amplitudes.itertuples(index=False):
        table.add_row(
            *(f"{value:.1f}" if isinstance(value, float) else str(value) for value in row)
        )
    return table


def gap_text(gap: "Gap") -> str:
    """Return a smallest gap as text for the terminal."""
    from wm_drake.parameters.units import Unit

    distance = Unit("m", "mm").from_si(gap.distance)
    return (
        f"smallest gap {distance:.1f} mm between {gap.moving} and {gap.fixed}, at {gap.time:.2f} s"
    )


def divergences(result: "SpinResult") -> list[str]:
    """Return a line for each case that diverged."""
    return [
        f"{case.case.name}: {case.record.attrs['diverged']}"
        for case in result.results
        if case.record.attrs["diverged"]
    ]


def end_with(diverged: list[str]) -> None:
    """Print which cases diverged and end the command with exit code 1, if there are any."""
    for message in diverged:
        typer.echo(message, err=True)
    if diverged:
        raise typer.Exit(1)


def case_as_json(case: "CaseResult") -> dict[str, Any]:
    """Return the measures of a case as an object for JSON."""
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
        **forces_as_json(measures),
        "motor": drive_as_json(measures.drive),
        "smallest_gap_mm": millimetre.from_si(measures.smallest_gap.distance)
        if measures.smallest_gap
        else None,
        "smallest_spring_tension_N": numbers(measures.smallest_tension, Unit("N", "N")),
        "critical_rpm": numbers(measures.critical_speed, Unit("rad/s", "rpm")),
        "diverged": case.record.attrs["diverged"] or None,
        "wall_s": case.wall_s,
    }
