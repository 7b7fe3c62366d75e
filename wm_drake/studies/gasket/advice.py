"""What to do with each factor: the table of the page, made from the effects of the study."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import MISSING, listed
from wm_drake.report.table import Column, Group, Row, Table
from wm_drake.studies.gasket.compared import Compared
from wm_drake.studies.gasket.screening import Screening
from wm_drake.studies.gasket.tables import digits
from wm_drake.studies.gasket.words import LEVELS, Words

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
        levels = sorted({wish.level for wish in wishes}, key=lambda x: (-_count(wishes, x), x))
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


def _count(wishes: Sequence[_Wish], level: int) -> int:
    """Return how many responses and loads a level is best for."""
    return sum(wish.level == level for wish in wishes)


def _direction(words: Words, factor: str, level: int) -> str:
    return f"{DIRECTIONS[level]}: {words.value(factor, level)}"
