"""CSV files: a # starts a comment, and the first line names the columns.

Columns are separated by commas, or by semicolons or tabs as spreadsheets write them; the decimal
sign may be a comma then.
"""

import io
import itertools
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wm_drake.errors import InputNotice, Problem, input_error
from wm_drake.parameters.text_files import read_any_text
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import LARGEST_NUMBER, comma_hint

if TYPE_CHECKING:  # slow to import: CSV files
    import pandas as pd

_SIGNS = "; where commas separate the columns, the decimal sign is a point"


def read_csv(
    path: str | Path, columns: list[str], key: str = "", optional: str = ""
) -> "pd.DataFrame":
    """Read a CSV file with given columns; all cells are texts.

    So a name stays as it is written, such as ``01``, ``1e3``, ``NA`` or ``true``. `finite_numbers`
    returns the columns of numbers.

    Args:
        columns: Names of the columns that the file must have, in this order.
        key: Key path for messages.
        optional: Name of a column that may follow; empty for none.

    Raises:
        InputError: the file cannot be read as CSV, has other columns, or has a row with more values
            than columns.
    """
    import pandas as pd  # slow to import: CSV files

    text = read_any_text(Path(path), key=key)
    try:
        written = [str(name).strip() for name in _table(text, nrows=0).columns]
        heads = [
            [str.casefold(name) for name in names] for names in (written, map(_with_unit, written))
        ]
        allowed = (columns, [*columns, optional])
        head = next((names for names in allowed if list(map(str.casefold, names)) in heads), None)
        if head is None:
            message = f"needs the columns {','.join(columns)}, has {','.join(written)}"
            raise input_error(message, where=str(path), key=key)
        with warnings.catch_warnings():
            # pandas cuts a row that is too long and only warns
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return _table(text, index_col=False).set_axis(head, axis="columns")
    except pd.errors.ParserWarning:
        message = f"a row has more values than columns{_SIGNS}"
        raise input_error(message, where=str(path), key=key) from None
    except pd.errors.ParserError as error:
        reason = " ".join(str(error).split()).removeprefix("Error tokenizing data. C error: ")
        message = f"cannot be read as CSV ({reason}){_SIGNS}"
        raise input_error(message, where=str(path), key=key) from None
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise input_error(f"cannot be read as CSV ({reason})", where=str(path), key=key) from None


def finite_numbers(table: "pd.DataFrame", path: str | Path, key: str = "") -> FloatArray:
    """Return a table as numbers. (row, column)

    Args:
        table: Table from `read_csv`.
        path: The file, for messages.
        key: Key path for messages; empty for the name of the column.

    Raises:
        InputError: a value is not a finite number, or is out of range.
    """
    import pandas as pd  # slow to import: CSV files

    numbers = table.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    wrong = np.argwhere(~(np.abs(numbers) <= LARGEST_NUMBER))  # nan is wrong too
    if len(wrong):
        row, column = wrong[0]
        cell = str(table.iloc[row, column])
        raise input_error(
            f"row {row + 1} of the data: '{cell}' is not a finite number of at most "
            f"{LARGEST_NUMBER:g}{comma_hint(cell)}",
            where=str(path),
            key=key or str(table.columns[column]),
        )
    return numbers


def data_lines(path: Path) -> list[int]:
    """Return the numbers of the lines of a CSV file with rows of data: no comment, not blank."""
    lines = enumerate(read_any_text(path).splitlines(), start=1)
    return [number for number, line in lines if line.partition("#")[0].strip()][1:]


def read_header(path: Path, key: str = "") -> list[str]:
    """Return the names of the columns of a CSV file."""
    try:
        return list(map(str, _table(read_any_text(path, key=key), nrows=0).columns))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise input_error(f"cannot be read as CSV ({reason})", where=str(path), key=key) from None


def read_note(path: Path, key: str = "") -> str:
    """Return the comment that a CSV file begins with, in one line; "" if there is none."""
    lines = read_any_text(path, key=key).splitlines()
    comments = itertools.takewhile(lambda line: line.startswith("#"), lines)
    return " ".join(line.lstrip("# ").rstrip() for line in comments)


MOST_COLUMNS = 1000
"""Largest number of columns of a table."""


def _table(text: str, **options: Any) -> "pd.DataFrame":
    import pandas as pd  # slow to import: CSV files

    head = _head(text)
    sign = re.fullmatch(r'"?sep=([,;\t])"?\s*', head, re.IGNORECASE)  # first line of spreadsheets
    if sign:
        text = text.replace(head, "", 1)
        head = _head(text)
    separator = sign[1] if sign else max(",;\t", key=head.count)
    if head.count(separator) >= MOST_COLUMNS:
        raise ValueError(f"{head.count(separator) + 1} columns; allowed are up to {MOST_COLUMNS}")
    table = pd.read_csv(
        io.StringIO(text),
        sep=separator,
        comment="#",
        skipinitialspace=True,
        dtype=str,
        keep_default_na=False,
        **options,
    )
    if not len(table):
        return table
    table = table.apply(lambda column: column.str.strip())
    table = table[table.ne("").any(axis="columns")]  # spreadsheets write empty rows, too
    if separator == ",":
        return table
    return table.replace(r"^([+-]?\d+),(\d+(e[+-]?\d+)?)$", r"\1.\2", regex=True)


def _head(text: str) -> str:
    """Return the first line that is neither blank nor a comment."""
    return next((line for line in text.splitlines() if line.partition("#")[0].strip()), "")


def _with_unit(name: str) -> str:
    """Return a column's name with its unit as our tables write it: `time_s` of `time [s]`."""
    words, bracket, unit = name.rpartition("[")
    if not bracket or not unit.endswith("]"):
        return name
    return f"{words.rstrip()}_{unit[:-1].strip().replace('/', '_per_')}"


def with_distinct_times(samples: FloatArray, where: str) -> FloatArray:
    """Return samples with those of equal time stamps averaged, with a notice.

    Instruments that store few digits of the time give neighbouring samples the same one.

    Args:
        samples: (n, k) with the time in the first column.
        where: File, for the notice.

    Returns:
        (m, k), m <= n; the same array if no neighbours have the same time.
    """
    is_first = np.ones(len(samples), dtype=bool)
    is_first[1:] = np.diff(samples[:, 0]) != 0.0
    first = np.flatnonzero(is_first)
    if len(first) == len(samples):
        return samples
    sizes = np.diff(np.append(first, len(samples)))
    averaged = np.add.reduceat(samples, first) / sizes[:, None]
    averaged[:, 0] = samples[first, 0]
    message = (
        f"{int(sizes[sizes > 1].sum())} samples share their time stamp with a neighbour; they were "
        f"averaged to {int(np.sum(sizes > 1))}"
    )
    warnings.warn(str(Problem(where, "", message)), InputNotice, stacklevel=3)
    return averaged
