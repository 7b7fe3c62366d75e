"""A table as a labelled dataset: from it follow file, JSON, lines of the terminal and the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
import xarray as xr

from wm_drake.report.formatting import plain
from wm_drake.report.quantity import HIDDEN, quantity_of
from wm_drake.report.table import Table, line, table_of

MOST_LINES = 200
"""Largest number of lines of a table on the page; the file has all."""


@dataclass(frozen=True)
class LabelledTable:
    """A dataset in SI, and how it is shown.

    Its dimensions with labels are the first columns, its variables the others. Each variable
    carries its `Quantity`; one of texts needs none. A row without any value is left out.

    Attributes:
        name: Name of the file, without suffix, and of the key in JSON.
        data: The numbers.
        heading: Heading on the page and the terminal. A table without is in files and JSON only.
        caption: One or more sentences that explain the table.
        across: Dimension whose labels become columns.
        marked: Boolean variable of the lines that are marked, and their style, as of
            `report.table.Row`. The variable is no column on page and terminal.
        words: Words for labels on page and terminal, by the labels.
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
    is_in_terminal: bool = False
    is_in_json: bool = True

    def frame(self) -> pd.DataFrame:
        """Return the numbers in units for reading, with the unit in each name, for a file."""
        data = self._spread(self.data)
        return _rows(data).rename(columns=lambda name: _name_in_files(name, data[name]))

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as objects for JSON; a missing value is None."""
        records: list[dict[str, Any]] = plain(self.frame().to_dict("records"))
        return records

    def table(self) -> Table:
        """Return the table for page and terminal."""
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
            return data
        varying = [name for name, variable in data.items() if self.across in variable.dims]
        wide = data.drop_dims(self.across)
        for label in data[self.across].values.tolist():
            for name in varying:
                quantity, head = quantity_of(data[name]), self.words.get(str(label), str(label))
                several = len(varying) > 1
                column = data[name].sel({self.across: label}, drop=True)
                words = f"{quantity.words}, {head}" if several else head
                column.attrs = quantity.named(words).attributes()
                wide[f"{name}_{label}" if several else str(label)] = column
        return wide


@dataclass(frozen=True)
class TurnedTable(LabelledTable):
    """A table with a line for each variable, in its own unit, and a column for each label.

    The variables have one dimension, the same for all.
    """

    def frame(self) -> pd.DataFrame:
        """Return the numbers in units for reading, with name and unit of each variable."""
        rows = [
            [str(name), quantity_of(array).unit.label, *quantity_of(array).values(array.values)]
            for name, array in self.data.items()
        ]
        return pd.DataFrame(rows, columns=["quantity", "unit", *self._labels])

    def table(self) -> Table:
        """Return the table for page and terminal."""
        rows = (
            line(q.words, [q.unit_text, *map(q.number, array.values)])
            for q, array in ((quantity_of(array), array) for array in self.data.values())
        )
        heads = [self.words.get(label, label) for label in self._labels]
        return Table(self.caption, ("quantity", "unit", *heads), tuple(rows), text_columns=2)

    @property
    def _labels(self) -> list[str]:
        (dim,) = self.data.dims
        return [str(label) for label in self.data[dim].values.tolist()]


def _rows(data: xr.Dataset) -> pd.DataFrame:
    """Return a row for each place of a dataset that has a value, in units for reading."""
    dims = [str(dim) for dim in data.sizes]
    names = [dim for dim in dims if dim in data.coords]
    others = [str(name) for name in data.variables if name not in data.sizes]
    # many times as fast as `Dataset.to_dataframe`
    columns = {
        name: _in_reading_unit(data[name]).variable.set_dims(data.sizes).transpose(*dims).values
        for name in (*names, *others)
    }
    frame = pd.DataFrame({name: values.ravel() for name, values in columns.items()})
    frame = frame.dropna(how="all", subset=others).reset_index(drop=True)
    return frame[[*_labels_first(frame, data)]]


def _labels_first(frame: pd.DataFrame, data: xr.Dataset) -> Sequence[str]:
    """Return the columns of a frame, those of labels first."""
    return sorted(map(str, frame.columns), key=lambda name: name not in data.coords)


def _in_reading_unit(array: xr.DataArray) -> xr.DataArray:
    unit = quantity_of(array).unit
    if unit.si == unit.shown:
        return array
    return array.copy(data=quantity_of(array).values(array.values))


def _name_in_files(name: str, array: xr.DataArray) -> str:
    suffix = quantity_of(array).suffix
    return name if name.endswith(suffix) else f"{name}{suffix}"
