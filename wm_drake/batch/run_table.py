"""RunTable: the measures of many runs in one array a variable, filled as the runs end."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.convergence import ACCURACY, Accuracy
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.labels import LABELS

_ALWAYS = ("axis", "sensor", "mount")
"""Dimensions whose labels every table has."""

FEWEST = 64
"""Number of runs that an array has place for at first; it doubles when it is full."""


class RunTable:
    """Table of the measures of runs.

    A run takes the memory of its numbers: its objects need not be kept until all runs have ended.
    """

    def __init__(self, parameters: MachineParameters, measures: Sequence[str]) -> None:
        """Begin an empty table.

        Args:
            parameters: Machine, for the names of the sensors.
            measures: Names of measures, keys of `MEASURES`.
        """
        self.parameters = parameters
        self.variables = [v for name in measures for v in MEASURES[name].variables]
        self._columns: dict[str, FloatArray] = {}
        self._names: np.ndarray = np.empty(0, dtype=object)
        self._accuracy: FloatArray = np.empty((0, len(Accuracy._fields)))
        self._diverged: dict[int, str] = {}
        self._region_counts: set[int] = set()

    def put(
        self, number: int, name: str, values: Mapping[str, FloatArray], diverged: str = ""
    ) -> None:
        """Add the run of a case.

        Args:
            number: Number of the case.
            name: Its name.
            values: Values of the variables of the measures by name, with `ACCURACY`. [SI]
            diverged: When and why the run stopped early; "" if it did not.
        """
        self._names = _with_place(self._names, number)
        self._names[number] = name
        if diverged:
            self._diverged[number] = diverged
        self._accuracy = _with_place(self._accuracy, number)
        self._accuracy[number] = values.get(ACCURACY, np.nan)
        for variable in self.variables:
            value = np.asarray(values[variable.name])
            if "region" in variable.dims:
                self._region_counts.add(len(value))
            column = self._columns.get(variable.name, np.empty((0, *value.shape)))
            if value.shape == column.shape[1:]:  # otherwise `dataset` says what differs
                self._columns[variable.name] = column = _with_place(column, number)
                column[number] = value

    def dataset(self, pairs: Sequence[str] | None = None) -> xr.Dataset:
        """Return the table that `simulate_many` describes, of the runs so far.

        Args:
            pairs: Names of the pairs of shapes, if they are known already.

        Raises:
            InputError: the runs have different numbers of regions.
        """
        numbers = np.flatnonzero(self._names != None)  # noqa: E711
        accuracy = zip(Accuracy._fields, self._accuracy[numbers].T, strict=True)
        used = {dim for variable in self.variables for dim in variable.dims}
        parameters, names = self.parameters, self._names[numbers].astype(str)
        labels: dict[str, Any] = {"run": numbers, "case": ("run", names)}
        labels |= {name: ("run", column) for name, column in accuracy}
        for dim in (*_ALWAYS, "foot", *sorted(used - {"region", "pair"})):
            labels[dim] = list(LABELS[dim](parameters, parameters.profile))
        if not parameters.cabinet:
            del labels["foot"]
        if "region" in used:
            labels["region"] = range(self._region_count())
        if "pair" in used:
            labels["pair"] = list(pairs) if pairs is not None else Scene(parameters).pair_names()
        columns = {}
        is_whole = len(numbers) and numbers[-1] == len(numbers) - 1
        for variable in self.variables:
            shape = (len(numbers), *(len(labels[dim]) for dim in variable.dims))
            column = self._columns.get(variable.name, np.empty(shape))
            values = column[: len(numbers)] if is_whole else column[numbers]
            attributes = {"units": variable.units, "long_name": variable.about}
            columns[variable.name] = (("run", *variable.dims), values.reshape(shape), attributes)
        texts = [self._diverged.get(number, "") for number in numbers.tolist()]
        columns["diverged"] = (("run",), np.array(texts, dtype=object), {})
        return xr.Dataset(columns, labels)

    def _region_count(self) -> int:
        """Return the number of regions, which must be the same for all runs.

        Raises:
            InputError: the runs have different numbers of regions.
        """
        if len(self._region_counts) > 1:
            raise input_error(
                f"the profiles have {' and '.join(map(str, sorted(self._region_counts)))} regions; "
                "all runs of one table need the same number",
                key="profile",
            )
        return next(iter(self._region_counts), 0)


def _with_place(column: np.ndarray, number: int) -> np.ndarray:
    """Return an array with a row for a number, at least twice as long as before if it grows."""
    if number < len(column):
        return column
    longer = np.empty(
        (max(FEWEST, 2 * len(column), number + 1), *column.shape[1:]), dtype=column.dtype
    )
    longer[: len(column)] = column
    return longer
