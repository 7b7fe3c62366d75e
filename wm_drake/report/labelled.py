"""A table as a labelled dataset: from it follow file, JSON, lines of the terminal and the page."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.report.formatting import plain
from wm_drake.report.quantity import HIDDEN, has_quantity, quantity_of, shown, units_of
from wm_drake.report.table import Table, table_of

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

MOST_LINES = 200
"""Largest number of lines of a table on the page; the file has all."""

NUMBERS = "fiu"
"""Kinds of arrays that have a unit; others are texts and truth values."""


@dataclass(frozen=True)
class LabelledTable:
    """A dataset in SI, and how it is shown.

    Its dimensions with labels are the first columns, its variables the others. Each variable
    carries its `Quantity`, or has the name of a variable of a measure; one of texts or whole
    numbers needs none. If the unit differs from row to row, it has a column. A row without any
    value is left out.

    Attributes:
        name: Name of the file, without suffix, and of the key in JSON.
        data: The numbers.
        heading: Heading on the page and the terminal. A table without is in files and JSON only.
        caption: One or more sentences that explain the table.
        across: Dimension whose labels become columns.
        marked: Boolean variable of the lines that are marked, and their style, as of
            `report.table.Row`. The variable is no column on page and terminal.
        words: Words for labels on page and terminal, by the labels.
        on_page_only: Variables for which a terminal is too narrow.
        is_in_terminal: Whether the terminal shows it.
        is_in_json: Whether JSON has it; a long history is in files and notebooks only.
    """

    name: str
    data: xr.Dataset
    heading: str = ""
    caption: str = ""
    across: str = ""
    marked: tuple[str, str] = ("", "")
    words: Mapping[str, str] = field(default_factory=dict)
    on_page_only: Sequence[str] = ()
    is_in_terminal: bool = False
    is_in_json: bool = True

    def __post_init__(self) -> None:
        """Refuse numbers of which nothing says in which unit they are.

        Raises:
            TypeError: a variable of numbers has no quantity.
        """
        bare = [n for n, v in self.data.variables.items() if v.dtype.kind == "f" and v.size]
        bare = [name for name in bare if not has_quantity(self.data[name])]
        if bare:
            message = f"table {self.name}: {', '.join(map(str, bare))}: no Quantity says the unit"
            raise TypeError(message)

    def frame(self) -> pd.DataFrame:
        """Return the numbers in units for reading, with the unit in each name, for a file."""
        data = self._spread(self.data)
        return _rows(data).rename(columns=lambda name: _name_in_files(name, data[name]))

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as objects for JSON; a missing value is None."""
        records: list[dict[str, Any]] = plain(self.frame().to_dict("records"))
        return records

    def terminal(self) -> "TerminalTable":
        """Return the table for the terminal."""
        narrow = self.data.drop_vars(self.on_page_only, errors="ignore")
        return replace(self, data=narrow).table().terminal(self.heading)

    def table(self) -> Table:
        """Return the table for the page."""
        hidden = [name for name, v in self.data.variables.items() if HIDDEN in v.attrs]
        data = self._spread(self.data.drop_vars(hidden))
        frame = _rows(data)
        marker, style = self.marked
        marks = frame.pop(marker).tolist() if marker else []
        heads = {str(name): quantity_of(data[name]).column() for name in frame}
        kinds = [style if mark is True else "" for mark in marks]
        return table_of(
            frame.replace(dict(self.words))[:MOST_LINES], self.caption, heads, kinds, grouped=True
        )

    def _spread(self, data: xr.Dataset) -> xr.Dataset:
        """Return data with a variable for each label of `across`.

        Its name is the label, after that of the variable if several vary.
        """
        if not self.across:
            return _with_unit(data)
        varying = [name for name, variable in data.items() if self.across in variable.dims]
        wide = data.drop_dims(self.across)
        for label in data[self.across].values.tolist():
            for name in varying:
                head, several = self.words.get(str(label), str(label)), len(varying) > 1
                column = data[name].sel({self.across: label})
                words = f"{quantity_of(data[name]).words}, {head}" if several else head
                quantity = quantity_of(column).named(words)
                several_units = column.attrs if units_of(column) else {}
                column = column.drop_vars(self.across, errors="ignore")
                column.attrs = {**several_units, **quantity.attributes()}
                wide[f"{name}_{label}" if several else str(label)] = column
        return _with_unit(wide)


def _with_unit(data: xr.Dataset) -> xr.Dataset:
    """Return data with a column of units, if the unit of a variable differs from row to row."""
    numbers = (variable for variable in data.values() if variable.dtype.kind in NUMBERS)
    for dim, quantities in filter(None, map(units_of, numbers)):
        return data.assign_coords(unit=(dim, [quantity.reading.label for quantity in quantities]))
    return data


def _rows(data: xr.Dataset) -> pd.DataFrame:
    """Return a row for each place of a dataset that has a value, in units for reading."""
    labels = [*_dims_of(data), *data.coords]
    names = [*(name for name in dict.fromkeys(labels) if name in data.coords), *data]
    columns = {name: _values_everywhere(_in_reading_unit(data[name]), data) for name in names}
    frame = pd.DataFrame(columns)  # many times as fast as `Dataset.to_dataframe`
    others = (name for name in data.coords if name not in data.dims)
    numbers = [name for name in others if data[name].dtype.kind in NUMBERS]
    return frame.dropna(how="all", subset=[*data.data_vars, *numbers]).reset_index(drop=True)


def _values_everywhere(array: xr.DataArray, data: xr.Dataset) -> np.ndarray:
    """Return the values of a variable at each place of its dataset."""
    variable: Any = array.variable  # xarray has no types for `set_dims`
    return np.asarray(variable.set_dims(data.sizes).transpose(*_dims_of(data)).values.ravel())


def _dims_of(data: xr.Dataset) -> list[Hashable]:
    """Return the dimensions in the order in which variables have them.

    xarray has no order of its own: it keeps coordinates in sets.
    """
    of_variables = [dim for array in data.values() for dim in array.dims]
    return list(dict.fromkeys([*of_variables, *data.sizes]))


def _in_reading_unit(array: xr.DataArray) -> xr.DataArray:
    if array.dtype.kind not in NUMBERS:
        return array
    unit = quantity_of(array).reading
    if unit.si == unit.shown and units_of(array) is None:
        return array
    return array.copy(deep=False, data=shown(array))


def _name_in_files(name: str, array: xr.DataArray) -> str:
    suffix = quantity_of(array).suffix
    return name if name.endswith(suffix) else f"{name}{suffix}"


def rows_of(labels: Mapping[str, Sequence[Any]], **variables: Any) -> xr.Dataset:
    """Return a dataset over `row` with labels of its rows."""
    return xr.Dataset(variables, {name: ("row", list(of)) for name, of in labels.items()})
