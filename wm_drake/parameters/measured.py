"""Measured amplitudes and other responses, from the files that a machine file names."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.csv_files import finite_numbers, read_csv, read_header, read_note
from wm_drake.parameters.machine import MachineParameters

if TYPE_CHECKING:  # slow to import: CSV files
    import pandas as pd

_KEYS = ["load", "gasket", "source"]

CHANGE = "change"
"""Entry of the column `gasket` in a row with the change of the amplitudes by the gasket. [%]"""

EXPERIMENT = "experiment"
"""Source of measured values; rows with another source are only compared with them."""

BAND = "band"
"""Optional last column of amplitudes: the pass band of the displacements."""

OF = "of"
"""Column that only files of responses have. It says what a value belongs to."""

MACHINE = "machine"
"""Entry of the column `OF`: the machine itself."""

_HEAD = re.compile(r"\s*(\w+)\s*\[([^\]]+)\]\s*")


@dataclass(frozen=True)
class NamedValue:
    """A value of a response, as a file gives it.

    Attributes:
        load: Name of the load.
        gasket: Whether the machine has its gasket.
        source: Where the value comes from.
        name: Name of the response, such as ``Dx``.
        value: The value, in `unit`.
        unit: Unit in the head of the column.
        where: The file, for messages.
    """

    load: str
    gasket: bool
    source: str
    name: str
    value: float
    unit: str
    where: str


def measured_amplitudes(parameters: MachineParameters) -> "pd.DataFrame":
    """Read the measured amplitudes of a machine.

    Returns:
        The rows of the files of amplitudes in `measured`: load, gasket (yes, no), source, then one
        column per sensor. [mm] Rows of changes are left out.

    Raises:
        InputError: a file is missing, has other columns, or contains a value that is not a number.
    """
    table = _amplitudes_and_changes(parameters)
    return table[table["gasket"] != CHANGE].reset_index(drop=True)


def measured_changes(parameters: MachineParameters) -> "pd.DataFrame":
    """Read the changes of the measured amplitudes by the gasket.

    Returns:
        A row of each load and source: load, source, then one column per sensor. [%] They are those
        of a row whose gasket is `CHANGE`, as printed values come from amplitudes before rounding;
        without one, they follow from the amplitudes with and without gasket ([B] Eq. (1)).
    """
    import pandas as pd  # slow to import: CSV files

    sensors, rows = list(parameters.sensors), []
    for keys, group in _amplitudes_and_changes(parameters).groupby(["load", "source"], sort=False):
        by_gasket = group.drop_duplicates("gasket").set_index("gasket")[sensors].astype(float)
        if CHANGE in by_gasket.index:
            change = by_gasket.loc[CHANGE]
        elif {"yes", "no"} <= set(by_gasket.index):
            change = 100.0 * (by_gasket.loc["yes"] / by_gasket.loc["no"] - 1.0)
        else:
            continue
        rows.append([*keys, *change.where(np.isfinite(change))])
    return pd.DataFrame(rows, columns=["load", "source", *sensors])


def _amplitudes_and_changes(parameters: MachineParameters) -> "pd.DataFrame":
    import pandas as pd  # slow to import: CSV files

    sensors = list(parameters.sensors)
    tables = [_read(path, sensors) for path in parameters.measured if not _has_responses(path)]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=_KEYS + sensors)


def measured_notes(parameters: MachineParameters) -> list[str]:
    """Return what each file of measured amplitudes says of itself, in the comment at its top."""
    files = [path for path in parameters.measured if not _has_responses(path)]
    return [note for path in files if (note := read_note(Path(path), key="measured"))]


def measured_responses(parameters: MachineParameters) -> list[NamedValue]:
    """Read the responses that are not amplitudes of sensors, such as forces of the gasket.

    Returns:
        All values of the files of responses in `measured`. Such a file has the columns ``load``,
        ``gasket`` (yes, no), ``source``, ``of`` (machine) and one for each response, with its unit
        in the head: ``Fx [N]``.

    Raises:
        InputError: a file is missing, has another column, or contains a value that is not allowed.
    """
    files = [path for path in parameters.measured if _has_responses(path)]
    return [value for path in files for value in _responses(path)]


def _has_responses(path: str) -> bool:
    return OF in read_header(Path(path), key="measured")


def _responses(path: str) -> list[NamedValue]:
    head = read_header(Path(path), key="measured")
    columns = head[len(_KEYS) + 1 :]
    named = [_HEAD.fullmatch(column) for column in columns]
    table = read_csv(path, [*_KEYS, OF, *columns], key="measured")
    if not columns or None in named:
        wrong = [column for column, match in zip(columns, named, strict=True) if match is None]
        raise input_error(
            f"the head {', '.join(map(repr, wrong)) or 'of a response'} is not of the form "
            "'NAME [unit]', such as 'Fx [N]'",
            where=path,
            key="measured",
        )
    _check_entries(table, "gasket", ("yes", "no"), path)
    _check_entries(table, OF, (MACHINE,), path)
    numbers = finite_numbers(table[columns], path, key="measured")
    return [
        NamedValue(
            str(row["load"]),
            row["gasket"] == "yes",
            str(row["source"]),
            match[1],
            float(number),
            match[2],
            path,
        )
        for row, values in zip(table.to_dict("records"), numbers, strict=True)
        for match, number in zip(named, values, strict=True)
        if match is not None
    ]


def _check_entries(table: "pd.DataFrame", column: str, allowed: tuple[str, ...], path: str) -> None:
    wrong = set(map(str, table[column])) - set(allowed)
    if wrong:
        raise input_error(
            f"'{min(wrong)}' in the column {column} is not allowed; allowed are "
            f"{', '.join(allowed)}",
            where=path,
            key="measured",
        )


def _read(path: str, sensors: list[str]) -> "pd.DataFrame":
    head, written = read_header(Path(path), key="measured"), [f"{name}_mm" for name in sensors]
    if set(head) - {BAND} == {*_KEYS, *written}:  # as commands write it
        table, columns = read_csv(path, head, key="measured"), written
    else:
        table = read_csv(path, _KEYS + sensors, key="measured", optional=BAND)
        columns = sensors
    _check_entries(table, "gasket", ("yes", "no", CHANGE), path)
    values = finite_numbers(table[columns], path, key="measured")
    return table[_KEYS].assign(**dict(zip(sensors, values.T, strict=True)))
