"""Figures of the design study: the front, envelopes of the picked design, hypervolume.

`pareto/pick.js` moves what has the label `PICKED` when a reader picks another design.
"""

import numpy as np

from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M
from wm_drake.studies.design.study import COMPROMISE, Envelopes, ParetoFront

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


def front_figure(front: ParetoFront) -> fig.Figure:
    """Return the front: one panel for each pair of objectives.

    Args:
        front: Front with at least one design and two objectives.
    """
    goals = front.designs.objectives
    labels = [f"{g.given.quantity}, {g.unit.label}" for g in goals]
    chosen, picked = sorted(set(front.chosen.values())), first_picked(front)
    panels = []
    for pair in pairs_of(front):
        x, y = front.objectives[:, pair].T
        machine = front.nominal_objectives[list(pair)]
        marks: tuple[fig.Mark, ...] = (
            fig.Points(x, y, key=DESIGNS),
            fig.Points(x[chosen], y[chosen], symbol="diamond", size=11.0, key="chosen designs"),
            fig.Points(
                machine[:1],
                machine[1:],
                symbol="cross-thin",
                color=fig.MARK,
                size=15.0,
                key="the machine itself",
            ),
            fig.Points(
                x[picked : picked + 1],
                y[picked : picked + 1],
                is_open=True,
                color=fig.MEASURED,
                size=15.0,
                key=PICKED,
            ),
        )
        across, up = (fig.Axis(label=labels[index]) for index in pair)
        panels.append(fig.Panel(marks=marks, x=across, y=up))
    return fig.Figure(panels=fig.in_grid(panels, len(panels)), height=330.0)


def envelopes_figure(shown: Envelopes, picked: int) -> fig.Figure:
    """Return the envelopes of a design and of the machine itself, one panel for each sensor.

    Args:
        picked: Number of the design.
    """
    columns = min(COLUMNS, len(shown.sensors))
    sizes = np.concatenate([shown.designs.ravel(), shown.nominal.ravel()])
    largest = MM_PER_M * float(np.nanmax(sizes, initial=0.0))
    x = fig.Axis(label="time, s", range=(0.0, float(shown.time[0] + shown.time[-1])))
    y = fig.Axis(range=(0.0, 1.05 * largest or 1.0))
    panels = []
    for sensor, of_design, nominal in zip(
        shown.sensors, shown.designs[picked], shown.nominal, strict=False
    ):
        marks = (
            fig.Line(shown.time, MM_PER_M * nominal, color=fig.QUIET, key="the machine itself"),
            fig.Line(shown.time, MM_PER_M * of_design, color=fig.MEASURED, width=2.2, key=PICKED),
        )
        panels.append(fig.Panel(title=f"{sensor}, mm", marks=marks, x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, columns, share="both"), height=160.0)


def history_figure(front: ParetoFront) -> fig.Figure:
    """Return the hypervolume over the number of evaluated designs."""
    evaluations, volume = np.array(front.search.history).T
    marks = (
        fig.Line(evaluations, volume, width=2.2),
        fig.Points(evaluations[-1:], volume[-1:], color=fig.MEASURED, size=8.0),
    )
    panel = fig.Panel(
        marks=marks, x=fig.Axis(label="evaluated designs"), y=fig.Axis(label="hypervolume")
    )
    return fig.Figure(panels=(panel,), height=240.0)
