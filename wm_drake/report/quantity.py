"""Declaration of a quantity: words, unit and digits, once.

A quantity rides on a variable of a labelled dataset, which holds SI values. Whatever shows the
variable (page, terminal, file, axis, sentence) takes words, unit and digits from there, so that
nothing else converts a number or spells a unit.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import PureNumber, Unit
from wm_drake.report.formatting import MISSING, number, significant

if TYPE_CHECKING:  # slow to import, and not needed for declarations
    import xarray as xr

    from wm_drake.report.table import Column

NO_UNIT = PureNumber()
HIDDEN = "is_hidden"
"""Attribute of a variable that files and JSON have, and page and terminal leave out."""


@dataclass(frozen=True)
class Quantity:
    """What a number is.

    Attributes:
        words: Words for heads of tables, axes and sentences.
        unit: SI unit, and unit for reading.
        decimals: Decimals of its text; None for four significant digits.
        form: Function that returns the text of a value in the unit for reading, in place of
            `decimals`.
    """

    words: str
    unit: Unit = NO_UNIT
    decimals: int | None = None
    form: Callable[[float], str] | None = None

    @property
    def unit_text(self) -> str:
        """Unit for reading, without line breaks: `N m`."""
        return self._unit.replace(" ", "\u00a0")

    @property
    def _unit(self) -> str:
        return self.unit.label.replace("^2", "²").replace("^3", "³")

    @property
    def label(self) -> str:
        """Words and unit, for an axis."""
        return f"{self.words}, {self.unit_text}" if self.unit_text else self.words

    @property
    def suffix(self) -> str:
        """End of names in files: `_mm`, `_N_per_mm`; "" without a unit."""
        text = self.unit.shown.replace("*", "").replace("/", "_per_").replace("%", "percent")
        return f"_{text.replace('^', '')}" if text else ""

    def named(self, words: str) -> "Quantity":
        """Return the same quantity with other words."""
        return replace(self, words=words)

    def values(self, array: Any) -> FloatArray:
        """Return SI values in the unit for reading."""
        return np.asarray(array, dtype=float) * self.unit.from_si(1.0)

    def to_si(self, values: Any) -> FloatArray:
        """Return values in the unit for reading as SI values."""
        return np.asarray(values, dtype=float) / self.unit.from_si(1.0)

    def number(self, value: Any) -> str:
        """Return an SI value as text without its unit; NaN and infinity become a dash."""
        shown = float(self.values(value))
        if not np.isfinite(shown):
            return MISSING
        if self.form is not None:
            return self.form(shown)
        return significant(shown) if self.decimals is None else number(shown, self.decimals)

    def text(self, value: Any) -> str:
        """Return an SI value as text with its unit."""
        return f"{self.number(value)} {self._unit}".rstrip()

    def variable(self, dims: str | Sequence[str], values: Any) -> "xr.Variable":
        """Return values in SI as a variable that carries this quantity."""
        import xarray as xr

        return xr.Variable(dims, np.asarray(values, dtype=float), self.attributes())

    def hidden(self, dims: str | Sequence[str], values: Any) -> "xr.Variable":
        """Return a variable as `variable`, which page and terminal leave out."""
        variable = self.variable(dims, values)
        variable.attrs[HIDDEN] = True
        return variable

    def attributes(self) -> dict[Hashable, Any]:
        """Return the attributes of a variable that carries this quantity.

        xarray labels axes by `long_name` and `units`.
        """
        return {"quantity": self, "long_name": self.words, "units": self.unit.si}

    def column(self, words: str = "") -> "Column":
        """Return the column of a table, with its words or others."""
        from wm_drake.report.table import Column  # slow to import: pandas

        return Column(words or self.words, self.unit_text, self.decimals, self.form)


def quantity_of(array: "xr.DataArray") -> Quantity:
    """Return the quantity that a variable carries.

    A variable of a table of runs has that of its measure; any other is a pure number with the words
    of its name.
    """
    if "quantity" in array.attrs:
        quantity: Quantity = array.attrs["quantity"]
        return quantity
    return _of_measure(str(array.name)) or Quantity(str(array.name).replace("_", " "))


def of_measure(name: str) -> Quantity:
    """Return the quantity of a variable of a measure by its name.

    Raises:
        KeyError: no measure has the variable.
    """
    quantity = _of_measure(name)
    if quantity is None:
        raise KeyError(name)
    return quantity


def _of_measure(name: str) -> Quantity | None:
    from wm_drake.simulation.measures import MEASURES  # registered ones too, so at each call

    variables = (variable for measure in MEASURES.values() for variable in measure.variables)
    known = next((variable for variable in variables if variable.name == name), None)
    return known and Quantity(known.kind, known.unit, known.studio)


def shown(array: "xr.DataArray") -> FloatArray:
    """Return the values of a variable in its unit for reading, for a mark of a figure."""
    return quantity_of(array).values(array.values)


def text_of(array: "xr.DataArray") -> str:
    """Return the text of a variable of one value, with its unit."""
    return quantity_of(array).text(array.item())


SPEED = Quantity("drum speed", Unit("rad/s", "rpm"), 0)
TIME = Quantity("time", Unit("s", "s"), 2)
STEP = Quantity("step", Unit("s", "ms"), form="{:g}".format)
