"""Report of the design study: front with designs to pick, chosen designs, history, run details."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import MISSING, MM_PER_M, significant
from wm_drake.report.page import Picture, as_json, picture, render
from wm_drake.report.pareto.figures import (
    DESIGNS,
    PICKED,
    envelopes_figure,
    first_picked,
    front_figure,
    history_figure,
    pairs_of,
)
from wm_drake.report.tables import Group, Table, line
from wm_drake.studies.pareto.envelopes import Envelopes
from wm_drake.studies.pareto.robust import FRESH, Promise
from wm_drake.studies.pareto.study import COMPROMISE, ParetoFront
from wm_drake.studies.pareto.tables import machine_file_name

DIGITS = 4
"""Significant digits of a number on the page."""


def pareto_report(
    front: ParetoFront,
    shown: Envelopes | None,
    kept: Sequence[Promise],
    about: str,
    command: str = "",
    wall_s: float = 0.0,
) -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        front: Result of the study.
        shown: Envelopes of its designs; None without a front.
        kept: Check of a robust front on fresh samples; empty for a nominal one.
        about: Description in the design file.
        command: Command line of the study, shown on the page.
        wall_s: Duration of the study. [s]
    """
    designs = front.designs
    facts = [
        ("Machine", designs.parameters.name),
        ("Designs", f"{front.found.evaluations}, each {designs.scenarios} runs, {wall_s:.0f} s"),
        ("Hypervolume", significant(front.found.hypervolume, DIGITS)),
        ("Command", command),
    ]
    has_front = bool(len(front.objectives))
    return render(
        "pareto/page.html",
        title=f"Designs of machine {designs.parameters.name}",
        about=about,
        summary=summary(front, kept),
        warnings=[] if has_front else ["No design meets all constraints."],
        front=_front(front) if has_front and len(designs.objectives) > 1 else None,
        picked=as_json(_picked(front, shown)) if has_front and shown else None,
        envelopes=_envelopes(front, shown) if has_front and shown else None,
        chosen=_chosen(front) if has_front else None,
        promises=_promises(kept) if kept else None,
        history=_history(front),
        facts=[(word, text) for word, text in facts if text],
    )


def summary(front: ParetoFront, kept: Sequence[Promise] = ()) -> str:
    """Return the findings as one paragraph."""
    designs, count = front.designs, len(front.objectives)
    if not count:
        return f"None of {front.found.evaluations} designs meets all constraints."
    goals = listed([g.given.quantity for g in designs.objectives])
    text = f"{front.found.evaluations} designs give a front of {count} for {goals}."
    parts = []
    number = front.chosen.get(COMPROMISE, next(iter(front.chosen.values())))
    for goal, value, own in zip(
        designs.objectives, front.objectives[number], front.nominal_objectives, strict=True
    ):
        unit = goal.unit.shown.replace("*", " ")
        parts.append(f"{goal.given.quantity} {_text(value)} {unit} in place of {_text(own)} {unit}")
    judged = [p.is_kept for p in kept if p.is_kept is not None]
    robust = (
        f" On fresh samples {sum(judged)} of {len(judged)} values of the chosen designs keep what "
        "they promised."
        if judged
        else ""
    )
    name = "The compromise" if COMPROMISE in front.chosen else "The best design"
    return f"{text} {name} has {listed(parts)} of the machine itself.{robust}"


def listed(words: list[str]) -> str:
    """Return words as a list in a sentence: a, b and c."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def _text(value: float) -> str:
    return significant(float(value), DIGITS) if np.isfinite(value) else MISSING


def _front(front: ParetoFront) -> Picture:
    """Return the picture of the front, in which a design can be picked."""
    caption = (
        "Each point is a design; no other design is better in every objective. The circle is the "
        "picked design; the cross is the machine itself."
    )
    count = len(front.objectives)
    return picture(front_figure(front), f"Front of {count} designs.", caption)


def _envelopes(front: ParetoFront, shown: Envelopes) -> Picture:
    """Return the picture of the envelopes of the picked design."""
    caption = (
        f"Largest envelope of the filtered displacements over time: {shown.of}. Coloured: the "
        "picked design; grey: the machine itself."
    )
    alternative = "Envelopes of the picked design at each sensor."
    return picture(envelopes_figure(shown, first_picked(front)), alternative, caption)


def _picked(front: ParetoFront, shown: Envelopes) -> dict[str, Any]:
    """Return the numbers of each design that the page needs to show it when it is picked."""
    places = [[_finite(value) for value in design] for design in front.objectives]
    return {
        "rows": _rows(front),
        "picked": first_picked(front),
        "pairs": pairs_of(front),
        "objectives": places,
        "envelopes": [[_in_mm(line) for line in design] for design in shown.designs],
        "labels": {"picked": PICKED, "designs": DESIGNS},
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _in_mm(line: FloatArray) -> list[float | None]:
    """Return an envelope in mm, rounded; None where there is none."""
    return [round(MM_PER_M * float(v), 2) if np.isfinite(v) else None for v in line]


def _rows(front: ParetoFront) -> list[list[tuple[str, str, str]]]:
    """Return kind, name and value of each number of each design, for the picked one."""
    designs, found = front.designs, []
    for number, design in enumerate(front.found.designs):
        rows = [
            ("objective", g.given.quantity, f"{_text(v)} {g.unit.shown.replace('*', ' ')}")
            for g, v in zip(designs.objectives, front.objectives[number], strict=True)
        ]
        for goal, value in zip(designs.constraints, front.constraints[number], strict=True):
            unit = goal.unit.shown.replace("*", " ")
            side = "at most" if goal.is_small_better else "at least"
            margin = abs(float(value) - goal.limit)
            text = f"{_text(value)} {unit}, {side} {_text(goal.limit)} {unit}"
            text += f": margin {_text(margin)} {unit}"
            rows.append(("constraint", goal.given.quantity, text))
        for dimension, place in zip(designs.dimensions, design, strict=True):
            value, unit = dimension.shown(float(place))
            shown = value if isinstance(value, str) else _text(value)
            rows.append(("variable", dimension.name, f"{shown} {unit.replace('*', ' ')}"))
        found.append(rows)
    return found


def _chosen(front: ParetoFront) -> Table:
    rows = _rows(front)
    groups: list[Group] = []
    for index, (kind, name, _) in enumerate(rows[0]):
        cells = [rows[number][index][2].split(", at")[0] for number in front.chosen.values()]
        groups.append(line(name, [kind, *cells]))
    groups.append(line("machine file", ["", *map(machine_file_name, front.chosen)]))
    caption = (
        "Chosen designs. The compromise is nearest to the best of all objectives, each scaled to "
        "the range of the front. Each has a machine file for --machine."
    )
    return Table(caption, ("name", "kind", *front.chosen), tuple(groups), text_columns=2)


def _promises(kept: Sequence[Promise]) -> Table:
    """Return what the chosen designs of a robust front promised and keep on fresh samples."""
    groups = []
    for p in kept:
        unit = p.goal.unit.shown.replace("*", " ")
        cells = [f"{p.goal.given.quantity}, {p.goal.given.over}", unit]
        for found in (p.promised, p.fresh):
            ends = f" ({_text(found.lower)} to {_text(found.upper)})"
            cells.append(_text(found.value) + (ends if np.isfinite(found.lower) else ""))
        cells.append({True: "yes", False: "no", None: MISSING}[p.is_kept])
        groups.append(line(p.design, cells, "alarm" if p.is_kept is False else ""))
    caption = (
        f"Chosen designs on {FRESH} times as many fresh samples. In brackets: 95 % intervals. A "
        "promise is kept if the fresh value is not worse than the worse end of its interval. The "
        "worst of the samples has no interval: it grows with their number."
    )
    header = ("design", "quantity", "unit", "promised", "fresh samples", "kept")
    return Table(caption, header, tuple(groups), text_columns=3)


def _history(front: ParetoFront) -> Picture:
    caption = (
        "Hypervolume of the front after each generation. Objectives are scaled so that the first "
        "population reaches from 0 to 1. A level curve means that more evaluations find little."
    )
    alternative = "Hypervolume over the number of evaluated designs."
    return picture(history_figure(front), alternative, caption)
