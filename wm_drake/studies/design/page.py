"""Show the design study: the front, on which a reader picks designs, and the chosen designs."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters import machine_yaml
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.page import as_json, fragment, picture
from wm_drake.report.quantity import SHARE, quantity_of, shown, text_of
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.design.figures import (
    DESIGNS,
    PICKED,
    envelopes_figure,
    first_picked,
    front_figure,
    history_figure,
    pairs_of,
)
from wm_drake.studies.design.problem import MachineDesigns
from wm_drake.studies.design.study import FRESH, PROPOSED, chosen_designs, design_proposal
from wm_drake.studies.proposal import MOST_LOSS
from wm_drake.studies.proposal_page import proposal_part


def design_answer(
    designs: MachineDesigns,
    front: xr.Dataset,
    robust: xr.Dataset,
    envelopes: xr.Dataset | None,
    about: str,
) -> Answer:
    """Return the answer of the study.

    Args:
        front, robust, envelopes: As of `run_designs`, `promises` and `front_envelopes` in
            `wm_drake.studies.design.study`; no envelopes without a front.
        about: Description in the vary file.
    """
    names = [*(goal.name for goal in designs.goals), *(d.name for d in designs.dimensions)]
    nominal = front[[f"nominal_{goal.name}" for goal in designs.objectives]]
    evaluations = text_of(front.evaluations[-1])
    picker = None if envelopes is None else partial(_picker, designs, front, envelopes)
    numbers: list[LabelledTable] = [
        LabelledTable("front", front[names]),
        LabelledTable("nominal", nominal),
    ]
    return Answer(
        f"Designs of machine {designs.parameters.name}",
        summary(designs, front, robust),
        designs.parameters,
        (
            Part("Front", numbers, body=picker),
            Part(
                "Search",
                (
                    _history(front),
                    LabelledTable("history", front[["evaluations", "hypervolume"]]),
                ),
            ),
            Part("Chosen designs", [_chosen(designs, front)] if picker else ()),
            Part("Robust designs on fresh samples", _promises(designs, robust)),
        ),
        (
            ("Designs", f"{evaluations}, each {designs.scenarios} runs"),
            ("Hypervolume", text_of(front.hypervolume[-1])),
        ),
        about,
        _machine_files(designs, front),
        () if picker else ("No design meets all constraints.",),
        None if envelopes is None else _short(designs, front, envelopes),
        script=Path(__file__).with_name("pick.js") if picker else None,
    )


def _machine_files(designs: MachineDesigns, front: xr.Dataset) -> dict[str, str]:
    """Return the machine files of chosen designs."""
    files = {}
    for name, number in chosen_designs(designs, front).items():
        machine = designs.machine_at(front.place.sel(design=number).values)
        about = f"Design '{name}' of a design study of machine {machine.name}"
        changes = {"name": f"{machine.name}, {name}", "about": about, "measured": ()}
        files[machine_file_name(name)] = machine_yaml(machine.model_copy(update=changes))
    return files


def machine_file_name(name: str) -> str:
    """Return the name of the machine file of a chosen design."""
    return f"machine_{name.replace(' ', '_')}.yaml"


def summary(designs: MachineDesigns, front: xr.Dataset, robust: xr.Dataset) -> str:
    """Return the answer: how many designs the front has, and whether they keep their promises."""
    evaluations = text_of(front.evaluations[-1])
    if not front.sizes["design"]:
        return f"None of {evaluations} designs meets all constraints."
    goals = listed([goal.given.quantity for goal in designs.objectives])
    return (
        f"{evaluations} designs give a front of {front.sizes['design']} for {goals}."
        f"{_kept_text(designs, robust)}"
    )


def _short(designs: MachineDesigns, front: xr.Dataset, envelopes: xr.Dataset) -> Part:
    """Return the part in short: the proposed design, why, and its costs."""
    is_made = PROPOSED in chosen_designs(designs, front)
    command = f"wm-drake spin --machine {machine_file_name(PROPOSED)}" if is_made else ""
    aim = "gap" if GAP in [goal.name for goal in designs.objectives] else "desirability"
    limit = f"no objective worse by more than {SHARE.text(MOST_LOSS)}"
    why = (
        f"Of the designs of the front that make {limit}, it has the largest {aim}."
        if is_made
        else f"No design of the front is clearly better and makes {limit}."
    )
    growth = _growth(envelopes, chosen_designs(designs, front)[PROPOSED]) if is_made else ""
    proposal = design_proposal(designs, front, command)
    return proposal_part(proposal, why, {}, [("Larger amplitudes", growth)])


def _kept_text(designs: MachineDesigns, robust: xr.Dataset) -> str:
    """Return a sentence on the promises of a robust front; "" without any."""
    names = [f"{goal.name}_kept" for goal in designs.goals]
    texts = [text for n in names if n in robust for text in robust[n].values.tolist() if text]
    if not texts:
        return ""
    return (
        f" On fresh samples {texts.count('yes')} of {len(texts)} values of the chosen designs keep "
        "what they promised."
    )


def _growth(envelopes: xr.Dataset, number: int) -> str:
    """Return the amplitudes that are larger in a design than in the machine; "" if none is."""
    grown = []
    for sensor in envelopes["sensor"].values.tolist():
        of_sensor = envelopes.sel(sensor=sensor)
        old, new = (
            one.max("time", keep_attrs=True)
            for one in (of_sensor.nominal, of_sensor.envelope.sel(design=number))
        )
        if new > old and text_of(old) != text_of(new):
            grown.append(f"{sensor} from {quantity_of(old).number(old)} to {text_of(new)}")
    return listed(grown) if grown else ""


def _picker(designs: MachineDesigns, front: xr.Dataset, envelopes: xr.Dataset) -> str:
    """Return the part of the page on which designs are picked."""
    of_front = picture(
        front_figure(designs, front),
        f"Front of {front.sizes['design']} designs.",
        "Each point is a design; no other design is better in every objective. The circle is the "
        "picked design; the cross is the machine itself.",
    )
    of_envelopes = picture(
        envelopes_figure(envelopes, first_picked(designs, front)),
        "Envelopes of the picked design at each sensor.",
        f"Largest envelope of the filtered displacements over time: {designs.shown}. Coloured: the "
        "picked design; grey: the machine itself.",
    )
    return fragment(
        Path(__file__).with_name("picked.html"),
        front=of_front if len(designs.objectives) > 1 else None,
        picked=as_json(_picked(designs, front, envelopes)),
        envelopes=of_envelopes,
    )


def _picked(designs: MachineDesigns, front: xr.Dataset, envelopes: xr.Dataset) -> dict[str, Any]:
    """Return the numbers of each design that the page needs to show it when it is picked."""
    objectives = np.column_stack([shown(front[goal.name]) for goal in designs.objectives])
    return {
        "rows": [_rows(designs, front.sel(design=number)) for number in front["design"].values],
        "picked": first_picked(designs, front) - 1,
        "pairs": pairs_of(designs),
        "objectives": objectives,
        "envelopes": np.round(shown(envelopes.envelope), 4),
        "labels": {"picked": PICKED, "designs": DESIGNS},
    }


def _rows(designs: MachineDesigns, one: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return kind, name and value of each number of a design."""
    rows = [
        ("objective", goal.given.quantity, text_of(one[goal.name])) for goal in designs.objectives
    ]
    for goal in designs.constraints:
        side = "at most" if goal.is_small_better else "at least"
        margin = goal.quantity.text(abs(one[goal.name] - goal.limit))
        limit = goal.quantity.text(goal.limit)
        text = f"{text_of(one[goal.name])}, {side} {limit}: margin {margin}"
        rows.append(("constraint", goal.given.quantity, text))
    variables = [("variable", d.name, d.text(one[d.name])) for d in designs.dimensions]
    return [*rows, *variables]


def _chosen(designs: MachineDesigns, front: xr.Dataset) -> LabelledTable:
    """Return the numbers of the chosen designs, a column for each."""
    chosen = chosen_designs(designs, front)
    rows = {name: _rows(designs, front.sel(design=number)) for name, number in chosen.items()}
    kinds, names, _ = zip(*next(iter(rows.values())), strict=True)
    columns = {
        name: ("row", [f"{chosen[name]}", *texts, machine_file_name(name)])
        for name, of_design in rows.items()
        for texts in [[text.split(", at")[0] for *_, text in of_design]]
    }
    return LabelledTable(
        "chosen",
        xr.Dataset(
            {
                "name": ("row", ["design", *names, "machine file"]),
                "kind": ("row", ["", *kinds, ""]),
                **columns,
            }
        ),
        "Chosen designs of the front",
        "Chosen designs. Each has a machine file for --machine.",
        is_in_terminal=True,
    )


def _promises(designs: MachineDesigns, robust: xr.Dataset) -> list[LabelledTable]:
    """Return what the chosen designs of a robust front promised and keep on fresh samples."""
    return [
        LabelledTable(
            f"robust_{goal.name}",
            robust[
                [f"{goal.name}{end}" for end in ("", "_lower", "_upper", "_kept", "_is_broken")]
            ],
            f"{goal.given.quantity} on fresh samples",
            f"{goal.given.quantity}, {goal.given.over}, of the chosen designs on {FRESH} times as "
            "many fresh samples, with 95 % intervals. A promise is kept if the fresh value is not "
            "worse than the worse end of its interval. The worst of the samples has no interval: "
            "it grows with their number.",
            across="samples",
            marked=(f"{goal.name}_is_broken", "alarm"),
        )
        for goal in designs.goals
        if goal.name in robust
    ]


def _history(front: xr.Dataset) -> Plot:
    return Plot(
        history_figure(front),
        "Hypervolume over the number of evaluated designs.",
        "Hypervolume of the front after each generation. Objectives are scaled so that the first "
        "population reaches from 0 to 1. A level curve means that more evaluations find little.",
    )
