"""CSV files: a # starts a comment, and the first line names the columns."""

import warnings
from pathlib import Path

import pandas as pd

from wm_drake.errors import input_error


def read_csv(
    path: str | Path, columns: list[str], key: str = "", optional: str = ""
) -> pd.DataFrame:
    """Read a CSV file with given columns.

    Args:
        path: The file.
        columns: Names of the columns that the file must have, in this order.
        key: Key path for messages.
        optional: Name of a column that may follow; empty for none.

    Raises:
        InputError: the file cannot be read as CSV, has other columns, or has a row with more values
            than columns.
    """
    try:
        named = list(pd.read_csv(path, comment="#", skipinitialspace=True, nrows=0).columns)
        if named not in (columns, [*columns, optional]):
            message = f"needs the columns {','.join(columns)}, has {','.join(map(str, named))}"
            raise input_error(message, where=str(path), key=key)
        with warnings.catch_warnings():
            # pandas cuts a row that is too long and only warns
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(path, comment="#", skipinitialspace=True, index_col=False)
    except pd.errors.ParserWarning:
        raise input_error("a row has more values than columns", where=str(path), key=key) from None
    except (OSError, ValueError) as error:
        raise input_error(
            f"cannot be read as CSV ({' '.join(str(error).split())})", where=str(path), key=key
        ) from None
