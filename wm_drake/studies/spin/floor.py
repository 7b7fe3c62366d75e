"""Section of a spin page about the cabinet: forces on it, loads of its feet, where it walks."""

from dataclasses import replace

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.formatting import number
from wm_drake.report.page import Picture, Section, picture
from wm_drake.report.table import Group, Row, Table
from wm_drake.simulation.cabinet import walk
from wm_drake.simulation.feet import MARGINS
from wm_drake.simulation.measures.record import foot_loads_of
from wm_drake.simulation.mounts import POINT
from wm_drake.simulation.records import cabinet_in
from wm_drake.studies.spin.study import CaseResult, SpinRuns

WINDOW = 0.25
"""Time over which a figure shows the smallest value. [s]"""

VERBS = ("lifts a foot", "slides", "turns on the floor", "tips over")
"""What the cabinet does where a value of `MARGINS` is not positive."""

HEADS = (
    "smallest load of a foot, N",
    "margin of sliding, N",
    "margin of turning, N\u00a0m",
    "margin of tilting, N\u00a0m",
)
"""Heads of the columns of `MARGINS`."""


def floor_section(result: SpinRuns) -> Section:
    """Return the section; without cabinet in the machine file it has the resultant only."""
    standing = [case for case in result.results if case.measures.feet is not None]
    cabinet = result.parameters.cabinet
    shown, pictures = [resultant_table(result)], tuple[Picture, ...]()
    text = (
        "The machine file has no cabinet, so the loads of its feet are unknown. They are shown if "
        "it has mass, centre of mass, floor, friction and feet under the key 'cabinet'."
    )
    if standing and cabinet is not None:
        shown += [margins_table(standing), feet_table(standing)]
        pictures = _pictures(standing)
        text = (
            "Loads of the feet of a rigid cabinet that does not move, on a rigid level floor. "
            "Normal loads: four feet of equal vertical stiffness that do not pull. Margins: what "
            f"is missing until the cabinet slides or turns at friction {cabinet.friction:g}, or "
            "tips over; below 0 it does. The model does not let it move, so what happens after "
            "that is not computed."
        )
        if any(case.measures.walk for case in standing):
            text = WALKING
            shown.append(walk_table(standing))
            pictures = (*walk_pictures(standing), *pictures)
    return Section("cabinet", "Forces on the cabinet and the floor", pictures, tuple(shown), text)


def floor_warnings(result: SpinRuns) -> list[str]:
    """Return a warning for each case in which the cabinet would move, or walks."""
    warnings = []
    for case in result.results:
        feet = case.measures.feet
        if feet is None or case.record.attrs["diverged"]:
            continue
        if case.measures.walk is not None:
            warnings += walk_warning(case)
            continue
        verbs = [verb for name, verb in zip(MARGINS, VERBS, strict=True) if feet[name] <= 0.0]
        if verbs:
            text = " and ".join([", ".join(verbs[:-1]), verbs[-1]] if verbs[1:] else verbs)
            warnings.append(
                f"Load {case.title}: the cabinet {text}. The model keeps it in its place."
            )
    return warnings


def resultant_table(result: SpinRuns) -> Table:
    """Return force and moment of all mounts on the cabinet."""
    groups = []
    for case in result.results:
        rows = []
        for name, text, decimals in (("force", "force, N", 0), ("moment", "moment, N m", 1)):
            values = [
                getattr(case.measures, f"cabinet_{name}_{kind}").values
                for kind in ("peak", "dynamic_rms")
            ]
            cells = [number(float(value), decimals) for value in np.concatenate(values)]
            rows.append(Row((text, *cells)))
        groups.append(Group(case.title, tuple(rows)))
    header = (
        "load",
        "on the cabinet",
        *(f"largest {a}" for a in "xyz"),
        *(f"RMS {a}" for a in "xyz"),
    )
    caption = (
        f"Force and moment of all mounts on the cabinet, moment about {POINT}. Largest absolute "
        "value, which includes the weight of the oscillating group, and RMS without the mean."
    )
    return Table(caption, header, tuple(groups), text_columns=2)


def margins_table(cases: list[CaseResult]) -> Table:
    """Return smallest loads and margins of cases with feet, over the run and in each region."""
    groups = []
    for case in cases:
        feet = case.measures.feet
        assert feet is not None
        rows = [_margins_row("whole run", [float(feet[name]) for name in MARGINS])]
        for index, region in enumerate(feet.region.values):
            values = [float(feet[f"region_{name}"][index]) for name in MARGINS]
            rows.append(_margins_row(str(region), values))
        groups.append(Group(case.title, tuple(rows)))
    caption = (
        "Feet: smallest normal load of any foot, and smallest margins. Sliding: horizontal force "
        "that friction can still take. Turning: vertical moment that friction can still take "
        "beside the horizontal force. Tilting: moment that still keeps the cabinet down."
    )
    return Table(caption, ("load", "part of the run", *HEADS), tuple(groups), text_columns=2)


def _margins_row(part: str, values: list[float]) -> Row:
    is_alarm = any(value <= 0.0 for value in values)
    return Row((part, *(number(value) for value in values)), "alarm" if is_alarm else "")


def feet_table(cases: list[CaseResult]) -> Table:
    """Return the loads of each foot of cases with feet."""
    groups = []
    for case in cases:
        feet = case.measures.feet
        assert feet is not None
        rows = []
        for index, foot in enumerate(feet.foot.values):
            names = ("normal_smallest", "normal_largest", "tangential_largest")
            cells = [number(float(feet[f"foot_{name}"][index]), 0) for name in names]
            rows.append(Row((str(foot).replace("_", " "), *cells)))
        groups.append(Group(case.title, tuple(rows)))
    caption = "Loads of each foot over the run."
    if not any(case.measures.walk for case in cases):
        caption += (
            " Assumption for the horizontal loads: each foot resists in proportion to its normal "
            "load."
        )
    header = ("load", "foot", "smallest, N", "largest, N", "largest horizontal, N")
    return Table(caption, header, tuple(groups), text_columns=2)


def _pictures(cases: list[CaseResult]) -> tuple[Picture, ...]:
    shown = [case for case in cases if case.record.sizes["time"] > 1]
    if not shown:
        return ()
    caption = (
        "Smallest load of a foot and margins of sliding and turning over time: the smallest value "
        f"in each {WINDOW:g} s. Where a line is at 0 or below, a foot lifts off or the cabinet "
        "moves."
    )
    smallest = "; ".join(
        f"{case.title}: {number(float(case.measures.feet['turn_margin']))} N m"
        for case in shown
        if case.measures.feet is not None
    )
    alternative = f"Smallest margin of turning for each load. {smallest}."
    return (picture(floor_figure(shown), alternative, caption),)


def floor_figure(cases: list[CaseResult]) -> fig.Figure:
    """Return smallest load of a foot, margin of sliding and margin of turning over time."""
    marks: list[list[fig.Mark]] = [[fig.Rule(0.0, color=fig.MARK)] for _ in HEADS[:3]]
    for index, case in enumerate(cases):
        time, smallest = windows(case.record.time.values, foot_loads_of(case.record).margins)
        color = fig.COLOURS[index % len(fig.COLOURS)]
        for of_panel, column in zip(marks, smallest.T, strict=False):
            of_panel.append(fig.Line(time, column, color=color, key=case.title))
    x = fig.Axis(label="time, s", range=(0.0, max(float(case.record.time[-1]) for case in cases)))
    panels = [
        fig.Panel(name=head.split(",")[0], marks=tuple(of_panel), x=x, y=fig.Axis(label=head))
        for head, of_panel in zip(HEADS, marks, strict=False)
    ]
    return fig.Figure(panels=fig.in_grid(panels, 1, share="x"), height=180.0)


def windows(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return middle and smallest values of windows of length `WINDOW`.

    Args:
        time: (n,) evenly spaced, n > 1. [s]
        values: (n, k)
    """
    length = max(1, round(WINDOW / float(time[1] - time[0])))
    begins = np.arange(0, max(1, len(time) - length // 2), length)  # no short window at the end
    ends = np.append(begins[1:], len(time)) - 1
    return 0.5 * (time[begins] + time[ends]), np.minimum.reduceat(values, begins, axis=0)


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


def walk_figure(cases: list[CaseResult], farthest: CaseResult) -> fig.Figure:
    """Return the path of the feet of one case, and distance and turn over time of all."""
    last = max(float(case.record.time[-1]) for case in cases)
    panels = [_floor(farthest)]
    texts = ("distance, mm", "turn, degrees")
    for row, (text, unit) in enumerate(zip(texts, (MM, DEGREE), strict=True)):
        marks = []
        for index, case in enumerate(cases):
            time, path = _sampled(case)
            color = fig.COLOURS[index % len(fig.COLOURS)]
            values = unit.from_si(1.0) * path[:, row]
            marks.append(fig.Line(time, values, color=color, key=case.title))
        x = fig.Axis(label="time, s" if row else "", range=(0.0, last), scale="time")
        x = replace(x, has_numbers=bool(row))
        y = fig.Axis(label=text)
        name = text.split(",")[0]
        panels.append(fig.Panel(name=name, marks=tuple(marks), x=x, y=y, row=row, column=1))
    return fig.Figure(panels=tuple(panels), height=185.0)


def _floor(case: CaseResult) -> fig.Panel:
    """Return the feet before and after a run, with their paths, from above."""
    in_record = cabinet_in(case.record)
    assert in_record is not None
    cabinet = in_record[0]
    feet = np.array([[cabinet.feet[name].x, cabinet.feet[name].y] for name in cabinet.corners])
    paths = MM.from_si(1.0) * (feet + _thinned(case.record.foot_slip.values[:, :, :2]))
    marks: list[fig.Mark] = [fig.Line(*paths[:, foot].T) for foot in range(len(feet))]
    for at, color in ((0, fig.QUIET), (-1, fig.OURS)):
        corners = np.vstack([paths[at], paths[at][:1]])
        marks.append(fig.Line(*corners.T, color=color, dash="" if at else "dashed"))
        marks.append(fig.Points(*paths[at].T, color=color, is_open=at == 0, size=8.0))
    x, y = fig.Axis(label="x, mm"), fig.Axis(label="y, mm")
    return fig.Panel(name="floor", marks=tuple(marks), x=x, y=y, rows=2, is_square=True)


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
