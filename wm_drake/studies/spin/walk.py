"""Part of a spin page about a cabinet that moves: where it stands after the run, and its path."""

from dataclasses import replace

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.figure import COLOURS, OURS, QUIET, Axis, Figure, Line, Mark, Panel, Points
from wm_drake.report.formatting import number
from wm_drake.report.page import Picture, picture
from wm_drake.report.table import Group, Row, Table
from wm_drake.simulation.cabinet import walk
from wm_drake.simulation.records import cabinet_in
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


def walk_warning(case: CaseResult) -> list[str]:
    """Return a warning if the cabinet of a case walks or turns."""
    walked = case.measures.walk
    if walked is None or (walked.distance < LEAST_WALK and abs(walked.turn) < LEAST_TURN):
        return []
    return [
        f"Load {case.title}: the cabinet walks {number(MM.from_si(walked.distance))} mm and "
        f"turns by {number(DEGREE.from_si(walked.turn))} degrees."
    ]


def walk_table(cases: list[CaseResult]) -> Table:
    """Return where the cabinet stands after the run of each case."""
    groups = []
    for case in cases:
        walked = case.measures.walk
        if walked is None:
            continue
        moved = [*walked.shift, walked.distance]
        cells = [number(MM.from_si(float(value)), 2) for value in moved]
        kind = "alarm" if walk_warning(case) else ""
        turn = number(DEGREE.from_si(walked.turn), 2)
        groups.append(Group(case.title, (Row((*cells, turn), kind),)))
    caption = (
        "Where the cabinet stands after the run: shift of the middle of its feet on the floor, and "
        "turn about the vertical axis, counterclockwise from above."
    )
    header = ("load", "shift x, mm", "shift y, mm", "distance, mm", "turn, degrees")
    return Table(caption, header, tuple(groups), text_columns=1)


def walk_pictures(cases: list[CaseResult]) -> tuple[Picture, ...]:
    """Return the path of the feet and of the cabinet; none without samples."""
    shown = [case for case in cases if case.measures.walk and case.record.sizes["time"] > 1]
    if not shown:
        return ()
    distances = [case.measures.walk.distance for case in shown if case.measures.walk]
    farthest = shown[int(np.argmax(distances))]
    caption = (
        f"Left: the floor from above with load {farthest.title}, which moves the cabinet "
        "most; feet before the run (open) and after it (filled), with their paths. The front of "
        "the machine is below. Right: distance and turn over time for each load."
    )
    walked = "; ".join(
        f"{case.title}: {number(MM.from_si(distance))} mm"
        for case, distance in zip(shown, distances, strict=True)
    )
    return (picture(walk_figure(shown, farthest), f"Distance walked. {walked}.", caption),)


def walk_figure(cases: list[CaseResult], farthest: CaseResult) -> Figure:
    """Return the path of the feet of one case, and distance and turn over time of all.

    Args:
        cases: Cases whose cabinet moves, with at least two samples.
        farthest: The case whose feet are drawn.
    """
    last = max(float(case.record.time[-1]) for case in cases)
    panels = [_floor(farthest)]
    texts = ("distance, mm", "turn, degrees")
    for row, (text, unit) in enumerate(zip(texts, (MM, DEGREE), strict=True)):
        marks = []
        for index, case in enumerate(cases):
            time, path = _sampled(case)
            color = COLOURS[index % len(COLOURS)]
            values = unit.from_si(1.0) * path[:, row]
            marks.append(Line(time, values, color=color, key=case.title))
        x = Axis(label="time, s" if row else "", range=(0.0, last), scale="time")
        x = replace(x, has_numbers=bool(row))
        y = Axis(label=text)
        name = text.split(",")[0]
        panels.append(Panel(name=name, marks=tuple(marks), x=x, y=y, row=row, column=1))
    return Figure(panels=tuple(panels), height=185.0)


def _floor(case: CaseResult) -> Panel:
    """Return the feet before and after a run, with their paths, from above."""
    in_record = cabinet_in(case.record)
    assert in_record is not None
    cabinet = in_record[0]
    feet = np.array([[cabinet.feet[name].x, cabinet.feet[name].y] for name in cabinet.corners])
    paths = MM.from_si(1.0) * (feet + _thinned(case.record.foot_slip.values[:, :, :2]))
    marks: list[Mark] = [Line(*paths[:, foot].T) for foot in range(len(feet))]
    for at, color in ((0, QUIET), (-1, OURS)):
        corners = np.vstack([paths[at], paths[at][:1]])
        marks.append(Line(*corners.T, color=color, dash="" if at else "dashed"))
        marks.append(Points(*paths[at].T, color=color, is_open=at == 0, size=8.0))
    x, y = Axis(label="x, mm"), Axis(label="y, mm")
    return Panel(name="floor", marks=tuple(marks), x=x, y=y, rows=2, is_square=True)


def _sampled(case: CaseResult) -> tuple[FloatArray, FloatArray]:
    """Return times and, at each, distance [m] and turn [rad] of the cabinet of a case."""
    in_record = cabinet_in(case.record)
    assert in_record is not None
    walks = [
        walk(in_record[0], slips) for slips in _thinned(case.record.foot_slip.values[:, :, :2])
    ]
    values = np.array([(one.distance, one.turn) for one in walks])
    return _thinned(case.record.time.values), values


def _thinned(history: FloatArray) -> FloatArray:
    """Return up to `MOST_POINTS` samples of a history, the first and the last among them."""
    count = min(len(history), MOST_POINTS)
    return history[np.linspace(0, len(history) - 1, count).round().astype(int)]
