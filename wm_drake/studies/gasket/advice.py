"""Advice of a gasket study: what to do with each factor, and the proposed setting with its runs."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import MISSING, listed, percent
from wm_drake.report.table import Column, Group, Row, Table, table_of
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.doe.coding import LEVELS
from wm_drake.studies.gasket.proposal import MOST_LOSS, Compared, Proposal, ProposedChange
from wm_drake.studies.gasket.screening import Screening, Words
from wm_drake.studies.gasket.tables import digits

ADVICE_PERCENT = 5.0
"""Smallest contribution to a response with which a factor counts in the advice."""

DIRECTIONS = {-1: "less", 0: "middle", 1: "more"}
"""Words for the level that is best."""

CAPTION = (
    "One factor at a time, averaged over the others. Gain and conflict: by how much the mean of a "
    "response is better there than at the worst value, for the load with the largest difference. "
    "Little influence: below 5 % of the variance of every response that has a goal; choose by cost."
)


@dataclass(frozen=True)
class _Wish:
    """A level of a factor that is best for a response.

    Attributes:
        load, response: Names of load and response.
        gain: Difference of the mean response between worst and best level. [unit of the response]
    """

    level: int
    load: str
    response: str
    gain: float


def _wishes(screening: Screening, words: Words, factor: str) -> list[_Wish]:
    """Return the levels of a factor that are best for the responses that it influences."""
    wishes = []
    for (load, name), table in screening.tables.items():
        goal = words.meaning(name).goal
        term = next(term for term in table.terms if term.factors == (factor,))
        if not goal or not term.percent >= ADVICE_PERCENT:
            continue
        effects = [term.effects[(level,)] for level in LEVELS]
        at = int(np.argmin(effects) if goal == "smaller" else np.argmax(effects))
        wishes.append(_Wish(LEVELS[at], load, name, max(effects) - min(effects)))
    return wishes


def _for_what(screening: Screening, wishes: Sequence[_Wish], level: int) -> str:
    """Return the responses for which a level is best, each with its largest gain.

    The load is named where another level is best for the same response with another load.
    """
    levels: dict[str, set[int]] = {}
    for wish in wishes:
        levels.setdefault(wish.response, set()).add(wish.level)
    gains: dict[tuple[str, str], float] = {}
    for wish in wishes:
        if wish.level == level:
            load = f", load {wish.load}" if len(levels[wish.response]) > 1 else ""
            key = wish.response, load
            gains[key] = max(gains.get(key, 0.0), wish.gain)
    return listed(
        [
            f"{name}{load} [{digits(gain)} {screening.responses.units[name]}]"
            for (name, load), gain in gains.items()
        ]
    )


def advice(
    factors: Sequence[FactorLevels], screening: Screening, words: Words, compared: Compared
) -> Table:
    """Return what to do: for each factor key, direction, gain, conflict and proposed value."""
    proposal = compared.proposal
    proposed = {c.factor.name: c.text for c in proposal.changes} if proposal else {}
    groups = []
    for factor in [f for f in factors if f.name in screening.design.factors]:
        wishes = _wishes(screening, words, factor.name)
        counts = Counter(wish.level for wish in wishes)
        levels = sorted(counts, key=lambda x: (-counts[x], x))
        cells = [MISSING, "little influence", ""]
        if wishes:
            first, *others = levels
            cells = [
                _direction(words, factor.name, first),
                _for_what(screening, wishes, first),
                "; ".join(
                    f"{_direction(words, factor.name, x)} for {_for_what(screening, wishes, x)}"
                    for x in others
                ),
            ]
        keys = ", ".join(factor.numbers)
        last = proposed.get(factor.name, "as it is") if proposal else MISSING
        groups.append(Group(words.factor(factor.name), (Row((keys, *cells, last)),)))
    columns = ("factor", "key", Column("best value"), "gain", "conflict", "proposed")
    return Table(CAPTION, columns, tuple(groups), text_columns=6)


def _direction(words: Words, factor: str, level: int) -> str:
    return f"{DIRECTIONS[level]}: {words.value(factor, level)}"


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


def _change_text(change: ProposedChange, words: Words) -> str:
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
    changes = listed([_change_text(change, words) for change in proposal.changes])
    opening = f"Proposed setting: {changes}."
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
