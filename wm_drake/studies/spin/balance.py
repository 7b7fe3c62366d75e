"""Part of a spin page about rings of balls: angles of the balls, and what unbalance remains."""

from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import GM_PER_KGM, RPM_PER_RAD_S, listed, number, plain, shape_name
from wm_drake.report.page import Picture, Section, picture
from wm_drake.report.table import Column, Table, table_of
from wm_drake.simulation.balance import Balance, balance_of
from wm_drake.studies.spin.figures import speed_axis
from wm_drake.studies.spin.study import CaseResult, SpinRuns

WINDOW = 0.1
"""Time between rows of a table of angles, and between points of a figure. [s]"""

MOST_DOTS = 500
"""Largest number of points of a ball in a figure."""

SMALLEST = 1e-3
"""Smallest unbalance that a logarithmic axis shows. [g m]"""

BALLS = (
    "Angles are from the top of the drum, positive as it turns. The unbalance in a plane is the "
    "part of the first moment of load and balls that acts there (ISO 21940-11); of one ring, all "
    "of it. The natural frequencies and the rest pose are those without balls."
)
"""Sentences of the section."""


def balances(result: SpinRuns) -> list[tuple[CaseResult, Balance]]:
    """Return the cases of a machine with rings of balls that have samples, with their balance."""
    pairs = [(c, balance_of(c.case, result.parameters, c.record)) for c in result.results]
    return [(case, balance) for case, balance in pairs if balance is not None]


def balance_section(result: SpinRuns) -> Section:
    """Return the section; it is empty for a machine without rings."""
    shown = balances(result)
    if not shown:
        return Section("balance", "Balls and remaining unbalance")
    pictures = [_picture(c, b) for c, b in shown if len(b.time) > 1]
    tables = (balance_table(result),)
    return Section("balance", "Balls and remaining unbalance", pictures, tables, BALLS)


def balance_frame(result: SpinRuns) -> pd.DataFrame:
    """Return the unbalance in each plane: of the load, largest, and at the end of the run."""
    rows = [
        {
            "load": case.case.name,
            "gasket": case.record.attrs["gasket"],
            "plane": ring,
            **numbers,
            "smaller_from_rpm": RPM_PER_RAD_S * balance.balanced_from,
        }
        for case, balance in balances(result)
        for ring, numbers in _of_planes(balance).items()
    ]
    return pd.DataFrame(rows)


def _of_planes(balance: Balance) -> dict[str, dict[str, float]]:
    """Return the unbalance in the plane of each ring, with units in the names."""
    size, planes = GM_PER_KGM * balance.size, range(len(balance.planes))
    at = size.argmax(axis=0)
    return {
        balance.rings[p]: {
            "load_gm": float(GM_PER_KGM * balance.load_size[p]),
            "largest_gm": float(size[at[p], p]),
            "largest_rpm": float(RPM_PER_RAD_S * balance.speed[at[p]]),
            "end_gm": float(GM_PER_KGM * balance.at_end[p]),
        }
        for p in planes
    }


def balance_table(result: SpinRuns) -> Table:
    """Return `balance_frame` for reading."""
    caption = (
        "Unbalance in the plane of each ring: of the load alone, largest of load and balls with "
        "its drum speed, and mean over the last turn of the drum. Last column: speed from which "
        "the sum over the planes is smaller than that of the load alone; below it the balls add "
        "to the unbalance."
    )
    unit, frame = "g\u00a0m", balance_frame(result)
    columns = {
        "plane": Column("plane of"),
        "load_gm": Column("load alone", unit, 1),
        "largest_gm": Column("largest", unit, 1),
        "largest_rpm": Column("at", "rpm", 0),
        "end_gm": Column("at the end", unit, 2),
        "smaller_from_rpm": Column("smaller from", "rpm", 0),
    }
    is_worse = (frame.end_gm > frame.load_gm) & (frame.end_gm > SMALLEST)
    kinds = ["alarm" if worse else "" for worse in is_worse]
    return table_of(frame, caption, columns, kinds, grouped=True)


def balance_as_json(balance: Balance | None) -> dict[str, Any] | None:
    """Return the balance of a case for JSON; None for a machine without balls."""
    if balance is None:
        return None
    from_rpm = RPM_PER_RAD_S * balance.balanced_from
    shown: dict[str, Any] = plain({"smaller_from_rpm": from_rpm, "planes": _of_planes(balance)})
    return shown


def balance_line(balance: Balance) -> str:
    """Return the balance of a case as text for the terminal."""
    load, end = (GM_PER_KGM * values.sum() for values in (balance.load_size, balance.at_end))
    text = f"unbalance {load:.1f} g m, with the balls {end:.2f} g m at the end"
    if np.isfinite(balance.balanced_from):
        return f"{text}, smaller from {RPM_PER_RAD_S * balance.balanced_from:.0f} rpm on"
    return f"{text}; the balls make it larger"


def ball_table(result: SpinRuns) -> pd.DataFrame:
    """Return angles of the balls and unbalance in the planes over time, a row for each window."""
    parts = []
    for case, balance in balances(result):
        rows, angles = _sampled(balance, WINDOW), case.record.ball_ring_angle
        columns: dict[str, Any] = {
            "load": case.case.name,
            "gasket": case.record.attrs["gasket"],
            "time_s": balance.time[rows],
            "speed_rpm": RPM_PER_RAD_S * balance.speed[rows],
        }
        for p, ring in enumerate(balance.rings):
            columns[f"{ring}_unbalance_gm"] = GM_PER_KGM * balance.size[rows, p]
        for ring in map(str, angles.ball_ring.values):
            for ball, values in enumerate(_degrees(case, ring).T, start=1):
                columns[f"{ring}_ball_{ball}_deg"] = values[rows]
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def _degrees(case: CaseResult, ring: str) -> FloatArray:
    """Return the angles of the balls of a ring. (n, balls) [deg]"""
    angles = case.record.ball_ring_angle.sel(ball_ring=ring).values
    return np.rad2deg(angles[:, ~np.isnan(angles[0])])


def _sampled(balance: Balance, window: float) -> np.ndarray:
    """Return the index of the sample at the begin of each window. [s]"""
    begins = np.arange(balance.time[0], balance.time[-1] + 1e-9, window) - 1e-9
    return np.unique(np.searchsorted(balance.time, begins))


def _picture(case: CaseResult, balance: Balance) -> Picture:
    end = listed(
        [
            f"{number(GM_PER_KGM * size, 2)} g m in the plane of {shape_name(ring)}"
            for ring, size in zip(balance.rings, balance.at_end, strict=True)
        ]
    )
    caption = (
        f"Load {case.title}. Upper row: angle of each ball, seen from the drum. A ball that "
        "the drum does not carry yet runs round. Dashed: opposite the unbalance of the load in "
        f"this plane. Lower row: unbalance of load and balls in the plane, largest in {WINDOW:g} "
        "s. Dashed: the load alone; above it the balls make it worse."
    )
    alternative = (
        f"Angles of the balls and remaining unbalance over time, load {case.title}. At the "
        f"end: {end}."
    )
    return picture(balance_figure(case, balance), alternative, caption)


def balance_figure(case: CaseResult, balance: Balance) -> fig.Figure:
    """Return the angles of the balls and the unbalance in the plane of the rings over time."""
    x = fig.Axis(label="time, s", range=(float(balance.time[0]), float(balance.time[-1])))
    turns = fig.Axis(
        label="angle, degrees",
        range=(-180.0, 180.0),
        ticks=fig.named(("−180", "−90", "0", "90", "180"), (-180.0, -90.0, 0.0, 90.0, 180.0)),
    )
    sizes = fig.Axis(label="unbalance, g\u00a0m", is_log=True)
    panels = [
        fig.Panel(title=shape_name(ring), marks=marks, x=x, y=turns, top=speed_axis(case.record))
        for p, ring in enumerate(balance.rings)
        for marks in [_angles(case, balance, p)]
    ]
    panels += [
        fig.Panel(name=f"unbalance, {shape_name(ring)}", marks=_sizes(balance, p), x=x, y=sizes)
        for p, ring in enumerate(balance.rings)
    ]
    grid = fig.in_grid(panels, len(balance.rings), share="x and rows")
    return fig.Figure(panels=grid, height=230.0)


def _angles(case: CaseResult, balance: Balance, plane: int) -> tuple[fig.Mark, ...]:
    """Return the angles of the balls of the ring in a plane as dots."""
    length = float(balance.time[-1] - balance.time[0])
    rows = _sampled(balance, max(WINDOW, length / MOST_DOTS))
    marks: list[fig.Mark] = [
        fig.Points(
            balance.time[rows],
            values[rows],
            color=fig.COLOURS[ball % len(fig.COLOURS)],
            size=2.5,
            name=f"ball {ball + 1}",
        )
        for ball, values in enumerate(_degrees(case, balance.rings[plane]).T)
    ]
    x, z = -balance.load[plane]
    if balance.load_size[plane] > SMALLEST / GM_PER_KGM:
        at = float(np.rad2deg(np.arctan2(x, z)))
        marks.append(fig.Rule(at, color=fig.MARK, dash="dashed", key="opposite the load"))
    return tuple(marks)


def _sizes(balance: Balance, plane: int) -> tuple[fig.Mark, ...]:
    """Return the unbalance in a plane over time, and that of the load alone."""
    rows = _sampled(balance, WINDOW)
    largest = GM_PER_KGM * np.maximum.reduceat(balance.size[:, plane], rows)
    of_load = GM_PER_KGM * balance.load_size[plane]
    marks: list[fig.Mark] = [
        fig.Line(balance.time[rows], np.maximum(largest, SMALLEST), key="with balls")
    ]
    if of_load > SMALLEST:
        marks.append(fig.Rule(of_load, color=fig.MEASURED, dash="dashed", key="load alone"))
    return tuple(marks)
