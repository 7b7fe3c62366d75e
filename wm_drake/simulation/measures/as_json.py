"""Measures of a run as nested objects for JSON."""

import itertools
from typing import Any

import xarray as xr

from wm_drake.simulation.measures.kind import Variable
from wm_drake.simulation.measures.registry import MEASURES


def labelled_values(
    table: xr.Dataset, variable: Variable
) -> list[tuple[tuple[str, ...], float | None]]:
    """Return labels and value of each number of a variable of one run. [unit for reading]

    A value that is NaN is None, because JSON has no NaN.
    """
    values = table[variable.name]
    along = [map(str, table[dim].values) for dim in values.dims]
    numbers = (float(value) for value in values.values.flat)
    return [
        (labels, variable.unit.from_si(number) if number == number else None)
        for labels, number in zip(itertools.product(*along), numbers, strict=True)
    ]


def as_json(table: xr.Dataset) -> dict[str, Any]:
    """Return the measures of one run by the keys that their declarations name.

    Args:
        table: Variables of measures, without the dimension run. Those of other measures are absent.
    """
    tree: dict[str, Any] = {}
    for measure in MEASURES.values():
        for variable in measure.variables:
            if variable.json is None or variable.name not in table:
                continue
            for labels, value in labelled_values(table, variable):
                *outer, last = variable.json_keys(labels)
                branch = tree
                for key in outer:
                    branch = branch.setdefault(key, {})
                branch[last] = value
    return tree
