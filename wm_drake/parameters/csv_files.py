"""CSV files: # begins a comment, the first line names the columns."""

import warnings
from pathlib import Path

import pandas as pd

from wm_drake.errors import input_error


def read_csv(
    path: str | Path, columns: list[str], key: str = "", optional: str = ""
) -> pd.DataFrame:
    """The table in a CSV file that must have exactly these columns, and may have `optional` behind them.

    Raises:
        InputError: not there, not a table, other columns, or a row with more values than columns.
    """
    try:
        named = list(pd.read_csv(path, comment="#", skipinitialspace=True, nrows=0).columns)
        if named not in (columns, [*columns, optional]):
            message = f"needs the columns {','.join(columns)}, has {','.join(map(str, named))}"
            raise input_error(message, where=str(path), key=key)
        with warnings.catch_warnings():
            warnings.simplefilter(
                "error", pd.errors.ParserWarning
            )  # a row too long would only be cut with a warning
            return pd.read_csv(path, comment="#", skipinitialspace=True, index_col=False)
    except pd.errors.ParserWarning:
        raise input_error("a row has more values than columns", where=str(path), key=key) from None
    except (OSError, ValueError) as error:
        raise input_error(
            f"cannot be read as CSV ({' '.join(str(error).split())})", where=str(path), key=key
        ) from None
