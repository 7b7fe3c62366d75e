"""Figures of the design study: the front, envelopes of the picked design, hypervolume.

`pareto/pick.js` moves what has the label `PICKED` when a reader picks another design.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
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
    """Draw the front: one panel for each pair of objectives.

    Args:
        front: Front with at least one design and two objectives.
    """
    pairs = pairs_of(front)
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    goals = front.designs.objectives
    names = [f"{g.given.quantity}, {g.unit.shown.replace('*', ' ')}" for g in goals]
    panels = figure.subplots(1, len(pairs), squeeze=False)[0]
    for axes, (across, up) in zip(panels, pairs, strict=True):
        x, y = front.objectives[:, across], front.objectives[:, up]
        chosen = sorted(set(front.chosen.values()))
        picked = first_picked(front)
        _points(axes, x, y, "o", OURS, 5.0, DESIGNS)
        _points(axes, x[chosen], y[chosen], "D", OURS, 8.0, "chosen designs")
        own = front.nominal_objectives[[across, up]]
        _points(axes, own[:1], own[1:], "+", MARK, 11.0, "the machine itself")
        _points(axes, x[picked : picked + 1], y[picked : picked + 1], "o", MEASURED, 11.0, PICKED)
        axes.set_xlabel(names[across], fontsize=9.5)
        axes.set_ylabel(names[up], fontsize=9.5)
        axes.grid(color=GRID)
        style_axes(axes)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9.5)
    return figure


def _points(
    axes: Axes, x: FloatArray, y: FloatArray, mark: str, color: str, size: float, label: str
) -> None:
    is_open = label == PICKED
    axes.plot(
        x,
        y,
        linestyle="none",
        marker=mark,
        markersize=size,
        color=color,
        markerfacecolor="none" if is_open else color,
        markeredgewidth=2.0 if is_open or mark == "+" else 0.0,
        label=label,
    )


def envelopes_figure(shown: Envelopes, picked: int) -> Figure:
    """Draw the envelopes of a design and of the machine itself, one panel for each sensor.

    Args:
        shown: Envelopes of all designs.
        picked: Number of the design.
    """
    columns = min(COLUMNS, len(shown.sensors))
    rows = -(-len(shown.sensors) // columns)
    figure = Figure(figsize=(WIDTH, 0.6 + 2.2 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, sensor, own, nominal in zip(
        panels, shown.sensors, shown.designs[picked], shown.nominal, strict=False
    ):
        axes.plot(shown.time, MM_PER_M * nominal, color=QUIET, label="the machine itself")
        axes.plot(shown.time, MM_PER_M * own, color=MEASURED, linewidth=1.6, label=PICKED)
        axes.set_title(f"{sensor}, mm", loc="left", fontsize=10, parse_math=False)
        axes.grid(color=GRID)
        style_axes(axes)
    for axes in panels[len(shown.sensors) :]:
        axes.set_visible(False)
    sizes = np.concatenate([shown.designs.ravel(), shown.nominal.ravel()])
    largest = MM_PER_M * float(np.nanmax(sizes, initial=0.0))
    panels[0].set_ylim(0.0, 1.05 * largest or 1.0)
    panels[0].set_xlim(0.0, float(shown.time[0] + shown.time[-1]))
    for axes in panels[max(0, len(shown.sensors) - columns) : len(shown.sensors)]:
        axes.set_xlabel("time, s", fontsize=9.5)
        axes.tick_params(labelbottom=True)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=9.5)
    return figure


def history_figure(front: ParetoFront) -> Figure:
    """Draw the hypervolume over the number of evaluated designs."""
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    axes = figure.add_subplot()
    evaluations, volume = np.array(front.found.history).T
    axes.plot(evaluations, volume, color=OURS, linewidth=1.6)
    axes.plot(evaluations[-1], volume[-1], "o", color=MEASURED, markeredgecolor=MARK)
    axes.set_xlabel("evaluated designs", fontsize=9.5)
    axes.set_ylabel("hypervolume", fontsize=9.5)
    axes.grid(color=GRID)
    style_axes(axes)
    return figure
