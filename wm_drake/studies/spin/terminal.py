"""Spin runs on the terminal: the table of amplitudes, and a line for each other measure."""

import math
from typing import TYPE_CHECKING

import pandas as pd

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.measured import BAND
from wm_drake.parameters.units import Unit
from wm_drake.report.table import Column, table_of
from wm_drake.simulation.balance import balance_of
from wm_drake.simulation.measures import Measures
from wm_drake.simulation.measures.as_json import as_json, labelled_values
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.studies.spin.balance import balance_line
from wm_drake.studies.spin.study import CaseResult

if TYPE_CHECKING:
    from rich.table import Table


def amplitude_lines(title: str, amplitudes: pd.DataFrame) -> "Table":
    """Return amplitudes as a table for the terminal: words at the left, numbers at the right."""
    bands = " and ".join(filter(None, amplitudes[BAND].unique()))
    shown = amplitudes.drop(columns=BAND)
    columns = {str(name): Column(str(name), decimals=1) for name in shown.columns}
    return table_of(shown, columns=columns).terminal(f"{title}, {bands}")


def case_lines(parameters: MachineParameters, case: CaseResult) -> list[str]:
    """Return a line for each measure of a case beside its amplitudes."""
    measures, lines = case.measures, [gap_text(case)]
    tensions = measures.smallest_tension
    shown = zip(tensions.spring.values, tensions.values, strict=True)
    words = ", ".join(f"{name} {tension:.1f} N" for name, tension in shown)
    lines.append(f"smallest spring tension {words}")
    if parameters.drive.kind == "motor":
        lines.append(_drive_text(measures))
    for variable in tabulated():
        numbers = [
            " ".join([*labels, "-" if value is None else f"{value:.4g}"])
            for labels, value in labelled_values(measures.table, variable)
        ]
        lines.append(f"{variable.kind} {', '.join(numbers)} {variable.unit_text}")
    if (balance := balance_of(case.case, parameters, case.record)) is not None:
        lines.append(balance_line(balance))
    if (walk := measures.walk) is not None:
        turn = math.degrees(walk.turn)
        lines.append(f"the cabinet walks {1e3 * walk.distance:.1f} mm and turns by {turn:.1f} deg")
    return [f"{case.case.name}: {line}" for line in lines if line]


def gap_text(case: CaseResult) -> str:
    """Return the smallest gap of a case as text; "" if there is none."""
    gap = case.measures.smallest_gap
    if not gap:
        return ""
    distance = Unit("m", "mm").from_si(gap.distance)
    parts = f"{gap.moving} and {gap.fixed}"
    return f"smallest gap {distance:.1f} mm between {parts}, at {gap.time:.2f} s"


def _drive_text(measures: Measures) -> str:
    """Return the measures of the drive as text."""
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
