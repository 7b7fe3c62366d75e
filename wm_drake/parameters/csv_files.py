"""CSV files: a # starts a comment, and the first line names the columns."""

import warnings
from pathlib import Path

import pandas as pd

from wm_drake.errors import input_error

_SIGNS = "; columns are separated by commas, and the decimal sign is a point"


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
            has = ",".join(map(str, named))
            signs = _SIGNS if ";" in has or "\t" in has else ""
            message = f"needs the columns {','.join(columns)}, has {has}{signs}"
            raise input_error(message, where=str(path), key=key)
        with warnings.catch_warnings():
            # pandas cuts a row that is too long and only warns
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(path, comment="#", skipinitialspace=True, index_col=False)
    except pd.errors.ParserWarning:
        message = f"a row has more values than columns{_SIGNS}"
        raise input_error(message, where=str(path), key=key) from None
    except pd.errors.ParserError as error:
        reason = " ".join(str(error).split()).removeprefix("Error tokenizing data. C error: ")
        message = f"cannot be read as CSV ({reason}){_SIGNS}"
        raise input_error(message, where=str(path), key=key) from None
    except (OSError, ValueError) as error:
        raise input_error(
            f"cannot be read as CSV ({' '.join(str(error).split())})", where=str(path), key=key
        ) from None
