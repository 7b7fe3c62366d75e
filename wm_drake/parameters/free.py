"""Free files: the quantities that a calibration may change, with their bounds and priors."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from wm_drake.errors import nearest_names
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.types import Name


class Measured(Frozen):
    """One number or several numbers with a unit, such as ``12 kg`` or ``(-1, 0, 1) mm``.

    Attributes:
        values: Numbers in SI units.
        unit: Unit in which they are written.
        is_list: Whether there is more than one number.
    """

    values: tuple[float, ...]
    unit: str
    is_list: bool

    @property
    def pair(self) -> tuple[float, float]:
        """Both numbers of a pair."""
        first, second = self.values
        return first, second


def _measured(text: Any) -> Any:
    if isinstance(text, int | float) and not isinstance(text, bool):
        text = repr(text)
    if not isinstance(text, str):
        raise ValueError("is not a number or a list of numbers with a unit, such as '12 kg'")
    magnitudes, unit, is_list = u.split(text)
    values = tuple(u.to_base(number, unit) for number in magnitudes)
    return {"values": values, "unit": unit, "is_list": is_list}


def _pair(text: Any) -> Any:
    numbers = _measured(text)
    if len(numbers["values"]) != 2:
        raise ValueError(f"'{text}' is not two numbers with a unit; write for example '(9, 12) kg'")
    return numbers


def _one_key(value: Any) -> Any:
    return {value: "1"} if isinstance(value, str) else value


def _with_deviation(pair: Measured) -> Measured:
    if not pair.values[1] > 0.0:
        raise ValueError("the standard deviation must be above 0")
    return pair


def _in_dimension(unit: str, what: str) -> AfterValidator:
    def check(pair: Measured) -> Measured:
        if u.dimension(pair.unit) != u.dimension(unit):
            raise ValueError(f"the numbers are in {pair.unit or 'pure numbers'}; {what}")
        return pair

    return AfterValidator(check)


_Numbers = Annotated[Measured, BeforeValidator(_measured)]
_Pair = Annotated[Measured, BeforeValidator(_pair)]
_Expected = Annotated[_Pair, AfterValidator(_with_deviation)]
"""A value and its standard deviation."""
_Ratio = Annotated[_Expected, _in_dimension("", "the ratio is a pure number")]


class _Setting(Frozen):
    """A number on which values of the machine depend.

    Attributes:
        sets: Factors by key path of the machine's values that depend on this number. Such a value
            is the sum of factor times number over all numbers that list it. A factor may have a
            unit, and it may be a list with one number for each point of a table.
        source: Reason for what is said of the number.
    """

    sets: Annotated[dict[str, _Numbers], BeforeValidator(_one_key), Field(min_length=1)]
    source: str


class FreeQuantity(_Setting):
    """One number that a calibration may change: a variation with bounds and a prior.

    Attributes:
        bounds: Smallest and largest allowed value.
        prior: Expected value and standard deviation before any measurement of the machine.
        start: Start value of searches; None for the expected value.
    """

    bounds: _Pair
    prior: _Expected
    start: _Numbers | None = None

    @property
    def unit(self) -> str:
        """Unit in which the numbers are written and displayed."""
        return self.bounds.unit

    @model_validator(mode="after")
    def _in_order(self) -> "FreeQuantity":
        lower, upper = self.bounds.values
        if u.dimension(self.prior.unit) != u.dimension(self.unit):
            raise ValueError(
                f"the prior is in {self.prior.unit or 'pure numbers'}, "
                f"the bounds in {self.unit or 'pure numbers'}; both need one dimension"
            )
        if not lower < upper:
            raise ValueError("the lower bound must be below the upper bound")
        if not lower <= self.prior.values[0] <= upper:
            raise ValueError("the expected value is outside the bounds")
        if self.start is not None:
            if self.start.is_list or u.dimension(self.start.unit) != u.dimension(self.unit):
                raise ValueError(
                    f"the start is not one number with a unit such as {self.unit or 'none'}"
                )
            if not lower <= self.start.values[0] <= upper:
                raise ValueError("the start is outside the bounds")
        return self


class KnownQuantity(_Setting):
    """One number that a calibration does not change, in the form of a free quantity.

    Attributes:
        value: The value.
    """

    value: _Numbers

    @property
    def unit(self) -> str:
        """Unit in which the value is written and displayed."""
        return self.value.unit

    @model_validator(mode="after")
    def _one_number(self) -> "KnownQuantity":
        if self.value.is_list:
            raise ValueError("the value is a list; it must be one number with a unit")
        return self


class ExpectedPreload(Frozen):
    """Prior of the spring preloads.

    The preloads are not numbers of the machine file; they follow from the weight.

    Attributes:
        prior: Expected value and standard deviation, the same for each spring.
        source: Reason for the prior.
    """

    prior: Annotated[_Expected, _in_dimension("N", "a preload needs a unit such as N")]
    source: str


class Relation(Frozen):
    """What physics says about one free quantity when others are given.

    Example: a rubber ring of radius R, whose radial stiffness is K, has at most the torsional
    stiffness 2 K R^2.

    Attributes:
        quantity: Name of the quantity.
        to: Factors by name of other quantities. Their weighted sum is what the quantity is compared
            with; it has the dimension of the quantity.
        prior: Expected ratio of the quantity to the sum, and its standard deviation.
        at_most: Largest ratio, and the standard deviation by which it may be exceeded.
        source: Derivation.
    """

    quantity: Name
    to: Annotated[dict[Name, _Numbers], Field(min_length=1)]
    prior: _Ratio | None = None
    at_most: _Ratio | None = None
    source: str

    @model_validator(mode="after")
    def _one_of_two(self) -> "Relation":
        if (self.prior is None) == (self.at_most is None):
            raise ValueError("needs either 'prior' or 'at_most'")
        return self


class LeastElongation(Frozen):
    """Smallest elongation of a spring from its free length, over all runs with measured amplitudes.

    A spring that hangs in hooks goes slack at zero.

    Attributes:
        at_least: The elongation, and the standard deviation by which it may be missed.
        source: Reason.
    """

    at_least: Annotated[_Expected, _in_dimension("mm", "an elongation needs a unit such as mm")]
    source: str


class FreeFile(Frozen):
    """The free quantities of a calibration, by name, and what else is known.

    A known quantity becomes free, or a free one known, by moving its entry from one section to the
    other.
    """

    about: str = ""
    spring_preload: ExpectedPreload | None = None
    spring_elongation: LeastElongation | None = None
    relations: dict[Name, Relation] = Field(default_factory=dict)
    known: dict[Name, KnownQuantity] = Field(default_factory=dict)
    quantities: dict[Name, FreeQuantity] = Field(min_length=1)

    @model_validator(mode="after")
    def _one_section(self) -> "FreeFile":
        for name in self.known:
            if name in self.quantities:
                raise ValueError(f"'{name}' is both free and known; it may be one of them")
        return self

    @model_validator(mode="after")
    def _related_quantities(self) -> "FreeFile":
        for name, relation in self.relations.items():
            unit = self._unit(f"relations.{name}", relation.quantity)
            for other, factor in relation.to.items():
                product = u.dimension(self._unit(f"relations.{name}", other)) * u.dimension(
                    factor.unit
                )
                if factor.is_list or product != u.dimension(unit):
                    raise ValueError(
                        f"relations.{name}: {other} times its factor has not the dimension of "
                        f"{relation.quantity}"
                    )
        return self

    def _unit(self, where: str, name: str) -> str:
        if name not in self.quantities:
            raise ValueError(f"{where}: no quantity '{name}'{nearest_names(name, self.quantities)}")
        return self.quantities[name].unit

    def without_starts(self) -> "FreeFile":
        """Return a copy without start values, so that searches start at the expected values."""
        quantities = {
            name: quantity.model_copy(update={"start": None})
            for name, quantity in self.quantities.items()
        }
        return self.model_copy(update={"quantities": quantities})


def load_free(path: Path) -> FreeFile:
    """Read a free file."""
    return read_model(FreeFile, path)
