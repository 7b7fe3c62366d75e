"""Numbers of a machine file by name, in the packed numbers of an element.

Names and units follow from the layout of the kind and the types of the machine file.
"""

from typing import Any, NamedTuple

from wm_drake.compiler.packed import SCALAR
from wm_drake.elements.kind import ElementKind
from wm_drake.elements.layouts import units_of
from wm_drake.errors import input_error
from wm_drake.laws.table import CURVE, scale_to, slope_at_zero


class NumberWithUnit(NamedTuple):
    """A number of an element in SI; of a table its slope at 0."""

    value: Any
    unit: str


class NamedNumber(NamedTuple):
    """Where a number of a machine file is in packed numbers.

    Attributes:
        at: Index where it begins.
        unit: SI unit.
        is_curve: Whether it is a stiffness, a number or a table: it stands for the slope at 0.
    """

    at: int
    unit: str
    is_curve: bool

    def read(self, packed: Any) -> Any:
        """Return the number."""
        return slope_at_zero(packed, self.at) if self.is_curve else packed[self.at]

    def write(self, packed: Any, value: Any) -> None:
        """Set the number; a table is scaled until its slope at 0 is this number.

        Raises:
            InputError: the slope of the table is zero.
        """
        if not self.is_curve:
            packed[self.at] = value
        elif slope_at_zero(packed, self.at) == 0.0 != packed[self.at]:
            raise input_error(
                "is a table without slope at 0, which no factor changes; change it in the "
                "parameters and call `set_up`"
            )
        else:
            scale_to(packed, self.at, value)


def named_numbers(kind: ElementKind, packed: Any) -> dict[str, NamedNumber]:
    """Return where the numbers of a machine file are in the packed numbers of an element."""
    units = units_of(kind.parameters)
    return {
        name: NamedNumber(at, unit or units[name], field is CURVE)
        for name, at, field, unit in kind.layout.places(packed)
        if field in (SCALAR, CURVE) and (unit or name in units)
    }
