"""Figures of the design study: the front, envelopes of the picked design, hypervolume.

`pick.js` moves what has the label `PICKED` when a reader picks another design.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.quantity import TIME, quantity_of, shown
from wm_drake.studies.design.problem import MachineDesigns
from wm_drake.studies.design.study import PROPOSED, chosen_designs

PICKED = "picked design"
"""Label of what belongs to the picked design."""

DESIGNS = "designs"
"""Label of the points that can be picked."""

MOST_PAIRS = 3
"""Largest number of pairs of objectives that are drawn."""

COLUMNS = 3
"""Number of panels of envelopes in a row."""


def first_picked(designs: MachineDesigns, front: xr.Dataset) -> int:
    """Return the number of the design that is picked first: the proposed one, if there is one."""
    chosen = chosen_designs(designs, front)
    return chosen.get(PROPOSED, next(iter(chosen.values())))


def pairs_of(designs: MachineDesigns) -> list[tuple[int, int]]:
    """Return the pairs of objectives that are drawn against each other."""
    count = len(designs.objectives)
    return [(i, j) for i in range(count) for j in range(i + 1, count)][:MOST_PAIRS]


def front_figure(designs: MachineDesigns, front: xr.Dataset) -> fig.Figure:
    """Return the front: one panel for each pair of objectives.

    Args:
        front: Front with at least one design and two objectives.
    """
    numbers = sorted(set(chosen_designs(designs, front).values()))
    machine = {"symbol": "cross-thin", "color": fig.MARK, "size": 15.0, "key": "the machine itself"}
    picked = {"is_open": True, "color": fig.MEASURED, "size": 15.0, "key": PICKED}
    layers: tuple[tuple[xr.Dataset, str, dict[str, Any]], ...] = (
        (front, "", {"key": DESIGNS}),
        (
            front.sel(design=numbers),
            "",
            {"symbol": "diamond", "size": 11.0, "key": "chosen designs"},
        ),
        (front.expand_dims("machine"), "nominal_", machine),
        (front.sel(design=[first_picked(designs, front)]), "", picked),
    )
    panels = []
    for pair in pairs_of(designs):
        x, y = (designs.objectives[index] for index in pair)
        marks: list[fig.Mark] = []
        for data, begin, style in layers:
            drawn = {f"{begin}{y.name}": style}
            marks += chart.marks_of(data, f"{begin}{x.name}", drawn, kind=fig.Points)
        across, up = (chart.axis(goal.quantity) for goal in (x, y))
        panels.append(fig.Panel(marks=tuple(marks), x=across, y=up))
    return fig.Figure(panels=fig.in_grid(panels, len(panels)), height=330.0)


def envelopes_figure(envelopes: xr.Dataset, picked: int) -> fig.Figure:
    """Return the envelopes of a design and of the machine itself, one panel for each sensor.

    Args:
        picked: Number of the design.
    """
    largest = max(float(np.nanmax(shown(one), initial=0.0)) for one in envelopes.values())
    time = shown(envelopes["time"])
    of_picked = envelopes.sel(design=picked)
    panels = [
        replace(
            chart.panel(
                of_picked.sel(sensor=sensor),
                "time",
                {
                    "nominal": {"color": fig.QUIET, "key": "the machine itself"},
                    "envelope": {"color": fig.MEASURED, "width": 2.2, "key": PICKED},
                },
                x={"label": TIME.label, "range": (0.0, float(time[0] + time[-1]))},
                y={"label": "", "range": (0.0, 1.05 * largest or 1.0)},
            ),
            title=quantity_of(envelopes.envelope).named(sensor).label,
        )
        for sensor in envelopes["sensor"].values.tolist()
    ]
    placed = fig.in_grid(panels, min(COLUMNS, len(panels)), share="both")
    return fig.Figure(panels=placed, height=160.0)


def history_figure(front: xr.Dataset) -> fig.Figure:
    """Return the hypervolume over the number of evaluated designs."""
    last = {"color": fig.MEASURED, "size": 8.0, "kind": fig.Points}
    end = chart.marks_of(front.isel(generation=[-1]), "evaluations", {"hypervolume": last})
    panel = chart.panel(front, "evaluations", ["hypervolume"], width=2.2)
    return fig.Figure(panels=(chart.between((), panel, *end),), height=240.0)
