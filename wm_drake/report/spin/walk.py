"""Part of a spin page about a cabinet that moves: where it stands after the run, and its path."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.figures import GRID, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import number
from wm_drake.report.page import Picture, picture
from wm_drake.report.spin.cases import case_title
from wm_drake.report.tables import Group, Row, Table
from wm_drake.simulation.cabinet import walk
from wm_drake.simulation.measures import cabinet_in
from wm_drake.studies.spin.study import CaseResult

WALKING = (
    "The cabinet moves: a rigid body on four feet, each a pad with stiffness and damping in all "
    "directions, on a rigid level floor with Coulomb friction. Displacements, gaps and forces of "
    "the mounts are those seen from the cabinet. Loads and margins of the feet are those of the "
    "forces of the floor. A margin of 0 means that the cabinet slides, turns or tips."
)
"""Sentences about the model."""

LEAST_WALK = 1e-3
"""Distance from which a page warns that the cabinet walks. [m]"""

LEAST_TURN = np.deg2rad(0.1)
"""Turn from which a page warns that the cabinet turns. [rad]"""

MOST_POINTS = 600
"""Largest number of points of a drawn path."""

MM, DEGREE = Unit("m", "mm"), Unit("rad", "deg")


@dataclass(frozen=True)
class WalkView:
    """Table of where the cabinet stands after each run, and a picture of its path.

    Attributes:
        table: Table.
        pictures: Path of the feet and of the cabinet; none without samples.
    """

    table: Table
    pictures: tuple[Picture, ...]


def walk_view(cases: list[CaseResult]) -> WalkView:
    """Return the part of the page for cases of a machine whose cabinet moves."""
    return WalkView(walk_table(cases), _pictures(cases))


def walk_warning(case: CaseResult) -> list[str]:
    """Return a warning if the cabinet of a case walks or turns."""
    found = case.measures.walk
    if found is None or (found.distance < LEAST_WALK and abs(found.turn) < LEAST_TURN):
        return []
    return [
        f"Load {case_title(case)}: the cabinet walks {number(MM.from_si(found.distance))} mm and "
        f"turns by {number(DEGREE.from_si(found.turn))} degrees."
    ]


def walk_table(cases: list[CaseResult]) -> Table:
    """Return where the cabinet stands after the run of each case."""
    groups = []
    for case in cases:
        found = case.measures.walk
        if found is None:
            continue
        moved = [*found.shift, found.distance]
        cells = [number(MM.from_si(float(value)), 2) for value in moved]
        kind = "alarm" if walk_warning(case) else ""
        turn = number(DEGREE.from_si(found.turn), 2)
        groups.append(Group(case_title(case), (Row((*cells, turn), kind),)))
    caption = (
        "Where the cabinet stands after the run: shift of the middle of its feet on the floor, and "
        "turn about the vertical axis, counterclockwise from above."
    )
    header = ("load", "shift x, mm", "shift y, mm", "distance, mm", "turn, degrees")
    return Table(caption, header, tuple(groups), text_columns=1)


def _pictures(cases: list[CaseResult]) -> tuple[Picture, ...]:
    shown = [case for case in cases if case.measures.walk and case.record.sizes["time"] > 1]
    if not shown:
        return ()
    distances = [case.measures.walk.distance for case in shown if case.measures.walk]
    farthest = shown[int(np.argmax(distances))]
    caption = (
        f"Left: the floor from above with load {case_title(farthest)}, which moves the cabinet "
        "most; feet before the run (open) and after it (filled), with their paths. The front of "
        "the machine is below. Right: distance and turn over time for each load."
    )
    walked = "; ".join(
        f"{case_title(case)}: {number(MM.from_si(distance))} mm"
        for case, distance in zip(shown, distances, strict=True)
    )
    return (picture(walk_figure(shown, farthest), f"Distance walked. {walked}.", caption),)


def walk_figure(cases: list[CaseResult], farthest: CaseResult) -> Figure:
    """Draw the path of the feet of one case, and distance and turn over time of all.

    Args:
        cases: Cases whose cabinet moves, with at least two samples.
        farthest: The case whose feet are drawn.
    """
    figure = Figure(figsize=(WIDTH, 4.8))
    panels = figure.subplot_mosaic([["floor", "distance"], ["floor", "turn"]])
    _draw_floor(panels["floor"], farthest)
    for case in cases:
        time, path = _sampled(case)
        for name, column, unit in (("distance", 0, MM), ("turn", 1, DEGREE)):
            values = unit.from_si(1.0) * path[:, column]
            panels[name].plot(time, values, linewidth=1.2, label=case_title(case))
    last = max(float(case.record.time[-1]) for case in cases)
    for name, text in (("distance", "distance, mm"), ("turn", "turn, degrees")):
        panels[name].set_ylabel(text, fontsize=9.5)
        panels[name].set_xlim(0.0, last)
        panels[name].grid(color=GRID)
        style_axes(panels[name])
    panels["turn"].set_xlabel("time, s", fontsize=9.5)
    handles, labels = panels["turn"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False, fontsize=9.5)
    rows = -(-len(cases) // 4)
    figure.subplots_adjust(
        left=0.075, right=0.985, top=0.97, bottom=0.12 + 0.05 * rows, hspace=0.22, wspace=0.25
    )
    return figure


def _draw_floor(axes: Axes, case: CaseResult) -> None:
    """Draw the feet before and after a run, with their paths, from above."""
    found = cabinet_in(case.record)
    assert found is not None
    feet = np.array([[found[0].feet[name].x, found[0].feet[name].y] for name in found[0].corners])
    paths = MM.from_si(1.0) * (feet + _thinned(case.record.foot_slip.values[:, :, :2]))
    for foot in range(len(feet)):
        axes.plot(*paths[:, foot].T, color=OURS, linewidth=1.0)
    for at, color, fill in ((0, QUIET, "none"), (-1, OURS, OURS)):
        corners = np.vstack([paths[at], paths[at][:1]])
        axes.plot(*corners.T, color=color, linewidth=1.2, linestyle="--" if at == 0 else "-")
        axes.plot(*paths[at].T, color=color, marker="o", linestyle="none", markerfacecolor=fill)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, mm", fontsize=9.5)
    axes.set_ylabel("y, mm", fontsize=9.5)
    axes.grid(color=GRID)
    style_axes(axes)


def _sampled(case: CaseResult) -> tuple[FloatArray, FloatArray]:
    """Return times and, at each, distance [m] and turn [rad] of the cabinet of a case."""
    found = cabinet_in(case.record)
    assert found is not None
    walks = [walk(found[0], slips) for slips in _thinned(case.record.foot_slip.values[:, :, :2])]
    values = np.array([(one.distance, one.turn) for one in walks])
    return _thinned(case.record.time.values), values


def _thinned(history: FloatArray) -> FloatArray:
    """Return up to `MOST_POINTS` samples of a history, the first and the last among them."""
    count = min(len(history), MOST_POINTS)
    return history[np.linspace(0, len(history) - 1, count).round().astype(int)]
