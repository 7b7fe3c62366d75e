"""Show a cycle: its course in panels one below the other, and a table of its parts."""

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import STEP, TIME, Quantity, quantity_of, shown, text_of
from wm_drake.simulation.cases import Case
from wm_drake.studies.answer import Answer, Part, Plot

HOW = (
    "Each point stands for {window}: mean speed, extremes of the rest. Amplitude: half of the "
    "distance from the smallest to the largest displacement at a sensor. Unbalance (static): mass "
    "times distance from the drum axis, of all masses of the load with the water left in them and "
    "of the empty drum. Loads of the feet: a rigid cabinet that stands fast on a rigid floor, with "
    "its weight."
)


def cycle_answer(
    parameters: MachineParameters, case: Case, course: xr.Dataset, parts: xr.Dataset
) -> Answer:
    """Return the answer of the study.

    Args:
        course, parts: As of `course_of` and `parts_of` in `wm_drake.studies.cycle.study`.
    """
    table = LabelledTable(
        "parts",
        parts.assign(touches=parts.gap.drop_attrs() <= 0.0),
        "Parts of the cycle",
        "Extremes in each part of the cycle; mass of the load and unbalance at its end.",
        marked=("touches", "alarm"),
        is_in_terminal=True,
    )
    diverged = (f"{case.name}: {course.attrs['diverged']}",) if course.attrs["diverged"] else ()
    return Answer(
        f"Cycle of machine {parameters.name}",
        summary(case, course),
        parameters,
        (
            Part("The cycle", (course_plot(course), _course_table(course))),
            Part("Parts of the cycle", (table,)),
        ),
        (
            ("Load", case.name),
            ("Duration of the cycle", TIME.text(case.profile.duration)),
            ("Integration", _integration(course)),
        ),
        diverged=diverged,
    )


def _integration(course: xr.Dataset) -> str:
    """Return how the cycle was integrated."""
    how = course.attrs
    step, period = STEP.text(how["step"]), STEP.text(how["period"])
    return f"{how['integrator']}, steps of {step}, samples every {period}"


def _course_table(course: xr.Dataset) -> LabelledTable:
    """Return the course for a file."""
    words = {name: f"half swing {name}" for name in course.sensor.values.tolist()}
    return LabelledTable("course", course, across="sensor", words=words, is_in_json=False)


def summary(case: Case, course: xr.Dataset) -> str:
    """Return the answer in a few sentences."""
    first, last = course.isel(time=0), course.isel(time=-1)
    text = f"Load {case.name} has {text_of(first.mass)} at the start"
    if first.mass > last.mass:
        text += (
            f" and {text_of(last.mass)} at the end; its unbalance goes from "
            f"{text_of(first.unbalance)} to {text_of(last.unbalance)}"
        )
    largest = course.isel(course.half_swing.argmax(...))
    sentences = [
        f"{text}.",
        f"The largest half swing is {text_of(largest.half_swing)}, at sensor "
        f"{largest.sensor.item()} at {text_of(largest.drum_speed)} after {text_of(largest.time)}.",
    ]
    if course.gap.notnull().any():
        least = course.isel(time=int(course.gap.argmin("time")))
        does = "touches" if least.gap <= 0.0 else "does not touch"
        sentences.append(
            f"The tub {does} the housing: the smallest gap is {text_of(least.gap)}, at "
            f"{text_of(least.drum_speed)} after {text_of(least.time)}."
        )
    if "foot_smallest" in course:
        light = course.isel(time=int(course.foot_smallest.argmin("time")))
        sentences.append(
            f"Every foot is loaded with at least {text_of(light.foot_smallest)}: none lifts off."
            if light.foot_smallest > 0.0
            else f"A foot lifts off at {text_of(light.drum_speed)} after {text_of(light.time)}."
        )
    return " ".join(sentences)


def course_plot(course: xr.Dataset) -> Plot:
    """Return speed, unbalance, half swings, gap and loads of the feet over the cycle."""
    time = shown(course.time)
    panels = [
        _panel(course, time, ("drum_speed",)),
        _panel(course, time, ("mass",), from_zero=True),
        _panel(course, time, ("unbalance",), from_zero=True),
        _swings(course, time),
    ]
    if course.gap.notnull().any():
        panels.append(_panel(course, time, ("gap",), from_zero=True))
    if "foot_smallest" in course:
        panels.append(_panel(course, time, ("foot_smallest", "foot_largest"), "load of a foot"))
        panels.append(_panel(course, time, ("sideways",), "force along the floor", from_zero=True))
    figure = fig.Figure(panels=fig.in_grid(panels, 1, share="x"), height=150.0)
    window = TIME.text(float(np.diff(course.time.values[:2]).sum()))
    return Plot(
        figure,
        f"Course of the cycle: {', '.join(panel.name for panel in panels)} over time.",
        HOW.format(window=window),
    )


def _panel(
    course: xr.Dataset,
    time: np.ndarray,
    names: tuple[str, ...],
    words: str = "",
    *,
    from_zero: bool = False,
) -> fig.Panel:
    """Return a panel of variables of one unit over time."""
    quantity: Quantity = quantity_of(course[names[0]])
    quantity = quantity.named(words) if words else quantity
    marks = tuple(
        fig.Line(time, shown(course[name]), color=color, key=_key(course[name], names))
        for name, color in zip(names, fig.COLOURS, strict=False)
    )
    y = fig.Axis(label=quantity.label, range=(0.0 if from_zero else None, None))
    x = fig.Axis(label=TIME.label, range=(0.0, float(time[-1])))
    return fig.Panel(name=quantity.words, marks=marks, x=x, y=y)


def _key(array: xr.DataArray, names: tuple[str, ...]) -> str:
    return quantity_of(array).words if len(names) > 1 else ""


def _swings(course: xr.Dataset, time: np.ndarray) -> fig.Panel:
    """Return the half swings of all sensors over time."""
    quantity = quantity_of(course.half_swing)
    marks = tuple(
        fig.Line(time, shown(course.half_swing.sel(sensor=name)), color=color, key=f"sensor {name}")
        for name, color in zip(course.sensor.values.tolist(), _colours(course), strict=True)
    )
    x = fig.Axis(label=TIME.label, range=(0.0, float(time[-1])))
    y = fig.Axis(label=quantity.label, range=(0.0, None))
    return fig.Panel(name=quantity.words, marks=marks, x=x, y=y)


def _colours(course: xr.Dataset) -> list[str]:
    count = course.sizes["sensor"]
    return [fig.COLOURS[k % len(fig.COLOURS)] for k in range(count)]
