"""Results of a spin run as tables: of numbers for files, of text for a page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import Load, MachineParameters, measured_amplitudes, quantities, source_of
from wm_drake.parameters.units import Unit
from wm_drake.report.wording import (
    MISSING,
    MM_PER_M,
    RPM_PER_RAD_S,
    case_title,
    has_gasket,
    number,
    percent,
    shape_name,
    speed_rpm,
)
from wm_drake.simulation.measures import percent_difference
from wm_drake.studies.spin.study import CaseResult, SpinResult

OURS = "wm_drake"
"""Source of our rows in an amplitude table."""

EXPERIMENT = "experiment"
"""Source of the rows that others are compared with."""


MOST_SHOWN = 24
"""Of a list of numbers, or of the points of a profile, before the middle is left out."""


@dataclass(frozen=True)
class Row:
    """Cells of one line; `kind` (ours, measured, difference, other, alarm or empty) chooses how it looks."""

    cells: tuple[str, ...]
    kind: str = ""


@dataclass(frozen=True)
class Group:
    """Lines under one heading, which stands in the first column."""

    heading: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes:
        caption: What it shows, in words.
        header: Heads of the columns, with units.
        groups: Its lines.
        text_columns: So many columns at the left hold words, the others numbers.
    """

    caption: str
    header: tuple[str, ...]
    groups: tuple[Group, ...]
    text_columns: int = 1


@dataclass(frozen=True)
class Difference:
    """Percent difference of one amplitude from the experiment's, [B] Eq. (1)."""

    case: str
    sensor: str
    percent: float


def amplitude_table(result: SpinResult) -> pd.DataFrame:
    """Amplitudes: load, gasket (yes, no), source, one column per sensor. [mm]

    For each case the measured rows of its load and gasket as the machine file has them, then the computed one, of source
    'wm_drake'. Read back as CSV it is a file that a machine can name in `measured`.
    """
    sensors = list(result.parameters.sensors)
    measured = measured_amplitudes(result.parameters)
    parts = []
    for case in result.results:
        gasket = case.record.attrs["gasket"]
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


def rows_of(table: pd.DataFrame, case: CaseResult) -> pd.DataFrame:
    """The rows of an amplitude table that belong to a case."""
    return table[
        (table["load"] == case.case.name) & (table["gasket"] == case.record.attrs["gasket"])
    ]


def experiment_mm(table: pd.DataFrame, case: CaseResult) -> dict[str, float] | None:
    """Measured amplitude by sensor of a case; None if the machine file has none. [mm]"""
    rows = rows_of(table, case)
    rows = rows[rows["source"] == EXPERIMENT]
    return (
        None if rows.empty else {str(name): float(rows.iloc[0][name]) for name in table.columns[3:]}
    )


def differences(table: pd.DataFrame, case: CaseResult, source: str = OURS) -> list[Difference]:
    """Percent differences of a source from the experiment, by sensor; empty where there is nothing to compare."""
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
    return [Difference(case_title(case), name, float(change.sel(sensor=name))) for name in sensors]


def comparison(result: SpinResult, table: pd.DataFrame) -> Table:
    """Amplitudes with their percent differences from the experiment."""
    sensors = list(result.parameters.sensors)
    groups = []
    for case in result.results:
        rows = [_amplitudes(row, sensors) for _, row in rows_of(table, case).iterrows()]
        others = [
            source for source in rows_of(table, case)["source"] if source not in (EXPERIMENT, OURS)
        ]
        for source in dict.fromkeys([*others, OURS]):
            rows += _difference(differences(table, case, source), source)
        groups.append(Group(case_title(case), tuple(rows)))
    caption = (
        "Amplitude of the displacement at each sensor: largest absolute value of its envelopes, band 0.5–20 Hz. "
        "The lower rows are differences, 100 % × (value − experiment) / experiment, Eq. (1) of [B]."
    )
    header = ("load", "source", *(f"{name}, mm" for name in sensors), "mean absolute difference, %")
    return Table(caption, header, tuple(groups), text_columns=2)


def _amplitudes(row: pd.Series, sensors: list[str]) -> Row:
    kind = "ours" if row["source"] == OURS else "measured"
    return Row((str(row["source"]), *(number(float(row[name])) for name in sensors), ""), kind)


def _difference(changes: list[Difference], source: str) -> list[Row]:
    if not changes:
        return []
    mean = float(np.mean([abs(change.percent) for change in changes]))
    cells = (
        f"{source} vs. {EXPERIMENT}",
        *(percent(c.percent) for c in changes),
        percent(mean).lstrip("+"),
    )
    return [Row(cells, "difference" if source == OURS else "difference other")]


def critical_speeds(result: SpinResult) -> Table:
    """Drum speed at which each sensor moves most."""
    groups = [
        line(
            case_title(case),
            [number(RPM_PER_RAD_S * float(speed), 0) for speed in case.measures.critical_speed],
        )
        for case in result.results
    ]
    header = ("load", *(f"{name}, rpm" for name in result.parameters.sensors))
    return Table(
        "Critical speeds: drum speed at which the displacement of each sensor is largest.",
        header,
        tuple(groups),
    )


def largest_values(result: SpinResult) -> Table:
    """D, F and M of [B] per case."""
    caption = (
        "D: largest displacement from rest of the tub point nearest the detergent box. F, M: largest force and moment of the "
        "gasket on the housing. Absolute values over the whole run, per axis."
    )
    header = (
        "load",
        *(
            f"{name}{axis}, {unit}"
            for name, unit in (("D", "mm"), ("F", "N"), ("M", "N m"))
            for axis in "xyz"
        ),
    )
    return Table(
        caption, header, tuple(line(case_title(case), _d_f_m(case)) for case in result.results)
    )


def _d_f_m(case: CaseResult) -> list[str]:
    measures = case.measures
    shown = [number(MM_PER_M * float(value)) for value in measures.detergent_displacement]
    gasket = [*measures.gasket_force, *measures.gasket_moment]
    decimals = [1] * 3 + [2] * 3
    if not has_gasket(case):
        return [*shown, *[MISSING] * len(gasket)]
    return [
        *shown,
        *(number(float(value), places) for value, places in zip(gasket, decimals, strict=True)),
    ]


def smallest_gaps(result: SpinResult) -> Table:
    """Smallest gap per case: how wide, between what, when, where."""
    caption = (
        "Smallest gap between what moves with the tub and the housing, over all samples; below zero the parts overlap. The "
        "place is that of the point of the moving part: x to the right, y to the rear, z up, from drum mid-depth at rest."
    )
    header = (
        "load",
        "moving part",
        "part of the housing",
        "gap, mm",
        "drum speed, rpm",
        "time, s",
        "x, mm",
        "y, mm",
        "z, mm",
    )
    return Table(caption, header, tuple(_gap(case) for case in result.results), text_columns=3)


def _gap(case: CaseResult) -> Group:
    gap = case.measures.smallest_gap
    if gap is None:
        return line(case_title(case), ["not measured", *[MISSING] * 7])
    place = [number(MM_PER_M * value, 0) for value in gap.point]
    speed = number(speed_rpm(case, gap.time), 0)
    cells = [
        shape_name(gap.moving),
        shape_name(gap.fixed),
        number(MM_PER_M * gap.distance),
        speed,
        number(gap.time, 2),
        *place,
    ]
    return line(case_title(case), cells, "alarm" if gap.distance <= 0.0 else "")


def loads(result: SpinResult) -> Table:
    """The point masses of each case."""
    caption = "Loads that were run: point masses in the drum. Phase 0 is up at drum angle 0; y counts to the rear from mid-depth."
    groups = (Group(case_title(case), _masses(case.case.load)) for case in result.results)
    return Table(caption, ("load", "mass, kg", "radius, mm", "y, mm", "phase, deg"), tuple(groups))


def _masses(load: Load) -> tuple[Row, ...]:
    rows = [
        Row(
            (
                number(u.mass, 3),
                number(MM_PER_M * u.radius),
                number(MM_PER_M * u.y),
                number(float(np.rad2deg(u.phase))),
            )
        )
        for u in load.unbalances
    ]
    return tuple(rows) or (Row(("0 (empty drum)", *[MISSING] * 3)),)


def profiles(result: SpinResult) -> Table:
    """The corner points of each case's spin profile."""
    cases: dict[tuple[tuple[float, ...], tuple[float, ...]], list[str]] = {}
    for case in result.results:
        cases.setdefault((case.case.profile.time, case.case.profile.speed), []).append(
            case_title(case)
        )
    groups = (
        Group("all loads" if len(cases) == 1 else "; ".join(names), _points(*points))
        for points, names in cases.items()
    )
    return Table(
        "Spin profile, linear between these points.",
        ("load", "time, s", "drum speed, rpm"),
        tuple(groups),
    )


def _points(times: Sequence[float], speeds: Sequence[float]) -> tuple[Row, ...]:
    rows = [
        Row((number(t, 3), number(RPM_PER_RAD_S * w))) for t, w in zip(times, speeds, strict=True)
    ]
    if len(rows) > MOST_SHOWN:
        half = MOST_SHOWN // 2
        rows[half:-half] = [Row((f"{len(rows) - 2 * half} more", "…"))]
    return tuple(rows)


def parameter_table(parameters: MachineParameters) -> Table:
    """Every number of the machine: key path, value in the unit people read, source."""
    groups = (
        line(key, [readable(value, unit), source_of(parameters, key) or MISSING])
        for key, value, unit in quantities(parameters)
    )
    caption = "Numbers of the machine file. Masses, inertias, shapes and mounting points are in its SDF model."
    return Table(caption, ("key", "value", "source"), tuple(groups), text_columns=3)


def changed_numbers(result: SpinResult, case: CaseResult) -> Table | None:
    """Numbers of a case that are not the machine's; None if it has no numbers of its own."""
    if case.case.parameters is None:
        return None
    common = {key: value for key, value, _ in quantities(result.parameters)}
    groups = tuple(
        line(key, [readable(value, unit)])
        for key, value, unit in quantities(case.case.parameters)
        if common.get(key) != value
    )
    return Table(
        "Numbers of this load that differ from the machine's.",
        ("key", "value"),
        groups,
        text_columns=2,
    )


def readable(value: Any, unit: Unit) -> str:
    """A value as `Unit.text` writes it, for the eye: `4600 N*mm/rad` as `4600 N mm/rad`, long lists by their ends."""
    if isinstance(value, tuple) and len(value) > MOST_SHOWN:
        return f"{len(value)} values, {readable(value[0], unit)} to {readable(value[-1], unit)}"
    return unit.text(value).replace("*", " ").replace("^2", "²").replace("-", "−")


def line(heading: str, cells: Iterable[str], kind: str = "") -> Group:
    """A group of one row."""
    return Group(heading, (Row(tuple(cells), kind),))
