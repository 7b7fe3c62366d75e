"""Figures of the design study: the front, envelopes of the picked design, hypervolume.

`pareto/pick.js` moves what has the label `PICKED` when a reader picks another design.
"""

import numpy as np

from wm_drake.report.figure import (
    MARK,
    MEASURED,
    QUIET,
    Axis,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    in_grid,
)
from wm_drake.report.formatting import MM_PER_M
from wm_drake.studies.pareto.envelopes import Envelopes
from wm_drake.studies.pareto.study import COMPROMISE, ParetoFront

PICKED = "picked design"
"""Label of what belongs to the picked design."""

DESIGNS = "designs"
"""Label of the points that can be picked."""

MOST_PAIRS = 3
"""Largest number of pairs of objectives that are drawn."""

COLUMNS = 3
"""Number of panels of envelopes in a row."""


def first_picked(front: ParetoFront) -> int:
    """Return the number of the design that is picked first: the compromise, if there is one."""
    return front.chosen.get(COMPROMISE, next(iter(front.chosen.values())))


def pairs_of(front: ParetoFront) -> list[tuple[int, int]]:
    """Return the pairs of objectives that are drawn against each other."""
    count = len(front.designs.objectives)
    return [(i, j) for i in range(count) for j in range(i + 1, count)][:MOST_PAIRS]


def front_figure(front: ParetoFront) -> Figure:
    """Return the front: one panel for each pair of objectives.

    Args:
        front: Front with at least one design and two objectives.
    """
    goals = front.designs.objectives
    labels = [f"{g.given.quantity}, {g.unit.shown.replace('*', ' ')}" for g in goals]
    chosen, picked = sorted(set(front.chosen.values())), first_picked(front)
    panels = []
    for pair in pairs_of(front):
        x, y = front.objectives[:, pair].T
        machine = front.nominal_objectives[list(pair)]
        marks: tuple[Mark, ...] = (
            Points(x, y, key=DESIGNS),
            Points(x[chosen], y[chosen], symbol="diamond", size=11.0, key="chosen designs"),
            Points(
                machine[:1],
                machine[1:],
                symbol="cross-thin",
                color=MARK,
                size=15.0,
                key="the machine itself",
            ),
            Points(
                x[picked : picked + 1],
                y[picked : picked + 1],
                is_open=True,
                color=MEASURED,
                size=15.0,
                key=PICKED,
            ),
        )
        across, up = (Axis(label=labels[index]) for index in pair)
        panels.append(Panel(marks=marks, x=across, y=up))
    return Figure(panels=in_grid(panels, len(panels)), height=330.0)


def envelopes_figure(shown: Envelopes, picked: int) -> Figure:
    """Return the envelopes of a design and of the machine itself, one panel for each sensor.

    Args:
        picked: Number of the design.
    """
    columns = min(COLUMNS, len(shown.sensors))
    sizes = np.concatenate([shown.designs.ravel(), shown.nominal.ravel()])
    largest = MM_PER_M * float(np.nanmax(sizes, initial=0.0))
    x = Axis(label="time, s", range=(0.0, float(shown.time[0] + shown.time[-1])))
    y = Axis(range=(0.0, 1.05 * largest or 1.0))
    panels = []
    for sensor, of_design, nominal in zip(
        shown.sensors, shown.designs[picked], shown.nominal, strict=False
    ):
        marks = (
            Line(shown.time, MM_PER_M * nominal, color=QUIET, key="the machine itself"),
            Line(shown.time, MM_PER_M * of_design, color=MEASURED, width=2.2, key=PICKED),
        )
        panels.append(Panel(title=f"{sensor}, mm", marks=marks, x=x, y=y))
    return Figure(panels=in_grid(panels, columns, share="both"), height=160.0)


def history_figure(front: ParetoFront) -> Figure:
    """Return the hypervolume over the number of evaluated designs."""
    evaluations, volume = np.array(front.search.history).T
    marks = (
        Line(evaluations, volume, width=2.2),
        Points(evaluations[-1:], volume[-1:], color=MEASURED, size=8.0),
    )
    panel = Panel(marks=marks, x=Axis(label="evaluated designs"), y=Axis(label="hypervolume"))
    return Figure(panels=(panel,), height=240.0)
