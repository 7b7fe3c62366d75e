"""What the design study shows: files, JSON, terminal, and a page on which designs are picked."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from wm_drake.parameters import machine_yaml
from wm_drake.report.formatting import MISSING, MM_PER_M, listed, plain, significant, with_interval
from wm_drake.report.page import Picture, Section, SectionedPage, as_json, fragment, picture
from wm_drake.report.table import Table, Value, line
from wm_drake.studies.design.figures import (
    DESIGNS,
    PICKED,
    envelopes_figure,
    first_picked,
    front_figure,
    history_figure,
    pairs_of,
)
from wm_drake.studies.design.study import COMPROMISE, FRESH, Envelopes, ParetoFront, Promise
from wm_drake.studies.study import Facts, Result

if TYPE_CHECKING:
    from rich import table as terminal


@dataclass(frozen=True)
class DesignResult(Result):
    """Result of the study.

    Attributes:
        promises: Check of a robust front on fresh samples; empty for a nominal one.
        envelopes: Envelopes of the designs of the front; None without a front.
        about: Description in the design file.
    """

    front: ParetoFront
    promises: list[Promise]
    envelopes: Envelopes | None
    about: str

    float_format = None

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return front, history and, of a robust front, the check on fresh samples."""
        frames = {"front": front_table(self.front), "history": history_table(self.front)}
        return frames | ({"robust": promises_table(self.promises)} if self.promises else {})

    def texts(self) -> dict[str, str]:
        """Return the machine files of chosen designs."""
        files = {}
        for name, number in self.front.chosen.items():
            machine = self.front.machine(number)
            about = f"Design '{name}' of a design study of machine {machine.name}"
            changes = {"name": f"{machine.name}, {name}", "about": about, "measured": ()}
            copy = machine.model_copy(update=changes)
            files[machine_file_name(name)] = machine_yaml(copy)
        return files

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        front = self.front
        goals = zip(front.designs.objectives, front.nominal_objectives, strict=True)
        shown = {
            "robust": promises_table(self.promises).to_dict("records"),
            "evaluations": front.search.evaluations,
            "front": designs_as_json(front),
            "hypervolume": front.search.hypervolume,
            "chosen": {name: number + 1 for name, number in front.chosen.items()},
            "nominal": {goal.key: value for goal, value in goals},
        }
        return plain(shown)

    def terminal(self) -> "Iterable[terminal.Table | str]":
        """Yield the chosen designs, if there are any, and a summary."""
        if self.front.chosen:
            yield _chosen(self.front).terminal("Chosen designs of the front")
        yield summary(self.front, self.promises, self.envelopes)

    def page(self, facts: Facts) -> str:
        """Return the page: front with designs to pick, search, chosen designs."""
        front, search = self.front, self.front.search
        designs, has_front = front.designs, bool(len(front.objectives))
        evaluated = f"{search.evaluations}, each {designs.scenarios} runs, {facts.wall_s:.0f} s"
        made = [
            ("Machine", designs.parameters.name),
            ("Designs", evaluated),
            ("Hypervolume", significant(search.hypervolume)),
            *facts.rows(),
        ]
        none = [] if has_front else ["No design meets all constraints."]
        shown = self.envelopes if has_front else None
        chosen = [_chosen(front)] if has_front else []
        promised = [_promises(self.promises)] if self.promises else []
        sections = [
            Section("front", "Front", body=_picker(front, shown)) if shown else None,
            Section("search", "Search", (_history(front),)),
            Section("chosen", "Chosen designs", tables=chosen),
            Section("robust", "Robust designs on fresh samples", tables=promised),
        ]
        return SectionedPage(
            f"Designs of machine {designs.parameters.name}",
            summary(front, self.promises, self.envelopes),
            sections,
            made,
            warnings=[*facts.warnings, *none],
            about=self.about,
            script=Path(__file__).with_name("pick.js") if shown else None,
        ).html()


def _picker(front: ParetoFront, shown: Envelopes) -> str:
    """Return the part of the page on which designs are picked."""
    has_plot = len(front.designs.objectives) > 1
    return fragment(
        Path(__file__).with_name("picked.html"),
        front=_front(front) if has_plot else None,
        picked=as_json(_picked(front, shown)),
        envelopes=_envelopes(front, shown),
    )


def summary(
    front: ParetoFront, kept: Sequence[Promise] = (), shown: Envelopes | None = None
) -> str:
    """Return the findings as one paragraph."""
    designs, count = front.designs, len(front.objectives)
    if not count:
        return f"None of {front.search.evaluations} designs meets all constraints."
    goals = listed([g.given.quantity for g in designs.objectives])
    text = f"{front.search.evaluations} designs give a front of {count} for {goals}."
    parts = []
    number = front.chosen.get(COMPROMISE, next(iter(front.chosen.values())))
    for goal, value, nominal in zip(
        designs.objectives, front.objectives[number], front.nominal_objectives, strict=True
    ):
        unit = goal.unit.label
        parts.append(
            f"{goal.given.quantity} {_text(value)} {unit} in place of {_text(nominal)} {unit}"
        )
    judged = [p.is_kept for p in kept if p.is_kept is not None]
    robust = (
        f" On fresh samples {sum(judged)} of {len(judged)} values of the chosen designs keep what "
        "they promised."
        if judged
        else ""
    )
    name = "The compromise" if COMPROMISE in front.chosen else "The best design"
    grown = "" if shown is None else _growth(shown, number)
    return f"{text} {name} has {listed(parts)} of the machine itself.{grown}{robust}"


def _growth(shown: Envelopes, number: int) -> str:
    """Return a sentence about the amplitudes that are larger in a design than in the machine."""
    before, after = (
        MM_PER_M * np.nanmax(values, axis=-1) for values in (shown.nominal, shown.designs[number])
    )
    grown = [
        f"{sensor} from {_text(old)} to {_text(new)} mm"
        for sensor, old, new in zip(shown.sensors, before, after, strict=True)
        if new > old and _text(old) != _text(new)
    ]
    return f" It increases amplitudes: {listed(grown)}." if grown else ""


def _text(value: float) -> str:
    return significant(float(value)) if np.isfinite(value) else MISSING


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
    return {
        "rows": _rows(front),
        "picked": first_picked(front),
        "pairs": pairs_of(front),
        "objectives": front.objectives,
        "envelopes": np.round(MM_PER_M * shown.designs, 2),
        "labels": {"picked": PICKED, "designs": DESIGNS},
    }


def _rows(front: ParetoFront) -> list[list[tuple[str, str, str]]]:
    """Return kind, name and value of each number of each design, for the picked one."""
    entries = []
    for number in range(len(front.objectives)):
        objectives, constraints = front.goals(number)
        rows = [
            ("objective", g.given.quantity, f"{_text(value)} {g.unit.label}")
            for g, value in objectives
        ]
        for goal, value in constraints:
            unit = goal.unit.label
            side = "at most" if goal.is_small_better else "at least"
            margin = abs(value - goal.limit)
            text = f"{_text(value)} {unit}, {side} {_text(goal.limit)} {unit}"
            text += f": margin {_text(margin)} {unit}"
            rows.append(("constraint", goal.given.quantity, text))
        for name, place, unit in front.variables(number):
            shown = place if isinstance(place, str) else _text(place)
            rows.append(("variable", name, f"{shown} {unit.replace('*', ' ')}"))
        entries.append(rows)
    return entries


def _chosen(front: ParetoFront) -> Table:
    rows = _rows(front)
    groups = [line("design", ["", *(f"{number + 1}" for number in front.chosen.values())])]
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
        cells: list[Value] = [f"{p.goal.given.quantity}, {p.goal.given.over}", p.goal.unit.label]
        cells += [with_interval(v.value, v.lower, v.upper) for v in (p.promised, p.fresh)]
        groups.append(line(p.design, [*cells, p.is_kept], "alarm" if p.is_kept is False else ""))
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


def front_table(front: ParetoFront) -> pd.DataFrame:
    """Return objectives, constraints and variables of each design of the front."""
    rows = []
    for number in range(len(front.objectives)):
        objectives, constraints = front.goals(number)
        row: dict[str, Any] = {"design": number + 1}
        row |= {goal.key: value for goal, value in objectives}
        row |= {f"{goal.key} (limit)": value for goal, value in constraints}
        for name, value, unit in front.variables(number):
            row[f"{name} [{unit}]" if unit else name] = value
        rows.append(row)
    return pd.DataFrame(rows)


def history_table(front: ParetoFront) -> pd.DataFrame:
    """Return the hypervolume after each generation."""
    return pd.DataFrame(front.search.history, columns=["evaluations", "hypervolume"])


def machine_file_name(name: str) -> str:
    """Return the name of the machine file of a chosen design."""
    return f"machine_{name.replace(' ', '_')}.yaml"


def promises_table(kept: Sequence[Promise]) -> pd.DataFrame:
    """Return the check of a robust front on fresh samples."""
    return pd.DataFrame(
        {
            "design": p.design,
            "quantity": p.goal.key,
            "over": p.goal.given.over,
            **{f"promised_{name}": value for name, value in vars(p.promised).items()},
            **{f"fresh_{name}": value for name, value in vars(p.fresh).items()},
            "kept": p.is_kept,
        }
        for p in kept
    )


def designs_as_json(front: ParetoFront) -> list[dict[str, Any]]:
    """Return objectives, constraints and variables of each design of the front."""
    entries = []
    for number in range(len(front.objectives)):
        objectives, constraints = front.goals(number)
        entries.append(
            {
                "objectives": {goal.key: value for goal, value in objectives},
                "constraints": {goal.key: value for goal, value in constraints},
                "variables": {
                    name: {"value": value, "unit": unit} if unit else value
                    for name, value, unit in front.variables(number)
                },
            }
        )
    return entries
