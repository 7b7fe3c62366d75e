"""Part of a spin page about rings of balls or liquid: their angles, and what unbalance remains."""

from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed, shape_name
from wm_drake.report.labelled import LabelledTable, rows_of
from wm_drake.report.quantity import SPEED, TIME, Quantity
from wm_drake.simulation.balance import Balance, balance_of
from wm_drake.studies.answer import Part, Plot
from wm_drake.studies.spin.data import ANGLE
from wm_drake.studies.spin.figures import speed_axis
from wm_drake.studies.spin.study import CaseResult, SpinRuns

WINDOW = 0.1
"""Time between rows of a table of angles, and between points of a figure. [s]"""

MOST_DOTS = 500
"""Largest number of points of a ball in a figure."""

SMALLEST = 1e-6
"""Smallest unbalance that a logarithmic axis shows. [kg m]"""

UNBALANCE = Quantity("unbalance", Unit("kg*m", "g*m"), 1)
REMAINING = Quantity("at the end", UNBALANCE.unit, 2)

BALLS = (
    "Angles are from the top of the drum, positive as it turns; that of liquid is the side on "
    "which it is thickest. The unbalance in a plane is the part of the first moment of load, balls "
    "and liquid that acts there (ISO 21940-11); of one ring, all of it. The natural frequencies "
    "and the rest pose are those without balls and liquid."
)
"""Sentences of the section."""


def balances(runs: SpinRuns) -> list[tuple[str, CaseResult, Balance]]:
    """Return label, case and balance of the cases of a machine with rings that have samples."""
    every = zip(runs.labels, runs.results, strict=True)
    return [
        (name, case, balance)
        for name, case in every
        if (balance := balance_of(case.case, runs.parameters, case.record))
    ]


def balance_parts(runs: SpinRuns) -> tuple[Part, Part]:
    """Return the pictures and the tables; both are empty for a machine without rings."""
    shown = balances(runs)
    if not shown:
        return Part("Rings and remaining unbalance"), Part("Remaining unbalance")
    plots = [_plot(case, balance) for _, case, balance in shown if len(balance.time) > 1]
    table = LabelledTable(
        "balance",
        xr.concat([of_planes(name, balance) for name, _, balance in shown], "row"),
        "Remaining unbalance",
        "Unbalance in the plane of each ring: of the load alone, largest of load and rings with "
        "its drum speed, and mean over the last turn of the drum. Smaller from: speed from which "
        "the sum over the planes is smaller than that of the load alone; below it the rings add "
        "to the unbalance.",
        marked=("is_worse", "alarm"),
        is_in_terminal=True,
    )
    balls = xr.concat([of_rings(name, balance) for name, _, balance in shown], "row")
    return (
        Part("Rings and remaining unbalance", plots, BALLS),
        Part("Remaining unbalance", (table, LabelledTable("balls", balls, is_in_json=False))),
    )


def of_planes(label: str, balance: Balance) -> xr.Dataset:
    """Return the unbalance in each plane: of the load, largest, and at the end of the run."""
    planes = len(balance.planes)
    at = balance.size.argmax(axis=0)
    end, of_load = balance.at_end, balance.load_size
    return rows_of(
        {"load": [label] * planes, "plane": balance.rings},
        load_alone=UNBALANCE.named("load alone").variable("row", of_load),
        largest=UNBALANCE.named("largest").variable("row", balance.size.max(axis=0)),
        speed=SPEED.named("at").variable("row", balance.speed[at]),
        end=REMAINING.variable("row", end),
        smaller_from=SPEED.named("smaller from").variable("row", [balance.balanced_from] * planes),
        is_worse=("row", (end > of_load) & (end > SMALLEST)),
    )


def of_rings(label: str, balance: Balance) -> xr.Dataset:
    """Return angles of balls and liquid, and unbalance in the planes, a row for each window."""
    rows = _sampled(balance, WINDOW)
    columns: dict[str, Any] = {
        "time": TIME.variable("row", balance.time[rows]),
        "speed": SPEED.variable("row", balance.speed[rows]),
    }
    for plane, ring in enumerate(balance.rings):
        values = UNBALANCE.variable("row", balance.size[rows, plane])
        columns[f"{ring}_unbalance"] = values
    for ring, angles in balance.angles.items():
        for ball, values in enumerate(angles.T, start=1):
            name = f"{ring}_ball_{ball}" if angles.shape[1] > 1 else ring
            columns[name] = ANGLE.variable("row", values[rows])
    return rows_of({"load": [label] * len(rows)}, **columns)


def _sampled(balance: Balance, window: float) -> np.ndarray:
    """Return the index of the sample at the begin of each window. [s]"""
    begins = np.arange(balance.time[0], balance.time[-1] + 1e-9, window) - 1e-9
    return np.unique(np.searchsorted(balance.time, begins))


def _plot(case: CaseResult, balance: Balance) -> Plot:
    end = listed(
        [
            f"{REMAINING.text(size)} in the plane of {shape_name(ring)}"
            for ring, size in zip(balance.rings, balance.at_end, strict=True)
        ]
    )
    caption = (
        f"Load {case.title}. Upper row: angle of each ball, or of the liquid, seen from the drum. "
        "What the drum does not carry yet runs round. Dashed: opposite the unbalance of the load "
        "in this plane. Lower row: unbalance of load and rings in the plane, largest in "
        f"{WINDOW:g} s. Dashed: the load alone; above it the rings make it worse."
    )
    alternative = (
        f"Angles of balls or liquid and remaining unbalance over time, load {case.title}. At the "
        f"end: {end}."
    )
    return Plot(balance_figure(case, balance), alternative, caption)


def balance_figure(case: CaseResult, balance: Balance) -> fig.Figure:
    """Return the angles in the rings and the unbalance in their planes over time."""
    x = fig.Axis(label=TIME.label, range=(float(balance.time[0]), float(balance.time[-1])))
    turns = fig.Axis(
        label=ANGLE.label,
        range=(-180.0, 180.0),
        ticks=fig.named(("−180", "−90", "0", "90", "180"), (-180.0, -90.0, 0.0, 90.0, 180.0)),
    )
    sizes = fig.Axis(label=UNBALANCE.label, is_log=True)
    panels = [
        fig.Panel(title=shape_name(ring), marks=marks, x=x, y=turns, top=speed_axis(case.record))
        for p, ring in enumerate(balance.rings)
        for marks in [_angles(balance, p)]
    ]
    panels += [
        fig.Panel(name=f"unbalance, {shape_name(ring)}", marks=_sizes(balance, p), x=x, y=sizes)
        for p, ring in enumerate(balance.rings)
    ]
    grid = fig.in_grid(panels, len(balance.rings), share="x and rows")
    return fig.Figure(panels=grid, height=230.0)


def _angles(balance: Balance, plane: int) -> tuple[fig.Mark, ...]:
    """Return the angles of the balls or of the liquid of the ring in a plane as dots."""
    length = float(balance.time[-1] - balance.time[0])
    rows = _sampled(balance, max(WINDOW, length / MOST_DOTS))
    ring = balance.rings[plane]
    angles = ANGLE.values(balance.angles[ring]).T
    marks: list[fig.Mark] = [
        fig.Points(
            balance.time[rows],
            values[rows],
            color=fig.COLOURS[ball % len(fig.COLOURS)],
            size=2.5,
            name=f"ball {ball + 1}" if len(angles) > 1 else shape_name(ring),
        )
        for ball, values in enumerate(angles)
    ]
    x, z = -balance.load[plane]
    if balance.load_size[plane] > SMALLEST:
        at = float(ANGLE.values(np.arctan2(x, z)))
        marks.append(fig.Rule(at, color=fig.MARK, dash="dashed", key="opposite the load"))
    return tuple(marks)


def _sizes(balance: Balance, plane: int) -> tuple[fig.Mark, ...]:
    """Return the unbalance in a plane over time, and that of the load alone."""
    rows = _sampled(balance, WINDOW)
    largest = np.maximum.reduceat(balance.size[:, plane], rows)
    drawn = UNBALANCE.values(np.maximum(largest, SMALLEST))
    marks: list[fig.Mark] = [fig.Line(balance.time[rows], drawn, key="with rings")]
    if balance.load_size[plane] > SMALLEST:
        of_load = float(UNBALANCE.values(balance.load_size[plane]))
        marks.append(fig.Rule(of_load, color=fig.MEASURED, dash="dashed", key="load alone"))
    return tuple(marks)
