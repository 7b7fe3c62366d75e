"""Free files: the quantities that a calibration may change, with their bounds and priors."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

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
        if u.dimension(self.prior.unit) != u.dimension("N"):
            raise ValueError(
                f"the prior is in {self.prior.unit or 'pure numbers'}; a preload needs a unit of "
                "force such as N"
            )
        if not self.prior.values[1] > 0.0:
            raise ValueError("the standard deviation must be above 0")
        return self


class FreeFile(Frozen):
    """The free quantities of a calibration, by name, and the prior of the spring preloads."""

    about: str = ""
    spring_preload: ExpectedPreload | None = None
    quantities: dict[Name, FreeQuantity] = Field(min_length=1)

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
