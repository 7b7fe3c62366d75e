"""Results of a spin run as tables: numbers for files, text for a page, lines for the terminal."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import MachineParameters, measured_amplitudes, quantities
from wm_drake.parameters.measured import BAND, EXPERIMENT
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number, percent, shape_name
from wm_drake.report.table import (
    MOST_SHOWN,
    Column,
    Columns,
    Group,
    Row,
    Table,
    Value,
    line,
    readable,
    table_of,
)
from wm_drake.simulation.balance import balance_of
from wm_drake.simulation.displacements import percent_difference
from wm_drake.simulation.measures import MEASURES, Measures, Variable
from wm_drake.simulation.measures.as_json import as_json, labelled_values
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.simulation.mount_forces import mount_forces, rms_table, speed_ranges
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.simulation.vibration import sensor_accelerations
from wm_drake.studies.spin.balance import balance_line
from wm_drake.studies.spin.study import CaseResult, SpinRuns, band_text

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

OURS = "wm_drake"
"""Name of this program in the column `source` of an amplitude table."""


@dataclass(frozen=True)
class Difference:
    """Percent difference between an amplitude and the measured one, [B] Eq. (1)."""

    case: str
    sensor: str
    percent: float


def amplitude_table(result: SpinRuns) -> pd.DataFrame:
    """Return the amplitudes: load, gasket (yes, no), source, and one column per sensor. [mm]

    For each case, the table holds the measured rows with the same load and gasket, if the case is
    compared with them, then the computed row with the source 'wm_drake'. A machine file can name
    this table, saved as CSV, in `measured`.
    """
    sensors = list(result.parameters.sensors)
    measured = measured_amplitudes(result.parameters)
    parts = []
    for case in result.results:
        gasket = case.record.attrs["gasket"]
        if result.is_compared(case):
            parts.append(
                measured[(measured["load"] == case.case.name) & (measured["gasket"] == gasket)]
            )
        values = {
            name: MM_PER_M * float(case.measures.amplitude.sel(sensor=name)) for name in sensors
        }
        parts.append(
            pd.DataFrame([{"load": case.case.name, "gasket": gasket, "source": OURS, **values}])
        )
    return pd.concat([part for part in parts if len(part)], ignore_index=True)


def banded_amplitudes(result: SpinRuns) -> pd.DataFrame:
    """Return the amplitudes, and in the column `band` the pass band of each computed row."""
    table = amplitude_table(result)
    table.loc[table["source"] == OURS, BAND] = [
        band_text(case).replace("–", " to ") for case in result.results
    ]
    return table.fillna({BAND: ""})


def by_case(
    cases: Iterable[CaseResult],
    caption: str,
    columns: Iterable[Column | str],
    rows_of: Callable[[CaseResult], Iterable[Row]],
    text_columns: int = 1,
) -> Table:
    """Return a table with a group of rows for each case; a case without rows is left out."""
    rows = ((case.title, tuple(rows_of(case))) for case in cases)
    groups = tuple(Group(title, of_case) for title, of_case in rows if of_case)
    return Table(caption, ("load", *columns), groups, text_columns)


def rows_of(table: pd.DataFrame, case: CaseResult) -> pd.DataFrame:
    """Return the rows of an amplitude table that belong to a case."""
    return table[
        (table["load"] == case.case.name) & (table["gasket"] == case.record.attrs["gasket"])
    ]


def experiment_mm(table: pd.DataFrame, case: CaseResult) -> dict[str, float] | None:
    """Return the measured amplitudes of a case by sensor, or None if there are none. [mm]"""
    rows = rows_of(table, case)
    rows = rows[rows["source"] == EXPERIMENT]
    return (
        None if rows.empty else {str(name): float(rows.iloc[0][name]) for name in table.columns[3:]}
    )


def differences(table: pd.DataFrame, case: CaseResult, source: str = OURS) -> list[Difference]:
    """Return the percent differences between a source and the experiment, one per sensor.

    The list is empty if the table has no row of the source or of the experiment.
    """
    reference = experiment_mm(table, case)
    rows = rows_of(table, case)
    rows = rows[rows["source"] == source]
    if reference is None or rows.empty:
        return []
    sensors = list(reference)
    value = xr.DataArray(
        rows.iloc[0][sensors].to_numpy(dtype=float), {"sensor": sensors}, ["sensor"]
    )
    change = percent_difference(
        value, xr.DataArray(list(reference.values()), {"sensor": sensors}, ["sensor"])
    )
    return [Difference(case.title, name, float(change.sel(sensor=name))) for name in sensors]


def comparison(result: SpinRuns, table: pd.DataFrame) -> Table:
    """Return the amplitudes with their percent differences from the experiment."""
    sensors = list(result.parameters.sensors)

    def rows(case: CaseResult) -> Iterator[Row]:
        of_case = rows_of(table, case)
        for _, row in of_case.iterrows():
            sizes = (number(float(row[name])) for name in sensors)
            yield Row((row["source"], *sizes, ""), "ours" if row["source"] == OURS else "measured")
        others = [source for source in of_case["source"] if source not in (EXPERIMENT, OURS)]
        for source in dict.fromkeys([*others, OURS]):
            yield from _difference_rows(differences(table, case, source), source)

    caption = (
        "Amplitude of the displacement at each sensor: the largest absolute value of its envelopes "
        f"in the band {band_text(*result.results)}. The last rows of each load are differences: "
        "100 % × (value − experiment) / experiment, [B] Eq. (1)."
    )
    caption = " ".join([caption, *result.measured_notes()])
    columns = ("source", *(f"{name}, mm" for name in sensors), "mean absolute difference, %")
    return by_case(result.results, caption, columns, rows, text_columns=2)


def _difference_rows(changes: list[Difference], source: str) -> list[Row]:
    if not changes:
        return []
    mean = float(np.mean([abs(change.percent) for change in changes]))
    cells = (
        f"{source} vs. {EXPERIMENT}",
        *(percent(c.percent) for c in changes),
        percent(mean).lstrip("+"),
    )
    return [Row(cells, "difference" if source == OURS else "difference other")]


def critical_speeds(result: SpinRuns) -> Table:
    """Return the drum speed at which the displacement of each sensor is largest."""
    (variable,) = (v for v in MEASURES["amplitudes"].variables if v.name == "critical_speed")
    caption = "Critical speeds: the drum speed at which the displacement of each sensor is largest."
    return replace(variable_table(result, variable, 0), caption=caption)


def variable_table(result: SpinRuns, variable: Variable, decimals: int | None = None) -> Table:
    """Return one variable of a measure for each case.

    Args:
        decimals: Number of decimals; None for significant digits.
    """

    def numbers(case: CaseResult) -> list[tuple[tuple[str, ...], float | None]]:
        return labelled_values(case.measures.table, variable)

    names = [" ".join(labels) or variable.kind for labels, _ in numbers(result.results[-1])]
    columns = [Column(name, variable.unit_text, decimals) for name in names]
    caption = f"{variable.about[0].upper()}{variable.about[1:]}."
    groups = (line(case.title, [v for _, v in numbers(case)]) for case in result.results)
    return Table(caption, ("load", *columns), tuple(groups))


def largest_values(result: SpinRuns) -> Table:
    """Return D, F and M of [B] for each case."""
    parameters = result.parameters
    assumed = f" (assumption: frame {parameters.clearance_frame}, as the first sensor)"
    caption = (
        "D: largest displacement, from the rest position, of the tub point nearest to the "
        f"detergent box{'' if parameters.clearance else assumed}. F, M: largest force and moment "
        "of the gasket on the housing. All are the largest absolute values over the whole run, "
        "for each axis."
    )
    columns = [
        Column(f"{name}{axis}", unit, decimals)
        for name, unit, decimals in (("D", "mm", 1), ("F", "N", 1), ("M", "N m", 2))
        for axis in "xyz"
    ]

    def rows(case: CaseResult) -> list[Row]:
        measures = case.measures
        gasket = np.concatenate([measures.gasket_force.values, measures.gasket_moment.values])
        gasket = np.where(case.has_gasket, gasket, np.nan)
        return [Row((*(MM_PER_M * measures.detergent_displacement.values), *gasket))]

    return by_case(result.results, caption, columns, rows)


def accelerations(result: SpinRuns) -> Table:
    """Return the largest acceleration at each sensor, and the RMS over the run."""

    def rows(case: CaseResult) -> list[Row]:
        values = sensor_accelerations(case.record, result.sensors_of(case)).values
        rms = np.sqrt(np.mean(values**2, axis=0))
        return [Row(("largest", *np.abs(values).max(axis=0))), Row(("RMS", *rms))]

    caption = (
        "Acceleration of the tub at each sensor, along its axis: the largest absolute value and "
        "the RMS over the whole run. Gravity is not included, and nothing is filtered."
    )
    columns: Columns = ("value", *(Column(n, "m/s²", 2) for n in result.parameters.sensors))
    cases = [case for case in result.results if case.record.sizes["time"]]
    return by_case(cases, caption, columns, rows, text_columns=2)


def mount_force_tables(result: SpinRuns) -> list[Table]:
    """Return the forces of the mounts on the cabinet, one table for each spin profile."""
    caption = (
        "Size of the force of each mount on the cabinet: at rest, largest with its drum speed, and "
        "RMS without the mean in ranges of drum speed or in the regions of the profile."
    )
    by_ranges: dict[tuple[str, ...], list[CaseResult]] = {}
    for case in result.results:
        names = tuple(part.name for part in speed_ranges(case.record, case.case.profile))
        by_ranges.setdefault(names, []).append(case)
    start = ("mount", Column("at rest", "N", 1), Column("largest", "N", 1), Column("at", "rpm", 0))
    tables = (
        by_case(
            cases,
            caption,
            (*start, *(Column(f"RMS {name}", "N", 1) for name in names)),
            _mount_rows,
            text_columns=2,
        )
        for names, cases in by_ranges.items()
    )
    return [table for table in tables if table.groups]


def _mount_rows(case: CaseResult) -> Iterator[Row]:
    forces = mount_forces(case.record)
    every = rms_table(forces, speed_ranges(case.record, case.case.profile))
    for force, rms in zip(forces, every, strict=True):
        if force.peak > 0.0:  # rings of balls act on the drum
            speed = case.speed_rpm(float(case.record.time[force.peak_index]))
            name = force.name.replace("_", " ")
            yield Row((name, force.at_rest, force.peak, speed, *map(float, rms)))


def smallest_gaps(result: SpinRuns) -> Table:
    """Return the smallest gap of each case: its width, the two parts, the time and the place."""
    caption = (
        "Smallest gap between the housing and the parts that move with the tub, over all samples. "
        "A negative gap means that the parts overlap. x (to the right), y (to the rear), z (up): "
        "position of the nearest point of the moving part, from drum mid-depth at rest."
    )
    columns: Columns = (
        "moving part",
        "part of the housing",
        Column("gap", "mm", 1),
        Column("drum speed", "rpm", 0),
        Column("time", "s", 2),
        *(Column(axis, "mm", 0) for axis in "xyz"),
    )
    return by_case(result.results, caption, columns, _gap_rows, text_columns=3)


def _gap_rows(case: CaseResult) -> list[Row]:
    gap = case.measures.smallest_gap
    if gap is None:
        return [Row(("not computed", *[None] * 7))]
    parts = shape_name(gap.moving), shape_name(gap.fixed)
    place = (MM_PER_M * float(value) for value in gap.point)
    size, speed = MM_PER_M * gap.distance, case.speed_rpm(gap.time)
    cells: tuple[Value, ...] = (*parts, size, speed, gap.time, *place)
    return [Row(cells, "alarm" if gap.distance <= 0.0 else "")]


def smallest_tensions(result: SpinRuns) -> Table:
    """Return the smallest tension of each spring for each case."""
    caption = (
        "Smallest tension of each spring over all samples, in N. A spring that only pulls goes "
        "slack at 0; a spring that also pushes can fall below."
    )
    names = result.results[0].measures.smallest_tension.spring.values
    columns = (Column(str(name), "N", 1) for name in names)
    return by_case(result.results, caption, columns, _tension_rows)


def _tension_rows(case: CaseResult) -> list[Row]:
    smallest = case.measures.smallest_tension
    return [Row(tuple(smallest.values), "alarm" if slack_springs(smallest) else "")]


def loads(result: SpinRuns) -> Table:
    """Return the point masses of each case."""
    caption = (
        "Loads: point masses in the drum. A mass with phase 0 is at the top when the drum angle is "
        "0. y is measured from drum mid-depth to the rear."
    )
    columns = (
        Column("mass", "kg", 3),
        Column("radius", "mm", 1),
        Column("y", "mm", 1),
        Column("phase", "deg", 1),
    )
    return by_case(result.results, caption, columns, _masses)


def _masses(case: CaseResult) -> list[Row]:
    rows = [
        Row((u.mass, MM_PER_M * u.radius, MM_PER_M * u.y, float(np.rad2deg(u.phase))))
        for u in case.case.load.unbalances
    ]
    return rows or [Row(("0 (empty drum)", None, None, None))]


def profiles(result: SpinRuns) -> Table:
    """Return the corner points of the spin profile of each case."""
    cases: dict[tuple[tuple[float, ...], tuple[float, ...]], list[str]] = {}
    for case in result.results:
        cases.setdefault((case.case.profile.time, case.case.profile.speed), []).append(case.title)
    groups = (
        Group("all loads" if len(cases) == 1 else "; ".join(names), _points(*points))
        for points, names in cases.items()
    )
    return Table(
        "Spin profile. The drum speed is linear between these points.",
        ("load", Column("time", "s", 3), Column("drum speed", "rpm", 1)),
        tuple(groups),
    )


def _points(times: Sequence[float], speeds: Sequence[float]) -> tuple[Row, ...]:
    rows = [Row((t, RPM_PER_RAD_S * w)) for t, w in zip(times, speeds, strict=True)]
    if len(rows) > MOST_SHOWN:
        half = MOST_SHOWN // 2
        rows[half:-half] = [Row((f"{len(rows) - 2 * half} more", "…"))]
    return tuple(rows)


def changed_parameters(result: SpinRuns, case: CaseResult) -> Table | None:
    """Return the parameters of a case that differ from the machine's; None if it has no own set."""
    if case.case.parameters is None:
        return None
    common = {key: value for key, value, _ in quantities(result.parameters)}
    groups = tuple(
        line(key, [readable(value, unit)])
        for key, value, unit in quantities(case.case.parameters)
        if common.get(key) != value
    )
    return Table(
        f"Parameters of load {case.title} that differ from those of the machine.",
        ("key", "value"),
        groups,
        text_columns=2,
    )


def amplitude_lines(title: str, amplitudes: pd.DataFrame) -> "TerminalTable":
    """Return amplitudes as a table for the terminal: words at the left, numbers at the right."""
    bands = " and ".join(filter(None, amplitudes[BAND].unique()))
    shown = amplitudes.drop(columns=BAND)
    columns = {str(name): Column(str(name), decimals=1) for name in shown.columns}
    return table_of(shown, columns=columns).terminal(f"{title}, {bands}")


def case_lines(parameters: MachineParameters, case: CaseResult) -> list[str]:
    """Return a line for each measure of a case beside its amplitudes."""
    measures, gap = case.measures, case.gap_text
    lines = [f"smallest gap {gap}"] if gap else []
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
    return [f"{case.case.name}: {line}" for line in lines]


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
