"""Declaration of a table: columns with name, unit and format, and rows of values.

A table is declared once. The template of a page reads its texts; `terminal` gives it for the
terminal. Files and JSON have the numbers of `wm_drake.report.labelled`.
"""

import itertools
import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import pandas as pd

from wm_drake.parameters import MachineParameters, quantities, source_of
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MISSING, number, significant

if TYPE_CHECKING:  # not needed for pages
    import rich.table

Columns: TypeAlias = "tuple[Column | str, ...]"
"""Columns of a table."""

CellValue: TypeAlias = str | float | bool | None
"""Content of a cell. A missing value is None or NaN."""

MOST_SHOWN = 24
"""Largest length of a list that is shown in full; of a longer list, only the ends are shown."""


READABLE_DIGITS = 6
"""Significant digits of a parameter on a page; `machine show` has all."""


@dataclass(frozen=True)
class Column:
    """Column of a table.

    Attributes:
        name: Words.
        unit: Unit of its numbers; "" without one.
        decimals: Decimals of a number as text; None for significant digits.
        form: Function that returns the text of a number, in place of `decimals`.
    """

    name: str
    unit: str = ""
    decimals: int | None = None
    form: Callable[[float], str] | None = None

    @property
    def head(self) -> str:
        """Return the head with the unit."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    def text(self, value: CellValue) -> str:
        """Return a value for reading; a text is shown as it is."""
        if isinstance(value, str):
            return value
        if value is None or math.isnan(value):
            return MISSING
        if isinstance(value, bool):
            return "yes" if value else "no"
        if self.form is not None:
            return self.form(value)
        return significant(value) if self.decimals is None else number(value, self.decimals)


@dataclass(frozen=True)
class Row:
    """Cells of one line.

    Attributes:
        cells: Values, or their texts.
        kind: Style of the line: ours, measured, difference, other, alarm or empty.
    """

    cells: tuple[CellValue, ...]
    kind: str = ""


@dataclass(frozen=True)
class Group:
    """Lines under one heading. The heading is printed in the first column."""

    heading: CellValue
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Table:
    """Table.

    Attributes:
        caption: One or more sentences that explain the table.
        columns: Columns, the first one for the headings of groups; a text is a column of texts.
        groups: Lines of the table.
        text_columns: Number of columns at the left that hold words. The other columns hold numbers.
    """

    caption: str
    columns: Columns
    groups: tuple[Group, ...]
    text_columns: int = 1

    @property
    def header(self) -> tuple[str, ...]:
        """Return the heads of the columns, with units."""
        return tuple(column.head for column in self._declared())

    @property
    def shown(self) -> tuple[Group, ...]:
        """Return the groups with all cells as texts."""
        first, *columns = self._declared()

        def texts(row: Row) -> tuple[str, ...]:
            return tuple(c.text(value) for c, value in zip(columns, row.cells, strict=True))

        return tuple(
            Group(first.text(group.heading), tuple(Row(texts(row), row.kind) for row in group.rows))
            for group in self.groups
        )

    def terminal(self, title: str) -> "rich.table.Table":
        """Return the table for the terminal: words at the left, numbers at the right."""
        from rich.table import Table as TerminalTable

        table = TerminalTable(title=title)
        for index, head in enumerate(self.header):
            is_number = index >= self.text_columns
            justify: Any = "right" if is_number else "left"
            table.add_column(head.replace("\u00a0", " "), justify=justify, overflow="fold")
        for group in self.shown:
            for row in group.rows:
                table.add_row(str(group.heading), *map(str, row.cells))
        return table

    def _declared(self) -> tuple[Column, ...]:
        return tuple(Column(c) if isinstance(c, str) else c for c in self.columns)


def table_of(
    frame: pd.DataFrame,
    caption: str = "",
    columns: Mapping[str, Column] | None = None,
    kinds: Sequence[str] = (),
    *,
    grouped: bool = False,
) -> Table:
    """Return a table of a data frame.

    Args:
        frame: Rows. Columns from the first one with numbers on are columns of numbers.
        columns: Declaration of columns by their names in the frame.
        kinds: Style of each row, as of `Row`.
        grouped: Whether neighbours with the same first cell have it once.
    """
    known = columns or {}
    styles = itertools.chain(kinds, itertools.repeat(""))
    rows = zip(frame.itertuples(index=False, name=None), styles, strict=False)
    lines = [(first, Row(tuple(rest), style)) for (first, *rest), style in rows]
    same = itertools.groupby(lines, operator.itemgetter(0)) if grouped else None
    groups = tuple(
        Group(first, tuple(row for _, row in of_group))
        for first, of_group in same or ((one[0], [one]) for one in lines)
    )
    kinds_of_columns = (column.dtype.kind for _, column in frame.items())
    words = len(list(itertools.takewhile(lambda kind: kind not in "fiu", kinds_of_columns)))
    declared = tuple(known.get(str(name), Column(str(name))) for name in frame.columns)
    return Table(caption, declared, groups, max(1, words))


def parameter_table(parameters: MachineParameters) -> Table:
    """Return every parameter of the machine: key path, value in the unit for reading, source."""
    groups = (
        line(key, [readable(value, unit), source_of(parameters, key) or MISSING])
        for key, value, unit in quantities(parameters)
    )
    caption = (
        "Parameters of the machine file. Masses, inertias, shapes and attachment points are in its "
        "SDF model."
    )
    return Table(caption, ("key", "value", "source"), tuple(groups), text_columns=3)


def readable(value: Any, unit: Unit) -> str:
    """Return a value in its display unit in a form for reading: `4600 N mm/rad`.

    A value has at most `READABLE_DIGITS` significant digits. A long list is shown by its ends.
    """
    if isinstance(value, tuple) and len(value) > MOST_SHOWN:
        return f"{len(value)} values, {readable(value[0], unit)} to {readable(value[-1], unit)}"
    values, unit = value if isinstance(value, tuple) else (value,), unit.for_reader
    texts = [significant(unit.from_si(number), READABLE_DIGITS) for number in values]
    shown = f"({', '.join(texts)})" if isinstance(value, tuple) else texts[0]
    return f"{shown} {unit.shown.replace('*', ' ').replace('^2', '²')}"


def line(heading: CellValue, cells: Iterable[CellValue], kind: str = "") -> Group:
    """Return a group with one row."""
    return Group(heading, (Row(tuple(cells), kind),))
