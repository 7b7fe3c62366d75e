"""The answer of a gasket study: one proposed setting, what its runs gave, what it costs."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MISSING, listed, percent
from wm_drake.report.table import Column, Table, table_of
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.gasket.proposal import MOST_LOSS, Change, Proposal
from wm_drake.studies.gasket.screening import Screening
from wm_drake.studies.gasket.tables import digits
from wm_drake.studies.gasket.words import Words

LINE = "Line to copy"
"""Words before the command that runs the proposed setting."""

OTHER_GOALS = (
    "The proposal is about all factors and loads together, with limits for all responses. The "
    "table 'What to do' is about one factor at a time, and 'Best setting' below about the goals "
    "that you choose there, so that the three may differ for a factor."
)
"""Why the parts of the page that give advice may differ."""

LEAST_COST = 0.01
"""Rise of a response, as a share, from which it is named as a cost."""

COST_COLUMNS = ("response", "before", "after", "unit", "rise")
"""Columns of the table of costs."""

MOST_COSTS = 3
"""Largest number of costs that are named."""


def setting_text(proposal: Proposal, words: Words) -> str:
    """Return the proposed setting in words."""
    return listed([_change_text(change, words) for change in proposal.changes])


def _change_text(change: Change, words: Words) -> str:
    nominal = next(iter(change.factor.nominal.values()))
    if change.text.endswith("%"):
        return f"{words.factor(change.factor.name)} {change.text} of its table"
    before = f" in place of {nominal}" if nominal else ""
    return f"{words.factor(change.factor.name)} {change.text.replace('*', ' ')}{before}"


def answer(proposal: Proposal, words: Words) -> str:
    """Return the answer in a few sentences."""
    before = proposal.gaps("before")
    name = "the machine" if proposal.is_machine else "level 0"
    if not proposal.changes:
        gap = f" Its smallest gap is {_smallest(before)}." if before else ""
        return (
            f"No setting of these factors is clearly better than {name} without raising another "
            f"response by more than {100 * MOST_LOSS:g} %.{gap}"
        )
    opening = f"Proposed setting: {setting_text(proposal, words)}."
    after = proposal.gaps("after")
    if not after or not before:
        return f"{opening} The table below has its responses by runs."
    if not np.isfinite(list(after.values())).all():
        return f"{opening} A run with it failed: do not use it."
    if min(after.values()) <= min(before.values()):
        return (
            f"{opening} Its runs do not confirm a larger gap: {_smallest(after)}, {name} has "
            f"{_smallest(before)}. Use more trials."
        )
    touches = " The tub still touches the housing." if min(after.values()) <= 0.0 else ""
    return (
        f"{opening} Verified by runs: with it the smallest gap between tub and housing is "
        f"{_smallest(after)}; {name} has {_smallest(before)}.{touches}"
    )


def _smallest(gaps: Mapping[str, float]) -> str:
    load = min(gaps, key=lambda name: gaps[name])
    return f"{digits(gaps[load])} mm (load {load})"


def in_short(proposal: Proposal, screening: Screening, words: Words) -> list[tuple[str, str]]:
    """Return the facts below the answer: keys, gaps, costs, line to copy, loads."""
    facts: list[tuple[str, str]] = []
    if proposal.changes:
        keys = "; ".join(
            f"{change.factor.name}: {', '.join(change.factor.numbers)}"
            for change in proposal.changes
        )
        facts.append(("What changes", keys))
    facts.append(("Gap by load", gaps_text(proposal)))
    if proposal.changes:
        facts += [
            ("What it costs", _costs(proposal, screening, words)),
            ("Verified by runs", _verified(proposal)),
        ]
    if proposal.command:
        facts.append((LINE, proposal.command))
    facts.append(("Loads", _loads(proposal)))
    return [(word, text) for word, text in facts if text]


def gaps_text(proposal: Proposal) -> str:
    """Return the smallest gap of each load, before and after; "" without a gap."""
    before = proposal.gaps("before")
    after = proposal.gaps("after") if proposal.changes else {}
    texts = [
        f"{load} {digits(gap)}" + (f" → {digits(after[load])}" if after else "")
        for load, gap in before.items()
    ]
    return f"{'; '.join(texts)} (mm, each a run)" if texts else ""


def _costs(proposal: Proposal, screening: Screening, words: Words) -> str:
    """Return the responses that rise most, worst load each."""
    table = proposal.worst(screening)
    table = table[table["response"] != GAP]
    rise = (table["after"] - table["before"]) / table["before"].abs()
    costs = table.assign(rise=rise)[rise > LEAST_COST].sort_values("rise", ascending=False)
    if costs.empty:
        return f"no other response of the worst load rises by more than {100 * LEAST_COST:g} %"
    return listed(
        [
            f"{words.response(name)} {digits(before)} → {digits(after)} {unit} "
            f"({percent(100 * share)})"
            for name, before, after, unit, share in zip(
                *(costs.head(MOST_COSTS)[c] for c in COST_COLUMNS), strict=True
            )
        ]
    )


def _verified(proposal: Proposal) -> str:
    table = proposal.check.frame()
    known = table[table["predicted"].notna()]
    count, loads = len(proposal.check.settings) * len(proposal.loads), len(proposal.loads)
    return (
        f"{count} runs, {loads} loads; {int(known['is_inside'].sum())} of {len(known)} responses "
        "lie inside the 95 % interval of the fitted model"
    )


def _loads(proposal: Proposal) -> str:
    """Return which loads the study has and which it leaves out."""
    if not proposal.left_out:
        return f"{listed(proposal.loads)}: all loads of the machine"
    return (
        f"{listed(list(proposal.studied))}; left out of the study, but in the runs of the "
        f"proposal: {listed(proposal.left_out)}"
    )


def before_and_after(proposal: Proposal, screening: Screening, words: Words) -> Table:
    """Return each response of the worst load: before, predicted, by runs."""
    frame = proposal.worst(screening)
    interval = "half_width" in frame
    shown = pd.DataFrame(
        {
            "response": [words.response(name) for name in frame["response"]],
            "unit": frame["unit"],
            "before": frame["before"],
        }
    )
    if interval:
        shown["predicted"] = [
            f"{digits(p)} ± {digits(h)}" if p == p else MISSING
            for p, h in zip(frame["predicted"], frame["half_width"], strict=True)
        ]
        shown["after"] = frame["after"]
        shown["change"] = 100.0 * (frame["after"] - frame["before"]) / frame["before"].abs()
        shown["load"] = frame["load_after"]
    columns = {
        "before": Column("before, by a run", form=digits),
        "predicted": Column("predicted, 95 % interval"),
        "after": Column("after, by a run", form=digits),
        "change": Column("change", form=percent),
        "load": Column("load"),
    }
    caption = (
        "Responses of the worst load, before and with the proposed setting. D, F and M are the "
        "largest absolute displacement of the tub, force and moment of the gasket over the run; "
        "seen from the door, x points right, y along the drum axis to the rear, z up."
    )
    return table_of(shown, caption, columns)
