"""Measured amplitudes from the files that a machine file names."""

import numpy as np
import pandas as pd

from wm_drake.errors import input_error
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.units import comma_hint

_KEYS = ["load", "gasket", "source"]


def measured_amplitudes(parameters: MachineParameters) -> pd.DataFrame:
    """Read the measured amplitudes of a machine.

    Returns:
        All rows of the CSV files in `measured`: load, gasket (yes, no), source, then one column per
        sensor. [mm]

    Raises:
        InputError: a file is missing, has other columns, or contains a value that is not a number.
    """
    sensors = list(parameters.sensors)
    tables = [_read(path, sensors) for path in parameters.measured]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=_KEYS + sensors)


def _read(path: str, sensors: list[str]) -> pd.DataFrame:
    table = read_csv(path, _KEYS + sensors, key="measured")
    if not set(table["gasket"]) <= {"yes", "no"}:
        raise input_error(
            "a value in the column gasket is neither yes nor no", where=path, key="measured"
        )
    values = table[sensors].apply(pd.to_numeric, errors="coerce")
    if not np.isfinite(values.to_numpy(dtype=float)).all():
        cells = table[sensors].to_numpy()[~np.isfinite(values.to_numpy(dtype=float))]
        raise input_error(
            f"an amplitude is not a finite number: '{cells[0]}'{comma_hint(str(cells[0]))}",
            where=path,
            key="measured",
        )
    return table.assign(**{name: values[name] for name in sensors})
