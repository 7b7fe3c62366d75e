"""Show a cycle: its course in panels one below the other, and a table of its parts."""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.report import figure as fig
from wm_drake.report.chart import panel
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import TIME, quantity_of, shown, text_of
from wm_drake.simulation.cases import Case
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.cycle.study import Cycle

HOW = (
    "Each point stands for {window}: mean speed, extremes of the rest. Amplitude: half of the "
    "distance from the smallest to the largest displacement at a sensor. Unbalance (static): mass "
    "times distance from the drum axis, of all masses of the load with the water left in them and "
    "of the empty drum. Loads of the feet: a rigid cabinet that stands fast on a rigid floor, with "
    "its weight."
)


FROM_ZERO = {"range": (0.0, None)}


def cycle_answer(
    parameters: MachineParameters, case: Case, cycle: Cycle, parts: xr.Dataset
) -> Answer:
    """Return the answer of the study.

    Args:
        parts: As of `parts_of` in `wm_drake.studies.cycle.study`.
    """
    course = cycle.course
    table = LabelledTable(
        "parts",
        parts.assign(touches=parts.gap.drop_attrs() <= 0.0),
        "Parts of the cycle",
        "Extremes in each part of the cycle; mass of the load and unbalance at its end.",
        marked=("touches", "alarm"),
        is_in_terminal=True,
    )
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
            ("Integration", cycle.integration),
        ),
        diverged=(f"{case.name}: {cycle.diverged}",) if cycle.diverged else (),
    )


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


SHOWN: dict[str, dict[str, Any]] = {
    "drum_speed": {},
    "mass": {"y": FROM_ZERO},
    "unbalance": {"y": FROM_ZERO},
    "half_swing": {"y": FROM_ZERO, "by": "sensor"},
    "gap": {"y": FROM_ZERO},
    "foot_smallest": {"drawn": ["foot_smallest", "foot_largest"]},
    "sideways": {"y": FROM_ZERO},
}
"""How variables of a cycle are drawn over time, as far as the machine has them."""

WORDS = {"foot_smallest": "load of a foot", "sideways": "force along the floor"}
"""Words of panels, where those of their first variable do not do."""


def course_plot(course: xr.Dataset) -> Plot:
    """Return speed, unbalance, half swings, gap and loads of the feet over the cycle."""
    ends, panels = {"range": (0.0, shown(course.time)[-1].item())}, []
    for name, how in SHOWN.items():
        if name in course and course[name].notnull().any():
            quantity = quantity_of(course[name])
            quantity = quantity.named(WORDS.get(name, quantity.words))
            how = {"drawn": [name], "x": ends, **how}
            how["y"] = {"label": quantity.label, **how.get("y", {})}
            panels.append(replace(panel(course, "time", **how), name=quantity.words))
    window = TIME.text(float(np.diff(course.time.values[:2]).sum()))
    return Plot(
        fig.Figure(panels=fig.in_grid(panels, 1, share="x"), height=150.0),
        f"Course of the cycle: {', '.join(one.name for one in panels)} over time.",
        HOW.format(window=window),
    )
