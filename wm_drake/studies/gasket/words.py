"""Names and values of factors, terms and responses for reading."""

from collections.abc import Sequence

import xarray as xr

from wm_drake.parameters.varying import Varied
from wm_drake.report.quantity import Quantity, each_of
from wm_drake.studies.doe.coding import LEVELS


class Words:
    """Names, physical values and units for reading."""

    def __init__(self, factors: Sequence[Varied], screening: xr.Dataset) -> None:
        """Store the words.

        Args:
            factors: Levels of the factors.
            screening: As of `screening.run_screening`.
        """
        self._factors = {factor.name: factor for factor in factors}
        self._responses = each_of(screening.value)
        self._terms = screening.term.values.tolist()

    def factor(self, name: str) -> str:
        """Return a factor for reading, such as `linear damping C_L`."""
        about = self._factors[name].entry.about if name in self._factors else ""
        return f"{about.split(',')[0]} {name}" if about else name

    def term(self, name: str) -> str:
        """Return a term for reading: its factors, joined by a multiplication sign."""
        return " × ".join(map(self.factor, name.split(":")))

    def quantity(self, factor: str) -> Quantity:
        """Return what a factor is, by its first key."""
        return Quantity(self.factor(factor), self._factors[factor].first_unit)

    def numbers(self, factor: str) -> tuple[float, ...]:
        """Return the physical values of the levels, of its first number. [SI]"""
        return self._factors[factor].first_levels

    def number(self, factor: str, level: int) -> str:
        """Return the physical value of a level, without unit."""
        return self.quantity(factor).number(self.numbers(factor)[level + 1])

    def value(self, factor: str, level: int) -> str:
        """Return the physical value of a level with its unit."""
        return self.quantity(factor).text(self.numbers(factor)[level + 1])

    def values(self, factor: str) -> str:
        """Return the physical values of all levels with the unit."""
        *others, last = LEVELS
        return ", ".join([*(self.number(factor, n) for n in others), self.value(factor, last)])

    def span(self, factor: str) -> str:
        """Return the lowest and the highest value of a factor with the unit."""
        return f"{self.number(factor, LEVELS[0])} to {self.value(factor, LEVELS[-1])}"

    def axis(self, factor: str) -> str:
        """Return the label of an axis of a factor: name, symbol, unit."""
        return self.quantity(factor).label

    def response(self, name: str) -> str:
        """Return a response for reading, such as `displacement x (Dx)`."""
        title = self._responses[name].words
        is_in_name = title.replace(" ", "_") == name or name in title.split()
        return title if is_in_name else f"{title} ({name})"

    def response_axis(self, name: str) -> str:
        """Return the label of an axis of a response: name, symbol, unit."""
        return self._responses[name].named(self.response(name)).label

    def labels(self) -> dict[str, str]:
        """Return the words of all responses and terms, for the labels of tables."""
        responses = {name: self.response(name) for name in self._responses}
        return responses | {term: self.term(term) for term in self._terms}
