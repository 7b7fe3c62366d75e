"""Results of a spin run on the terminal, in files and as JSON, for one machine or several."""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import pandas as pd
    from rich.table import Table

    from wm_drake.model.scene import Gap
    from wm_drake.simulation.cabinet import Walk
    from wm_drake.simulation.measures import Measures
    from wm_drake.studies.spin.study import CaseResult, SpinResult


@dataclass(frozen=True)
class Pages:
    """Which pages and pictures are written beside the usual ones.

    Attributes:
        replay: A 3D replay for each case.
        detail: Pictures of vibration for every case, not only for the main one.
    """

    replay: bool
    detail: bool


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
    from wm_drake.simulation.displacements import largest_motion

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
    from wm_drake.report.table import Column, table_of

    columns = {str(name): Column(str(name), decimals=1) for name in amplitudes.columns}
    return table_of(amplitudes, columns=columns).terminal(title)


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
    from wm_drake.simulation.measures.as_json import as_json
    from wm_drake.simulation.mounts import POINT

    measures = case.measures
    tree = as_json(measures.table)
    tree["cabinet_wrench"]["about"] = POINT
    if not measures.has_cabinet:
        tree["feet"] = None
    return {
        "load": case.case.name,
        "gasket": case.record.attrs["gasket"] == "yes",
        **tree,
        "walk": None if measures.walk is None else _walk(measures.walk),
        "diverged": case.record.attrs["diverged"] or None,
        "wall_s": case.wall_s,
    }


def _walk(walk: "Walk") -> dict[str, float]:
    """Return distance and turn of a cabinet that moves, at the end of the run."""
    from wm_drake.parameters.units import Unit

    return {
        "distance_mm": Unit("m", "mm").from_si(walk.distance),
        "turn_deg": Unit("rad", "deg").from_si(walk.turn),
    }


def drive_text(measures: "Measures") -> str:
    """Return the measures of the drive as text for the terminal."""
    from wm_drake.simulation.measures.as_json import as_json

    text = as_json(measures.table)["motor"]
    if text["peak_torque_Nm"] is None:
        return "the run is too short for measures of the drive"
    line = f"motor torque on the drum up to {text['peak_torque_Nm']:.1f} N m"
    if text["mean_torque_Nm"] is not None:
        line += (
            f", over a revolution up to {text['mean_torque_Nm']:.2f} N m at "
            f"{text['mean_torque_rpm']:.0f} rpm"
        )
    if text["speed_ripple_percent"] is not None:
        line += f"; speed ripple {text['speed_ripple_percent']:.1f} %"
    if text["caught_rpm"] is not None:
        line += (
            f"; caught at {text['caught_rpm']:.0f} rpm with {text['caught_mean_torque_Nm']:.2f} "
            "N m on average"
        )
    return line


def measure_lines(case: "CaseResult") -> list[str]:
    """Return a line for the terminal for each variable that is shown from its declaration."""
    from wm_drake.simulation.measures.as_json import labelled_values
    from wm_drake.simulation.measures.registry import tabulated

    lines = []
    for variable in tabulated():
        numbers = [
            " ".join([*labels, "-" if value is None else f"{value:.4g}"])
            for labels, value in labelled_values(case.measures.table, variable)
        ]
        lines.append(f"{case.case.name}: {variable.kind} {', '.join(numbers)} {variable.unit_text}")
    return lines
