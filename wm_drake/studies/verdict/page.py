"""What the verdict shows: terminal, JSON, files, and a page whose first screen is the answer."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import MachineParameters
from wm_drake.report import figure as fig
from wm_drake.report.formatting import (
    MM_PER_M,
    RPM_PER_RAD_S,
    listed,
    number,
    percent,
    plain,
    shape_name,
)
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, table_of
from wm_drake.report.terminal import Printed
from wm_drake.simulation.measures.responses import GAP, Response
from wm_drake.studies.study import Facts, Result
from wm_drake.studies.tolerance.words import masses_text
from wm_drake.studies.verdict.study import Influence, LaundryGaps, Outcome

MOST_NAMED = 3
"""Number of quantities that the answer names."""

MOST_DRAWN = 12
"""Number of influences that the figure shows."""

PARTS = {
    "spring_types": "springs",
    "damper_types": "dampers",
    "bushing_types": "bushings of the dampers",
}

HOW_OTHERS_DIFFER = (
    "'wm-drake spin' runs the loads of the machine only and shows the motion over time. 'wm-drake "
    "study tolerance' draws many more samples of laundry and parts, so that rare contact can be "
    "counted, and leaves the loads of the machine out. 'wm-drake study gasket' varies the gasket "
    "alone. Their smallest gaps differ for this reason."
)
"""How the commands that also show a smallest gap differ."""


@dataclass(frozen=True)
class VerdictResult(Result):
    """Result of a verdict.

    Attributes:
        clearance: Gap that must remain. [m]
        change: Change of a part that was tried. [%]
        base: Runs of the machine as it is.
        influences: Of each part, the strongest first.
        single: Best single change; None if none helps.
        combination: Best combination of at least two changes; None if none is better.
        laundry: Random laundry in the machine as it is.
        laundry_changed: The same laundry with the best change; None without one.
        about: Description of the laundry.
        responses: Responses of the tables, with words and unit.
        command: Command that gives a verdict on the machine again.
    """

    machine: MachineParameters
    loads: tuple[str, ...]
    clearance: float
    change: float
    base: Outcome
    influences: tuple[Influence, ...]
    single: Outcome | None
    combination: Outcome | None
    laundry: LaundryGaps
    laundry_changed: LaundryGaps | None
    about: str
    responses: tuple[Response, ...]
    command: str
    runs: int

    @property
    def best(self) -> Outcome | None:
        """Return the best change; None if none helps."""
        return self.combination or self.single

    @property
    def is_clear(self) -> bool:
        """Return whether all loads and all samples of the laundry keep the clearance."""
        return self.smallest > self.clearance

    @property
    def smallest(self) -> float:
        """Return the smallest gap of all loads and all samples of the laundry. [m]"""
        return min(self.base.gap, float(self.laundry.gaps.min()))

    @property
    def word(self) -> str:
        """Return the verdict in one or two words."""
        if self.is_clear:
            return "clear"
        return "touches" if self.smallest <= 0.0 else "too near"

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return gaps of the loads, influences, and the samples of the laundry."""
        return {
            "loads": loads_frame(self),
            "influences": influences_frame(self),
            "laundry": pd.DataFrame({"smallest_gap_mm": MM_PER_M * self.laundry.gaps}),
        }

    def as_json(self) -> dict[str, Any]:
        """Return the verdict for JSON."""
        estimate, lower, upper = self.laundry.probability
        changes = {"best_single_change": self.single, "best_combination": self.combination}
        shown = {
            "machine": self.machine.name,
            "verdict": self.word,
            "clearance_mm": MM_PER_M * self.clearance,
            "smallest_gap_mm": MM_PER_M * self.base.gap,
            "margin_mm": MM_PER_M * (self.base.gap - self.clearance),
            "loads": loads_frame(self).to_dict("records"),
            "laundry": {
                "samples": len(self.laundry.gaps),
                "probability": estimate,
                "lower": lower,
                "upper": upper,
                "smallest_gap_mm": MM_PER_M * float(self.laundry.gaps.min()),
            },
            "deciding": influences_frame(self)[:MOST_NAMED].to_dict("records"),
            **{
                name: outcome
                and {"set": dict(outcome.changes), "smallest_gap_mm": MM_PER_M * outcome.gap}
                for name, outcome in changes.items()
            },
            "line_to_copy": line_to_copy(self),
            "runs": self.runs,
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Yield the answer, then the loads."""
        yield answer(self)
        for word, text in facts_of(self):
            yield f"{word}: {text}"
        yield loads_table(self).terminal("Smallest gap of each load")

    def page(self, facts: Facts) -> str:
        """Return the page."""
        made = [
            ("Machine", self.machine.name),
            ("Runs", f"{self.runs} in {facts.wall_s:.0f} s"),
            ("Laundry", f"{self.about}; {len(self.laundry.gaps)} samples"),
            *facts.rows(),
        ]
        return SectionedPage(
            f"Verdict on machine {self.machine.name}",
            answer(self),
            [
                Section("gaps", "Smallest gaps", (gaps_picture(self),)),
                Section("influences", "What decides the gap", (influences_picture(self),)),
                Section("loads", "Each load", tables=(loads_table(self),)),
                Section("cost", "What the changes cost", tables=(cost_table(self),)),
                Section("others", "Other commands with a smallest gap", text=HOW_OTHERS_DIFFER),
            ],
            made,
            self.machine,
            facts.warnings,
            advice=Section("answer", "In short", facts=list(facts_of(self))),
        ).html()

    def failures(self) -> list[str]:
        """Return one line if the tub touches, which makes the exit code 1."""
        if self.is_clear:
            return []
        return [f"verdict: {self.word}"]


LINE = "Line to copy"
"""Words before the command that runs the machine with the best change."""


def answer(findings: VerdictResult) -> str:
    """Return the answer in a sentence or two."""
    base, laundry = findings.base, findings.laundry
    if not np.isfinite(base.gap):
        index = int(np.argmin(base.gaps))
        return (
            f"No verdict: the run of load {findings.loads[index]} failed, which counts as contact."
        )
    text = f"{_where(findings, base)}."
    if base.gap <= 0.0:
        return f"The tub touches the housing: {text}"
    count = int(np.sum(laundry.gaps <= 0.0))
    if count:
        return (
            f"The tub touches the housing in {count} of {len(laundry.gaps)} runs with random "
            f"laundry. With the loads of the machine it does not: {text}"
        )
    opening = "The tub does not touch the housing"
    if not findings.is_clear:
        opening += f", but it comes nearer than {_mm(findings.clearance)}"
    return f"{opening}: {text}"


def _where(findings: VerdictResult, outcome: Outcome) -> str:
    """Return the smallest gap of all loads with its place, load and speed."""
    index = int(np.argmin(outcome.gaps))
    pair, speed = outcome.place(index)
    size = f"smallest gap {_mm(outcome.gap)}"
    if outcome.gap <= 0.0:
        size = f"overlap of {_mm(-outcome.gap)}"
    return (
        f"{size}, between {_pair(pair)}, with load {findings.loads[index]} at "
        f"{number(RPM_PER_RAD_S * speed, 0)} rpm"
    )


def _pair(name: str) -> str:
    return " and ".join(map(shape_name, name.split("|")))


def _mm(value: float) -> str:
    """Return a length as text; `value` in m."""
    return f"{number(MM_PER_M * value)}\u00a0mm"


def facts_of(findings: VerdictResult) -> list[tuple[str, str]]:
    """Return the rest of the answer as pairs of word and text."""
    f, named_influences = findings, findings.influences[:MOST_NAMED]
    margin = f.base.gap - f.clearance
    rows = [("Random laundry", laundry_text(f.laundry, f.about))]
    heaviest = max(f.machine.loads[name].mass for name in f.loads)
    if f.laundry.masses and f.laundry.masses[1] < heaviest:
        compared = masses_text(f.machine, f.loads, f.laundry.masses)
        rows.append(("Its mass", f"{compared} --laundry names a file with other laundry"))
    if f.clearance:
        kept = "more" if margin > 0.0 else "less"
        rows.append(("Margin", f"{_mm(abs(margin))} {kept} than the clearance, {_mm(f.clearance)}"))
    else:
        rows.append(("Margin", f"{_mm(margin)} to contact; --clearance '10 mm' sets another limit"))
    if named_influences:
        rows.append(("What decides it", "; ".join(map(influence_text, named_influences))))
    if f.single is None:
        none = f"no change of one part by {f.change:g} % makes the smallest gap larger"
        return [*rows, ("What to change", none)]
    rows.append(("Best single change", change_text(f, f.single)))
    if f.combination:
        rows.append(("Best combination", change_text(f, f.combination)))
    else:
        rows.append(("Best combination", "none is better than the best single change"))
    if f.laundry_changed:
        rows.append(("Random laundry then", laundry_text(f.laundry_changed)))
    return [*rows, (LINE, line_to_copy(f))]


def laundry_text(laundry: LaundryGaps, about: str = "") -> str:
    """Return probability and smallest gap of the samples."""
    estimate, lower, upper = laundry.probability
    what = "touch" if not laundry.clearance else f"keep less than {_mm(laundry.clearance)}"
    count = int(np.sum(laundry.gaps <= laundry.clearance))
    of_what = f" ({about})" if about else ""
    smallest = float(laundry.gaps.min())
    gap = f"smallest gap {_mm(smallest)}" if np.isfinite(smallest) else "a run failed"
    return (
        f"{count or 'none'} of {len(laundry.gaps)} runs{of_what} {what}; probability "
        f"{100.0 * estimate:.2g} % (95 % interval {100.0 * lower:.2g} to {100.0 * upper:.2g} %); "
        f"{gap}"
    )


def words_of(key: str) -> str:
    """Return a number in words: `gasket.stiffness_x` becomes `stiffness along x of the gasket`."""
    table, *middle, last = key.split(".")
    field, _, axis = last.rpartition("_")
    is_along = field and axis in ("x", "y", "z")
    name = shape_name(field if is_along else last)
    if is_along:
        turns = "rotational" in name or "torque" in name
        name = f"{name} {'about' if turns else 'along'} {axis}"
    if table == "bodies":
        return f"{name} of the {shape_name(middle[0])}"
    if table == "gasket":
        return f"{name} of the gasket"
    of_part = f"{shape_name(middle[1])}s, " if len(middle) > 1 else ""
    return f"{name} of the {of_part}{PARTS[table]} '{middle[0]}'"


def influence_text(influence: Influence) -> str:
    """Return what more and less of a number do to the gap."""
    ends = f"{_mm(influence.less.gap)} with less, {_mm(influence.more.gap)} with more"
    return f"{words_of(influence.key)} ({ends})"


def change_text(findings: VerdictResult, outcome: Outcome) -> str:
    """Return a change with what it does to the smallest gap of all loads."""
    parts = []
    for key, text in outcome.changes.items():
        less = next(i.less for i in findings.influences if i.key == key)
        change = -findings.change if less.changes[key] == text else findings.change
        new = "" if text.endswith("%") else f" to {text.replace('*', ' ')}"
        parts.append(f"{words_of(key)} {percent(change)}{new}")
    gap = f"{_mm(findings.base.gap)} becomes {_mm(outcome.gap)}"
    return f"{listed(parts)}: {gap}, verified by runs of all loads"


def line_to_copy(findings: VerdictResult) -> str:
    """Return the command that runs the machine with the best change; "" without one."""
    if findings.best is None:
        return ""
    changes = [f'--set "{key}={text}"' for key, text in findings.best.changes.items()]
    return " ".join([findings.command, *changes])


def loads_frame(findings: VerdictResult) -> pd.DataFrame:
    """Return gap, place and speed of each load, before and after the best change."""
    best = findings.best
    rows = []
    for index, load in enumerate(findings.loads):
        pair, speed = findings.base.place(index)
        changed = MM_PER_M * float(best.gaps[index]) if best else np.nan
        row = {
            "load": load,
            "between": _pair(pair),
            "speed_rpm": RPM_PER_RAD_S * speed,
            "smallest_gap_mm": MM_PER_M * float(findings.base.gaps[index]),
            "changed_gap_mm": changed,
        }
        rows.append(row)
    return pd.DataFrame(rows)


def loads_table(findings: VerdictResult) -> Table:
    """Return gap, place and speed of each load."""
    caption = (
        "Smallest gap between the parts that move with the tub and the housing. 0 and below: "
        "contact; the model has no contact forces."
    )
    columns = {
        "speed_rpm": Column("at", "rpm", 0),
        "smallest_gap_mm": Column("smallest gap", "mm", 1),
        "changed_gap_mm": Column("after the best change", "mm", 1),
    }
    alarm = ["alarm" if gap <= findings.clearance else "" for gap in findings.base.gaps]
    return table_of(loads_frame(findings), caption, columns, alarm)


def influences_frame(findings: VerdictResult) -> pd.DataFrame:
    """Return the smallest gap of all loads with less and more of each number."""
    return pd.DataFrame(
        [
            {
                "quantity": words_of(influence.key),
                "key": influence.key,
                "gap_with_less_mm": MM_PER_M * influence.less.gap,
                "gap_with_more_mm": MM_PER_M * influence.more.gap,
            }
            for influence in findings.influences
        ],
        columns=["quantity", "key", "gap_with_less_mm", "gap_with_more_mm"],
    )


def cost_table(findings: VerdictResult) -> Table:
    """Return the largest values of all loads, before and after the changes."""
    outcomes = {
        "as it is": findings.base,
        "best single change": findings.single,
        "best combination": findings.combination,
    }
    rows = []
    for response in findings.responses:
        worst = np.min if response.name == GAP else np.max
        values = [
            float(worst(response.values(outcome.table))) if outcome else np.nan
            for outcome in outcomes.values()
        ]
        rows.append([f"{response.title}, {response.unit_text}", *values])
    caption = (
        "Smallest gap and largest displacements, forces of the gasket and forces of the mounts of "
        "all loads. A change that keeps the tub away from the housing may load it more."
    )
    columns = {name: Column(name, decimals=1) for name in outcomes}
    return table_of(pd.DataFrame(rows, columns=["quantity", *outcomes]), caption, columns)


def gaps_picture(findings: VerdictResult) -> Picture:
    """Return the gaps of the loads and of the laundry, before and after the best change."""
    f, best = findings, findings.best
    sets = [(f.base, f.laundry, fig.OURS, "as it is", 0.13)]
    if best and f.laundry_changed:
        sets.append((best, f.laundry_changed, fig.QUIET, "after the best change", -0.13))
    names = [*f.loads, "random laundry"]
    largest = MM_PER_M * f.clearance
    marks: list[fig.Mark] = [fig.Rule(0.0, "y", color=fig.MARK)]
    if f.clearance:
        marks.append(fig.Rule(largest, "y", color=fig.MEASURED, dash="dashed"))
    for outcome, laundry, color, key, shift in sets:
        gaps = MM_PER_M * np.array([*outcome.gaps, laundry.gaps.min()])
        at = np.arange(len(gaps), dtype=float)[::-1] + shift
        shown = np.isfinite(gaps)
        ends = (np.zeros(shown.sum()), at[shown]), (gaps[shown], at[shown])
        marks.append(fig.segments(*ends, color=color, width=4.0))
        marks.append(fig.Points(gaps[shown], at[shown], color=color, size=9.0, key=key))
        for gap, place in zip(gaps[shown], at[shown], strict=True):
            end, text = max(float(gap), 0.0), f"{number(float(gap))} mm"
            marks.append(fig.Text(end, float(place), text, across="left", shift=(10.0, 0.0)))
            largest = max(largest, end)
    y = fig.Axis(
        ticks=fig.named(names, np.arange(len(names))[::-1]), has_grid=False, has_line=False
    )
    x = fig.Axis(label="smallest gap, mm (0: the parts touch)", range=(None, 1.12 * largest))
    figure = fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=46.0 * len(names))
    caption = (
        "Smallest gap of each load of the machine, and of all samples of random laundry. Dashed: "
        "the clearance wanted."
    )
    return picture(figure, f"Smallest gaps; the smallest one is {_mm(f.base.gap)}.", caption)


def influences_picture(findings: VerdictResult) -> Picture:
    """Return the smallest gap of all loads with less and more of each part."""
    drawn = findings.influences[:MOST_DRAWN]
    at = np.arange(len(drawn), dtype=float)[::-1]
    less, more = (
        MM_PER_M * np.array([getattr(influence, end).gap for influence in drawn])
        for end in ("less", "more")
    )
    marks = (
        fig.Rule(MM_PER_M * findings.base.gap, "y", color=fig.MARK),
        fig.segments((less, at), (more, at), color=fig.QUIET, width=3.0),
        fig.Points(less, at, color=fig.MEASURED, size=9.0, key=f"{findings.change:g} % less"),
        fig.Points(more, at, color=fig.OURS, size=9.0, key=f"{findings.change:g} % more"),
    )
    y = fig.Axis(ticks=fig.named([words_of(i.key) for i in drawn], at), has_grid=False)
    panel = fig.Panel(marks=marks, x=fig.Axis(label="smallest gap of all loads, mm"), y=y)
    figure = fig.Figure(panels=(panel,), height=28.0 * len(drawn) + 30.0)
    caption = (
        f"Smallest gap of all loads if one number of a part is {findings.change:g} % smaller or "
        "larger; line: the machine as it is. Springs, dampers, bushings, gasket and "
        "counterweights are tried; a curve of forces is scaled. influences.csv has all of them."
    )
    named_first = "; ".join(map(influence_text, drawn[:MOST_NAMED]))
    return picture(figure, f"Influence of the parts. Strongest: {named_first}.", caption)
