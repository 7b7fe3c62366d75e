"""Tables of text that all pages share: their parts, and the table of machine parameters."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from wm_drake.parameters import MachineParameters, quantities, source_of
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MISSING, significant

MOST_SHOWN = 24
"""Largest length of a list that is shown in full; of a longer list, only the ends are shown."""


READABLE_DIGITS = 6
"""Significant digits of a parameter on a page; `machine show` has all."""


@dataclass(frozen=True)
class Row:
    """Cells of one line.

    Attributes:
        cells: Text of the cells.
        kind: Style of the line: ours, measured, difference, other, alarm or empty.
    """

    cells: tuple[str, ...]
    kind: str = ""


@dataclass(frozen=True)
class Group:
    """Lines under one heading. The heading is printed in the first column."""

    heading: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Table:
    """Table of text.

    Attributes:
        caption: One or more sentences that explain the table.
        header: Heads of the columns, with units.
        groups: Lines of the table.
        text_columns: Number of columns at the left that hold words. The other columns hold numbers.
    """

    caption: str
    header: tuple[str, ...]
    groups: tuple[Group, ...]
    text_columns: int = 1


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
    values = value if isinstance(value, tuple) else (value,)
    texts = [significant(unit.from_si(number), READABLE_DIGITS) for number in values]
    shown = f"({', '.join(texts)})" if isinstance(value, tuple) else texts[0]
    return f"{shown} {unit.shown.replace('*', ' ').replace('^2', '²')}"


def line(heading: str, cells: Iterable[str], kind: str = "") -> Group:
    """Return a group with one row."""
    return Group(heading, (Row(tuple(cells), kind),))
