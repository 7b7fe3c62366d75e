"""Declaration of a quantity: words, unit and digits, once.

A quantity rides on a variable of a labelled dataset, which holds SI values. Whatever shows the
variable (page, terminal, file, axis, sentence) takes words, unit and digits from there, so that
nothing else converts a number or spells a unit.
"""

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import PureNumber, Share, Unit
from wm_drake.report.formatting import MISSING, number, signed, significant

if TYPE_CHECKING:  # slow to import, and not needed for declarations
    import xarray as xr

    from wm_drake.report.table import Column

NO_UNIT = PureNumber()
ROUNDING = 0.3
"""Part of a decimal that is not worth another one."""

HIDDEN = "is_hidden"
"""Attribute of a variable that files and JSON have, and page and terminal leave out."""

ALONG, EACH = "along", "each"
"""Attributes of a variable with several quantities: the coordinate that tells which, and the
quantity of each of its labels."""


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
    def reading(self) -> Unit:
        """Unit in which it is read."""
        return self.unit.for_reader

    @property
    def unit_text(self) -> str:
        """Unit for reading, without line breaks: `N m`."""
        return self._unit.replace(" ", "\u00a0")

    @property
    def _unit(self) -> str:
        return self.reading.label.replace("^2", "²").replace("^3", "³")

    @property
    def label(self) -> str:
        """Words and unit, for an axis."""
        return f"{self.words}, {self.unit_text}" if self.unit_text else self.words

    @property
    def suffix(self) -> str:
        """End of names in files: `_mm`, `_N_per_mm`; "" without a unit."""
        text = self.reading.shown.replace("*", "").replace("/", "_per_").replace("%", "percent")
        return f"_{text.replace('^', '')}" if text else ""

    def named(self, words: str, **digits: Any) -> "Quantity":
        """Return the same quantity with other words, and with other `decimals` or `form`."""
        plain = {"decimals": None, "form": None} if digits else {}
        return replace(self, words=words, **{**plain, **digits})

    def values(self, array: Any) -> FloatArray:
        """Return SI values in the unit for reading."""
        return np.asarray(array, dtype=float) * self.reading.from_si(1.0)

    def number(self, value: Any) -> str:
        """Return an SI value as text without its unit; NaN and infinity become a dash."""
        shown = float(self.values(value))
        if not np.isfinite(shown):
            return MISSING
        if self.form is not None:
            return self.form(shown)
        decimals = self._decimals
        return significant(shown) if decimals is None else number(shown, decimals)

    def text(self, value: Any) -> str:
        """Return an SI value as text with its unit."""
        return f"{self.number(value)} {self._unit}".rstrip()

    @property
    def _decimals(self) -> int | None:
        """Decimals in the unit for reading, for the digits of `decimals` in the display unit."""
        if self.decimals is None:
            return None
        larger = self.unit.from_si(1.0) / self.reading.from_si(1.0)
        return max(0, self.decimals + math.ceil(math.log10(larger) - ROUNDING))

    def variable(self, dims: str | Sequence[str], values: Any) -> "xr.Variable":
        """Return values in SI as a variable that carries this quantity."""
        import xarray as xr

        return xr.Variable(dims, np.asarray(values, dtype=float), self.attributes())

    def hidden(self, dims: str | Sequence[str], values: Any) -> "xr.Variable":
        """Return a variable as `variable`, which page and terminal leave out."""
        variable = self.variable(dims, values)
        variable.attrs[HIDDEN] = True
        return variable

    def of_each(
        self,
        along: str,
        each: Mapping[str, "Quantity"],
        dims: str | Sequence[str],
        values: Any,
    ) -> "xr.Variable":
        """Return values in SI as a variable whose unit differs along a coordinate.

        Args:
            along: The coordinate, such as that of the responses of a study.
            each: Quantity of each of its labels.
            dims: Dimensions of the values.
            values: The values. [SI]
        """
        variable = self.variable(dims, values)
        variable.attrs |= {ALONG: along, EACH: each}
        return variable

    def on(self, array: "xr.DataArray") -> "xr.DataArray":
        """Return an array that carries this quantity."""
        return array.assign_attrs(self.attributes())

    def attributes(self) -> dict[Hashable, Any]:
        """Return the attributes of a variable that carries this quantity.

        xarray labels axes by `long_name` and `units`.
        """
        return {"quantity": self, "long_name": self.words, "units": self.unit.si}

    def column(self) -> "Column":
        """Return the column of a table."""
        from wm_drake.report.table import Column  # slow to import: pandas

        return Column(self.words, self.unit_text, self._decimals, self.form)


def quantity_of(array: "xr.DataArray") -> Quantity:
    """Return the quantity that a variable carries.

    A variable with several quantities has that of its label, once one is selected. A variable of a
    table of runs has that of its measure; any other is a pure number with the words of its name.
    """
    label = array.coords.get(array.attrs.get(ALONG, ""))
    if label is not None and not label.ndim:
        of_label: Quantity = array.attrs[EACH][str(label.item())]
        return of_label
    if "quantity" in array.attrs:
        quantity: Quantity = array.attrs["quantity"]
        return quantity
    return _of_measure(str(array.name)) or Quantity(str(array.name).replace("_", " "))


def has_quantity(array: "xr.DataArray") -> bool:
    """Return whether a variable carries a quantity, or several, or is that of a measure."""
    return (
        bool(array.attrs.keys() & {"quantity", ALONG}) or _of_measure(str(array.name)) is not None
    )


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
    """Return the quantity of a variable of a measure by its name; None for another one."""
    from wm_drake.simulation.measures import MEASURES  # registered ones too, so at each call

    variables = (variable for measure in MEASURES.values() for variable in measure.variables)
    known = next((variable for variable in variables if variable.name == name), None)
    return None if known is None else Quantity(known.kind, known.unit, known.studio)


def each_of(array: "xr.DataArray") -> "Mapping[str, Quantity]":
    """Return the quantity of each label of a variable, as of `Quantity.of_each`."""
    each: Mapping[str, Quantity] = array.attrs[EACH]
    return each


def named(array: "xr.DataArray", words: str) -> "xr.DataArray":
    """Return a variable with other words."""
    return quantity_of(array).named(words).on(array)


def hidden(data: "xr.Dataset", *names: str) -> "xr.Dataset":
    """Return data in which page and terminal leave out some variables; files have them."""
    return data.assign({name: data[name].assign_attrs({HIDDEN: True}) for name in names})


def shown(array: "xr.DataArray") -> FloatArray:
    """Return the values of a variable in its unit for reading, for a mark of a figure."""
    each = units_of(array)
    if each is None:
        return quantity_of(array).values(array.values)
    dim, quantities = each
    factors = [float(quantity.values(1.0)) for quantity in quantities]
    place = array.dims.index(dim)
    at_end = np.moveaxis(np.asarray(array.values, dtype=float), place, -1)
    return np.moveaxis(at_end * factors, -1, place)


def units_of(array: "xr.DataArray") -> "tuple[Hashable, list[Quantity]] | None":
    """Return the dimension along which the unit of a variable differs, and the quantities there.

    It is None if the variable has one unit.
    """
    labels = array.coords.get(array.attrs.get(ALONG, ""))
    if labels is None or not labels.ndim:
        return None
    return labels.dims[0], [array.attrs[EACH][str(label)] for label in labels.values]


def text_of(array: "xr.DataArray") -> str:
    """Return the text of a variable of one value, with its unit."""
    return quantity_of(array).text(array.item())


SPEED = Quantity("drum speed", Unit("rad/s", "rpm"), 0)
TIME = Quantity("time", Unit("s", "s"), 2)
STEP = Quantity("step", Unit("s", "ms"), form="{:g}".format)
MASS = Quantity("mass", Unit("kg", "kg"))
SHARE = Quantity("share", Share(), 0)
CHANGE = Quantity("change", Share(), form=signed)
