"""Free files: the quantities that a calibration may change, with their bounds and priors."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from wm_drake.errors import nearest_names
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.machine import Name


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


def _measured(text: Any) -> Any:
    if isinstance(text, int | float) and not isinstance(text, bool):
        text = repr(text)
    if not isinstance(text, str):
        raise ValueError("is not a number or a list of numbers with a unit, such as '12 kg'")
    magnitudes, unit, is_list = u.split(text)
    return {
        "values": tuple(u.to_base(number, unit) for number in magnitudes),
        "unit": unit,
        "is_list": is_list,
    }


def _pair(text: Any) -> Any:
    numbers = _measured(text)
    if len(numbers["values"]) != 2:
        raise ValueError(f"'{text}' is not two numbers with a unit; write for example '(9, 12) kg'")
    return numbers


def _one_key(value: Any) -> Any:
    return {value: "1"} if isinstance(value, str) else value


_Pair = Annotated[Measured, BeforeValidator(_pair)]


class FreeQuantity(Frozen):
    """One number that a calibration may change.

    Attributes:
        bounds: Smallest and largest allowed value.
        prior: Expected value and standard deviation before any measurement of the machine.
        sets: Factors by key path of the machine's values that depend on this quantity. Such a value
            is the sum of factor times quantity over all quantities that list it. A factor may have
            a unit, and it may be a list with one number for each point of a table.
        source: Reason for the bounds and the prior.
        start: Start value of searches; None for the expected value.
    """

    bounds: _Pair
    prior: _Pair
    sets: Annotated[
        dict[str, Annotated[Measured, BeforeValidator(_measured)]],
        BeforeValidator(_one_key),
        Field(min_length=1),
    ]
    source: str
    start: Annotated[Measured, BeforeValidator(_measured)] | None = None

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
        if not self.prior.values[1] > 0.0:
            raise ValueError("the standard deviation must be above 0")
        if self.start is not None:
            if self.start.is_list or u.dimension(self.start.unit) != u.dimension(self.unit):
                raise ValueError(
                    f"the start is not one number with a unit such as {self.unit or 'none'}"
                )
            if not lower <= self.start.values[0] <= upper:
                raise ValueError("the start is outside the bounds")
        return self


class KnownQuantity(Frozen):
    """One number that a calibration does not change, in the form of a free quantity.

    Attributes:
        value: The value.
        sets: As in `FreeQuantity`.
        source: Reason for the value.
    """

    value: Annotated[Measured, BeforeValidator(_measured)]
    sets: Annotated[
        dict[str, Annotated[Measured, BeforeValidator(_measured)]],
        BeforeValidator(_one_key),
        Field(min_length=1),
    ]
    source: str

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

    prior: _Pair
    source: str

    @model_validator(mode="after")
    def _force(self) -> "ExpectedPreload":
        _check_pair(self.prior, "a preload", "N")
        return self


def _check_pair(pair: Measured, what: str, unit: str) -> None:
    if u.dimension(pair.unit) != u.dimension(unit):
        raise ValueError(
            f"the numbers are in {pair.unit or 'pure numbers'}; {what} needs a unit such as {unit}"
        )
    if not pair.values[1] > 0.0:
        raise ValueError("the standard deviation must be above 0")


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
    to: Annotated[dict[Name, Annotated[Measured, BeforeValidator(_measured)]], Field(min_length=1)]
    prior: _Pair | None = None
    at_most: _Pair | None = None
    source: str

    @model_validator(mode="after")
    def _one_of_two(self) -> "Relation":
        if (self.prior is None) == (self.at_most is None):
            raise ValueError("needs either 'prior' or 'at_most'")
        pair = self.prior or self.at_most
        assert pair is not None
        if u.dimension(pair.unit) != u.dimension(""):
            raise ValueError(f"the ratio is in {pair.unit}; it is a pure number")
        if not pair.values[1] > 0.0:
            raise ValueError("the standard deviation must be above 0")
        return self


class LeastElongation(Frozen):
    """Smallest elongation of a spring from its free length, over all runs with measured amplitudes.

    A spring that hangs in hooks goes slack at zero.

    Attributes:
        at_least: The elongation, and the standard deviation by which it may be missed.
        source: Reason.
    """

    at_least: _Pair
    source: str

    @model_validator(mode="after")
    def _length(self) -> "LeastElongation":
        _check_pair(self.at_least, "an elongation", "mm")
        return self


class FreeFile(Frozen):
    """The free quantities of a calibration, by name, and what is known beside them.

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
    """Read a free file.

    Raises:
        InputError: the file is missing or wrong, with line and key path of each error.
    """
    return read_model(FreeFile, path)
