"""Published results of a gasket study: means, contributions and effects from CSV files."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import pandas as pd

from wm_drake.errors import input_error
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.units import comma_hint

COLUMNS = ["load", "response", "term", "percent", "effects"]

CONSTANT = "constant"
"""Term whose only effect is the grand mean of the response."""


MOST_FACTORS = 2
"""Largest number of factors of a term: the models of the study have main effects and pairs."""


@dataclass(frozen=True)
class PublishedTerm:
    """Published numbers of a term.

    Attributes:
        percent: Contribution to the variance; None if it was not published. [%]
        effects: Grand mean of the constant, else the effects at the levels -1, 0, 1; 3^k numbers
            for k factors, the level of the first factor changes slowest. Empty if they were not
            published. [unit of the response]
    """

    percent: float | None
    effects: tuple[float, ...]


PublishedResults: TypeAlias = dict[tuple[str, str], dict[str, PublishedTerm]]
"""By load and response: the published terms by name; factors are joined by a colon."""


def published_results(paths: Sequence[str], key: str = "published") -> PublishedResults:
    """Read the published results of a gasket study.

    A file has the columns load, response, term, percent and effects. The term `constant` has the
    grand mean as its effect. Effects are separated by spaces. They are given at the levels -1, 0
    and 1, or at -1 and 0 only, as in [B] Table 5; effects sum to zero, so the others follow.

    Args:
        paths: The CSV files.
        key: Key path for messages.

    Raises:
        InputError: a file is missing or has other columns, a value is not a number, the number of
            effects does not fit the term, or a term is given twice.
    """
    found: PublishedResults = {}
    for path in paths:
        table = read_csv(path, COLUMNS, key=key)
        for number, row in enumerate(table.to_dict("records"), start=1):
            load, response, term = (_word(row, name, number, path, key) for name in COLUMNS[:3])
            terms = found.setdefault((load, response), {})
            if term in terms:
                message = f"row {number} of the data: {load}, {response}, {term} is given twice"
                raise input_error(message, where=path, key=key)
            terms[term] = _term(term, row, number, path, key)
    return found


def _word(row: dict[Any, Any], column: str, number: int, path: str, key: str) -> str:
    text = "" if pd.isna(row[column]) else str(row[column]).strip()
    if not text:
        message = f"row {number} of the data: the column {column} is empty"
        raise input_error(message, where=path, key=key)
    return text


def _term(term: str, row: dict[Any, Any], number: int, path: str, key: str) -> PublishedTerm:
    percents = _numbers(row, "percent", number, path, key)
    effects = _numbers(row, "effects", number, path, key)
    if _order(term) > MOST_FACTORS:
        message = f"row {number} of the data: a term has at most {MOST_FACTORS} factors"
        raise input_error(message, where=path, key=key)
    allowed = {1} if term == CONSTANT else {0, 2 ** _order(term), 3 ** _order(term)}
    if len(percents) > 1 or len(effects) not in allowed:
        texts = " or ".join(str(n) for n in sorted(allowed) if n)
        message = (
            f"row {number} of the data: {term} has {len(percents)} percentages and "
            f"{len(effects)} effects; allowed are one percentage and {texts} effects"
        )
        raise input_error(message, where=path, key=key)
    if term != CONSTANT and len(effects) == 2 ** _order(term):
        effects = _completed(effects)
    return PublishedTerm(percents[0] if percents else None, effects)


def _order(term: str) -> int:
    return term.count(":") + 1


def _numbers(
    row: dict[Any, Any], column: str, number: int, path: str, key: str
) -> tuple[float, ...]:
    texts = "" if pd.isna(row[column]) else str(row[column])
    found = []
    for text in texts.split():
        try:
            value = float(text) if text.isascii() and "_" not in text else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            message = (
                f"row {number} of the data: {column}: '{text}' is not a finite number"
                f"{comma_hint(text)}"
            )
            raise input_error(message, where=path, key=key)
        found.append(value)
    return tuple(found)


def _completed(effects: tuple[float, ...]) -> tuple[float, ...]:
    """Return effects at three levels of each factor from those at the levels -1 and 0.

    The effects sum to zero over the levels of each factor.
    """
    if len(effects) == 1:
        return effects
    half = len(effects) // 2
    low, middle = (_completed(effects[part]) for part in (slice(0, half), slice(half, None)))
    high = tuple(-(a + b) for a, b in zip(low, middle, strict=True))
    return (*low, *middle, *high)
