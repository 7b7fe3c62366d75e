"""Words for the factors, levels and responses of a gasket study: name first, then symbol."""

from collections.abc import Mapping, Sequence

from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import significant
from wm_drake.studies.gasket.screening import Meaning

LEVELS = (-1, 0, 1)


class Words:
    """Names, physical values and units for reading."""

    def __init__(self, factors: Sequence[FactorLevels], meanings: Mapping[str, Meaning]) -> None:
        """Store the words."""
        self._factors = {factor.name: factor for factor in factors}
        self._meanings = meanings

    def factor(self, name: str) -> str:
        """Return a factor for reading, such as `linear damping C_L`."""
        about = self._factors[name].about if name in self._factors else ""
        return f"{about.split(',')[0]} {name}" if about else name

    def term(self, name: str) -> str:
        """Return a term for reading: its factors, joined by a multiplication sign."""
        return " × ".join(map(self.factor, name.split(":")))

    def unit(self, factor: str) -> str:
        """Return the unit of a factor's levels; "" if it has none."""
        return next(iter(self._factors[factor].units.values()), "")

    def number(self, factor: str, level: int) -> str:
        """Return the physical value of a level, without unit."""
        numbers = next(iter(self._factors[factor].numbers.values()))
        return significant(numbers[level + 1])

    def value(self, factor: str, level: int) -> str:
        """Return the physical value of a level with its unit."""
        return f"{self.number(factor, level)} {self.unit(factor)}".strip()

    def span(self, factor: str) -> str:
        """Return the lowest and the highest value of a factor with the unit."""
        return f"{self.number(factor, -1)} to {self.value(factor, 1)}"

    def axis(self, factor: str) -> str:
        """Return the label of an axis of a factor: name, symbol, unit."""
        return ", ".join(filter(None, (self.factor(factor), self.unit(factor))))

    def meaning(self, response: str) -> Meaning:
        """Return the meaning of a response; one without words has its name as title and kind."""
        return self._meanings.get(response) or Meaning(response, kind=response, goal="")

    def response(self, name: str) -> str:
        """Return a response for reading, such as `displacement x (Dx)`."""
        title = self.meaning(name).title
        is_in_name = title.replace(" ", "_") == name or name in title.split()
        return title if is_in_name else f"{title} ({name})"
