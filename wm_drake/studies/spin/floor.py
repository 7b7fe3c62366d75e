"""Parts of a spin page about the cabinet: forces on it, loads of its feet, where it walks."""

from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import TIME, Quantity, of_measure
from wm_drake.simulation.cabinet import walk
from wm_drake.simulation.feet import MARGINS
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.record import foot_loads_of
from wm_drake.simulation.mounts import POINT
from wm_drake.simulation.records import cabinet_in
from wm_drake.studies.answer import Part, Plot
from wm_drake.studies.spin.study import CaseResult, SpinRuns

WINDOW = 0.25
"""Time over which a figure shows the smallest value. [s]"""

VERBS = ("lifts a foot", "slides", "turns on the floor", "tips over")
"""What the cabinet does where a value of `MARGINS` is not positive."""

DISTANCE = Quantity("distance", Unit("m", "mm"), 1)
TURN = Quantity("turn", Unit("rad", "deg"), 1)
WHOLE_RUN = "whole run"


def floor_parts(runs: SpinRuns) -> tuple[Part, Part]:
    """Return pictures and tables; without cabinet in the machine file only the resultant."""
    standing = [case for case in runs.results if case.measures.feet is not None]
    cabinet, walks = runs.parameters.cabinet, any(case.measures.walk for case in standing)
    tables, plots = [resultant_table(runs)], list[Plot]()
    text = (
        "The machine file has no cabinet, so the loads of its feet are unknown. They are shown if "
        "it has mass, centre of mass, floor, friction and feet under the key 'cabinet'."
    )
    if standing and cabinet is not None:
        tables += [margins_table(runs.measures), feet_table(runs.measures, walks=walks)]
        plots = [*walk_plots(standing), *_plots(standing)]
        text = (
            "Loads of the feet of a rigid cabinet that does not move, on a rigid level floor. "
            "Normal loads: four feet of equal vertical stiffness that do not pull. Margins: what "
            f"is missing until the cabinet slides or turns at friction {cabinet.friction:g}, or "
            "tips over; below 0 it does. The model does not let it move, so what happens after "
            "that is not computed."
        )
    if walks:
        text = WALKING
        tables.append(walk_table(runs))
    heading = "Forces on the cabinet and the floor"
    return Part("Feet over time", plots), Part(heading, tables, text, is_folded=True)


def floor_warnings(runs: SpinRuns) -> list[str]:
    """Return a warning for each case in which the cabinet would move, or walks."""
    warnings = []
    for case in runs.results:
        feet = case.measures.feet
        if feet is None or case.diverged:
            continue
        if case.measures.walk is not None:
            warnings += walk_warning(case)
            continue
        verbs = [verb for name, verb in zip(MARGINS, VERBS, strict=True) if feet[name] <= 0.0]
        if verbs:
            warnings.append(
                f"Load {case.title}: the cabinet {listed(verbs)}. The model keeps it in its place."
            )
    return warnings


def resultant_table(runs: SpinRuns) -> LabelledTable:
    """Return force and moment of all mounts on the cabinet."""
    return LabelledTable(
        "cabinet",
        runs.measures[[*MEASURES["cabinet"].names]],
        "Forces on the cabinet",
        f"Force and moment of all mounts on the cabinet, moment about {POINT}. Largest absolute "
        "value, which includes the weight of the oscillating group, RMS, and RMS without the mean.",
    )


def margins_table(measures: xr.Dataset) -> LabelledTable:
    """Return smallest loads and margins over the run and in each region."""
    of_parts = {}
    for name in MARGINS:
        whole = measures[name].expand_dims(part=[WHOLE_RUN])
        regions = measures[f"region_{name}"].rename(region="part")
        joined = xr.concat([whole, regions], "part").transpose("load", "part")
        of_parts[name] = of_measure(name).variable(("load", "part"), joined)
    data = xr.Dataset(
        of_parts, {"load": measures["load"], "part": [WHOLE_RUN, *measures.region.values]}
    )
    data["moves"] = data.to_array().min("variable") <= 0.0
    return LabelledTable(
        "margins",
        data,
        "Margins of the feet",
        "Feet: smallest normal load of any foot, and smallest margins. Sliding: horizontal force "
        "that friction can still take. Turning: vertical moment that friction can still take "
        "beside the horizontal force. Tilting: moment that still keeps the cabinet down.",
        marked=("moves", "alarm"),
    )


def feet_table(measures: xr.Dataset, *, walks: bool) -> LabelledTable:
    """Return the loads of each foot."""
    caption = "Loads of each foot over the run."
    if not walks:
        caption += (
            " Assumption for the horizontal loads: each foot resists in proportion to its normal "
            "load."
        )
    names = [variable.name for variable in MEASURES["feet"].variables if variable.dims]
    return LabelledTable("feet", measures[names], "Loads of the feet", caption)


def _plots(cases: list[CaseResult]) -> list[Plot]:
    shown = [case for case in cases if case.record.sizes["time"] > 1]
    if not shown:
        return []
    caption = (
        "Smallest load of a foot and margins of sliding and turning over time: the smallest value "
        f"in each {WINDOW:g} s. Where a line is at 0 or below, a foot lifts off or the cabinet "
        "moves."
    )
    margin = of_measure("turn_margin")
    smallest = "; ".join(f"{c.title}: {margin.text(c.measures.turn_margin)}" for c in shown)
    alternative = f"Smallest margin of turning for each load. {smallest}."
    return [Plot(floor_figure(shown), alternative, caption)]


def floor_figure(cases: list[CaseResult]) -> fig.Figure:
    """Return smallest load of a foot, margin of sliding and margin of turning over time."""
    quantities = [of_measure(name) for name in MARGINS[:3]]
    marks: list[list[fig.Mark]] = [[fig.Rule(0.0, color=fig.MARK)] for _ in quantities]
    for index, case in enumerate(cases):
        time, smallest = windows(case.record.time.values, foot_loads_of(case.record).margins)
        color = fig.COLOURS[index % len(fig.COLOURS)]
        for of_panel, quantity, column in zip(marks, quantities, smallest.T, strict=False):
            line = fig.Line(time, quantity.values(column), color=color, key=case.title)
            of_panel.append(line)
    x = fig.Axis(label=TIME.label, range=(0.0, max(float(case.record.time[-1]) for case in cases)))
    panels = [
        fig.Panel(name=q.words, marks=tuple(of_panel), x=x, y=fig.Axis(label=q.label))
        for q, of_panel in zip(quantities, marks, strict=True)
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


def walk_warning(case: CaseResult) -> list[str]:
    """Return a warning if the cabinet of a case walks or turns."""
    walked = case.measures.walk
    if walked is None or (walked.distance < LEAST_WALK and abs(walked.turn) < LEAST_TURN):
        return []
    return [
        f"Load {case.title}: the cabinet walks {DISTANCE.text(walked.distance)} and turns by "
        f"{TURN.text(walked.turn)}."
    ]


def walk_table(runs: SpinRuns) -> LabelledTable:
    """Return where the cabinet stands after the run of each case."""
    labelled = zip(runs.labels, runs.results, strict=True)
    known = [(n, c, c.measures.walk) for n, c in labelled if c.measures.walk is not None]
    walks = [walked for *_, walked in known]
    shift = np.array([walked.shift for walked in walks])
    distance, turn = replace(DISTANCE, decimals=2), replace(TURN, decimals=2)
    data = xr.Dataset(
        {
            "shift_x": distance.named("shift x").variable("load", shift[:, 0]),
            "shift_y": distance.named("shift y").variable("load", shift[:, 1]),
            "distance": distance.variable("load", [walked.distance for walked in walks]),
            "turn": turn.variable("load", [walked.turn for walked in walks]),
            "walks": ("load", [bool(walk_warning(case)) for _, case, _ in known]),
        },
        {"load": [name for name, *_ in known]},
    )
    return LabelledTable(
        "walk",
        data,
        "Where the cabinet stands",
        "Where the cabinet stands after the run: shift of the middle of its feet on the floor, and "
        "turn about the vertical axis, counterclockwise from above.",
        marked=("walks", "alarm"),
        is_in_terminal=True,
    )


def walk_plots(cases: list[CaseResult]) -> list[Plot]:
    """Return the path of the feet and of the cabinet; none without samples."""
    shown = [case for case in cases if case.measures.walk and case.record.sizes["time"] > 1]
    if not shown:
        return []
    distances = [case.measures.walk.distance for case in shown if case.measures.walk]
    farthest = shown[int(np.argmax(distances))]
    caption = (
        f"Left: the floor from above with load {farthest.title}, which moves the cabinet "
        "most; feet before the run (open) and after it (filled), with their paths. The front of "
        "the machine is below. Right: distance and turn over time for each load."
    )
    walked = "; ".join(
        f"{case.title}: {DISTANCE.text(distance)}"
        for case, distance in zip(shown, distances, strict=True)
    )
    return [Plot(walk_figure(shown, farthest), f"Distance walked. {walked}.", caption)]


def walk_figure(cases: list[CaseResult], farthest: CaseResult) -> fig.Figure:
    """Return the path of the feet of one case, and distance and turn over time of all."""
    last = max(float(case.record.time[-1]) for case in cases)
    panels = [_floor(farthest)]
    for row, quantity in enumerate((DISTANCE, TURN)):
        marks = []
        for index, case in enumerate(cases):
            time, path = _sampled(case)
            color = fig.COLOURS[index % len(fig.COLOURS)]
            values = quantity.values(path[:, row])
            marks.append(fig.Line(time, values, color=color, key=case.title))
        x = fig.Axis(label=TIME.label if row else "", range=(0.0, last), scale="time")
        x = replace(x, has_numbers=bool(row))
        y = fig.Axis(label=quantity.label)
        panel = fig.Panel(name=quantity.words, marks=tuple(marks), x=x, y=y)
        panels.append(replace(panel, row=row, column=1))
    return fig.Figure(panels=tuple(panels), height=185.0)


def _floor(case: CaseResult) -> fig.Panel:
    """Return the feet before and after a run, with their paths, from above."""
    in_record = cabinet_in(case.record)
    assert in_record is not None
    cabinet = in_record[0]
    feet = np.array([[cabinet.feet[name].x, cabinet.feet[name].y] for name in cabinet.corners])
    paths = DISTANCE.values(feet + _thinned(case.record.foot_slip.values[:, :, :2]))
    marks: list[fig.Mark] = [fig.Line(*paths[:, foot].T) for foot in range(len(feet))]
    for at, color in ((0, fig.QUIET), (-1, fig.OURS)):
        corners = np.vstack([paths[at], paths[at][:1]])
        marks.append(fig.Line(*corners.T, color=color, dash="" if at else "dashed"))
        marks.append(fig.Points(*paths[at].T, color=color, is_open=at == 0, size=8.0))
    x, y = (fig.Axis(label=DISTANCE.named(axis).label) for axis in "xy")
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
