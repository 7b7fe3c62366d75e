"""Published results of a gasket study: means, contributions and effects from CSV files."""

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from wm_drake.errors import InputError, input_error
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.units import comma_hint, plain_number

COLUMNS = ["load", "response", "term", "percent", "effects"]

CONSTANT = "constant"
"""Term whose only effect is the grand mean of the response."""

RANGE = "range"
"""Term whose two effects are the smallest and the largest value of the response."""

MAIN, INTERACTIONS = "main effects", "interactions"
"""Terms whose percentages are those of all main effects and of all interactions."""

OF_RESPONSE = (CONSTANT, RANGE, MAIN, INTERACTIONS)
"""Terms that belong to a response as a whole, not to a term of the model."""


NUMBER_OF_EFFECTS = {CONSTANT: {1}, RANGE: {2}, MAIN: {0}, INTERACTIONS: {0}}
"""Allowed numbers of effects of the terms that are no factors."""

MOST_FACTORS = 2
"""Largest number of factors of a term: the models of the study have main effects and pairs."""


@dataclass(frozen=True)
class PublishedTerm:
    """Published numbers of a term.

    Attributes:
        percent: Contribution to the variance; None if it was not published. [%]
        effects: Grand mean of the constant, smallest and largest value of the range, else the
            effects at the levels -1, 0, 1; 3^k numbers for k factors, the level of the first
            factor changes slowest. Empty if they were not published. [unit of the response]
    """

    percent: float | None
    effects: tuple[float, ...]


PublishedResults: TypeAlias = dict[tuple[str, str], dict[str, PublishedTerm]]
"""By load and response: the published terms by name; factors are joined by a colon."""


def published_results(paths: Sequence[str], key: str = "published") -> PublishedResults:
    """Read the published results of a gasket study.

    A file has the columns load, response, term, percent and effects. The term `constant` has the
    grand mean as its effect, `range` the smallest and the largest value; `main effects` and
    `interactions` have the percentages of all of them together. Effects are separated by spaces.
    They are given at the levels -1, 0 and 1, or at -1 and 0 only, as in [B] Table 5; effects sum
    to zero, so the others follow.

    Raises:
        InputError: a file is missing or has other columns, a value is not a number, the number of
            effects does not fit the term, or a term is given twice.
    """
    results: PublishedResults = {}
    for path in paths:
        for number, cells in enumerate(read_csv(path, COLUMNS, key=key).to_dict("records"), 1):
            row = _Row(cells, number, path, key)
            load, response, term = map(row.word, COLUMNS[:3])
            terms = results.setdefault((load, response), {})
            if term in terms:
                raise row.error(f"{load}, {response}, {term} is given twice")
            terms[term] = _term(term, row)
    return results


@dataclass(frozen=True)
class _Row:
    """A row of a file.

    Attributes:
        cells: Values by column.
        number: Number of the row, from 1 on.
        key: Key path for messages.
    """

    cells: Mapping[Hashable, Any]
    number: int
    path: str
    key: str

    def error(self, message: str) -> InputError:
        """Return the error of this row."""
        text = f"row {self.number} of the data: {message}"
        return input_error(text, where=self.path, key=self.key)

    def text(self, column: str) -> str:
        """Return the text of a cell, which may be empty."""
        return str(self.cells[column])

    def word(self, column: str) -> str:
        """Return the text of a cell that must not be empty."""
        if not self.text(column):
            raise self.error(f"the column {column} is empty")
        return self.text(column)

    def numbers(self, column: str) -> tuple[float, ...]:
        """Return the finite numbers of a cell, separated by spaces."""
        numbers = []
        for text in self.text(column).split():
            try:
                numbers.append(plain_number(text))
            except ValueError:
                numbers.append(math.nan)
            if not math.isfinite(numbers[-1]):
                raise self.error(f"{column}: '{text}' is not a finite number{comma_hint(text)}")
        return tuple(numbers)


def _term(term: str, row: _Row) -> PublishedTerm:
    percents, effects = row.numbers("percent"), row.numbers("effects")
    order = term.count(":") + 1
    if order > MOST_FACTORS:
        raise row.error(f"a term has at most {MOST_FACTORS} factors")
    allowed = NUMBER_OF_EFFECTS.get(term, {0, 2**order, 3**order})
    if len(percents) > 1 or len(effects) not in allowed:
        texts = " or ".join(str(n) for n in sorted(allowed) if n) or "no"
        raise row.error(
            f"{term} has {len(percents)} percentages and {len(effects)} effects; allowed are one "
            f"percentage and {texts} effects"
        )
    if term not in OF_RESPONSE and len(effects) == 2**order:
        effects = _completed(effects)
    return PublishedTerm(percents[0] if percents else None, effects)


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
