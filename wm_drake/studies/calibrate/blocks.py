"""Fit numbers of a machine to measured values of its runs, in blocks.

A block has values of each sensor at places, such as drum speeds, regions or times, of one load, one
recording or one case. A model of blocks computes them as a function of the unknowns. `calibrate
RECORD`, `study spin-identify` and `study gasket-damping` fit such models.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import Quantity
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.free_numbers import FreeNumbers
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import (
    SMOOTH,
    Descent,
    Errors,
    FitProblem,
    Measurement,
    ModelValues,
    Progress,
    Unknown,
)
from wm_drake.studies.fitting.search import silent


@dataclass(frozen=True, eq=False)
class Block:
    """Measured values at places (or times) of sensors (m, k). [SI]

    Attributes:
        name: Name of the load, the recording or the case.
        deviation: Standard deviations of the values, or sizes by which residuals are divided.
        baseline: Columns of each sensor that may be added, offset and drift; None without.
    """

    name: str
    places: Sequence[str]
    measured: FloatArray
    deviation: FloatArray
    baseline: FloatArray | None = None

    @cached_property
    def valid(self) -> np.ndarray:
        """Which values there are. (m, k)"""
        return np.isfinite(self.measured) & (self.deviation > 0.0)


@dataclass(frozen=True, eq=False)
class BlockModel(ABC):
    """Measured values of runs as a function of unknowns of the machine.

    Attributes:
        experiment: Runs of the machine.
        free: Unknowns of the machine.
        sensors: Names of the sensors.
        misfit: Quantity of a residual by its deviation.
        most_misfit: Largest RMS of these of a model with the right structure.
        descent: How finely a search goes down.
    """

    experiment: Experiment
    free: FreeNumbers
    sensors: Collection[str]

    misfit: ClassVar[Quantity]
    most_misfit: ClassVar[float] = np.inf
    descent: ClassVar[Descent] = SMOOTH

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Return all unknowns, those of the machine first."""
        return self.free.unknowns

    @property
    @abstractmethod
    def blocks(self) -> Sequence[Block]:
        """Return the data."""

    @property
    def errors(self) -> Errors:
        """Return what the errors of the values of a sensor are like."""
        return "correlated"

    @abstractmethod
    def computed(self, points: FloatArray) -> list[list[FloatArray]]:
        """Return what is computed of each block (m, k) at each point; NaN where a run failed."""

    def missed(self, data: xr.Dataset) -> dict[str, float]:
        """Return by how much the values are missed `before` and `after` the search, as a part."""
        errors = {name: data[f"error_{name}"].values for name in ("before", "after")}
        return {name: float(np.sqrt(np.nanmean(each**2))) for name, each in errors.items()}

    def apart(self, rmse: float) -> str:
        """Return the RMS of the residuals by their deviations in words."""
        return f"with an RMSE of {self.misfit.text(rmse)}"

    def problem(self) -> FitProblem:
        """Return the problem of all unknowns: a measurement for each sensor of each block.

        Raises:
            InputError: no sensor has a value.
        """
        tests = []
        for block in self.blocks:
            name = "" if len(self.blocks) == 1 else f"{block.name}, "
            for k, sensor in enumerate(self.sensors):
                used = block.valid[:, k]
                if used.any():
                    values = block.measured[used, k] / block.deviation[used, k]
                    base = None if block.baseline is None else block.baseline[used]
                    test = Measurement(f"{name}{sensor}", values, base, errors=self.errors)
                    tests.append(test)
        if not tests:
            raise input_error("no sensor has a measured value above 0 to fit")
        return FitProblem(self.unknowns, tuple(tests), self._values, self.descent)

    def _values(self, points: FloatArray) -> ModelValues:
        """Return the computed values of all measurements, in their deviations."""
        rows = [
            np.concatenate(
                [
                    (computed[block.valid[:, k], k] / block.deviation[block.valid[:, k], k])
                    for block, computed in zip(self.blocks, of_point, strict=True)
                    for k in range(len(self.sensors))
                ]
            )
            for of_point in self.computed(points)
        ]
        known = self.free.known(points[:, : len(self.free.unknowns)])
        return ModelValues(np.stack(rows), known=known)


def calibrated(
    model: BlockModel,
    seed: int,
    progress: Progress = silent,
    starts: int = 2,
    problem: FitProblem | None = None,
) -> tuple[Fit, xr.Dataset]:
    """Fit the unknowns of a model to its blocks.

    Args:
        progress: Called with the fraction done and the least misfit so far.
        starts: Number of searches at most.
        problem: The problem of the model, if it is made already.

    Returns:
        The fit; and over place and sensor, in SI: `measured`, its `deviation`, `before` and `after`
        the search, and the residual `misfit` after it, by the deviation; values over time without
        their offset and drift. Over place the name of its `block`. Over sensor: `error_before` and
        `error_after`, RMS of the difference by that of the measured values.

    Raises:
        InputError: no sensor has a value.
    """
    problem = problem or model.problem()
    fit = identify(problem, seed=seed, starts=starts, screened=8, progress=progress)
    start = problem.points_at(problem.start)
    before, after = model.computed(np.stack([start, fit.values]))
    parts = map(_compared, model.blocks, before, after)
    data = xr.concat(parts, "place").assign_coords(sensor=list(model.sensors))
    for name in ("before", "after"):
        missed = np.sqrt(((data[name] - data.measured) ** 2).sum("place"))
        size = np.sqrt((data.measured.where(data[name].notnull()) ** 2).sum("place"))
        data[f"error_{name}"] = missed / size.where(size > 0.0)
    misfit = (data.after - data.measured) / data.deviation
    return fit, data.assign(misfit=model.misfit.variable(("place", "sensor"), misfit))


def _compared(block: Block, before: FloatArray, after: FloatArray) -> xr.Dataset:
    """Return measured and computed values of a block over place and sensor."""
    masked = np.where(block.valid, 1.0, np.nan)
    values = {"measured": block.measured, "before": before, "after": after}
    kept = {key: _without_baseline(block, values_ * masked) for key, values_ in values.items()}
    kept["deviation"] = block.deviation * masked
    places = {"place": list(block.places), "block": ("place", [block.name] * len(block.places))}
    return xr.Dataset({key: (("place", "sensor"), v) for key, v in kept.items()}, places)


def _without_baseline(block: Block, values: FloatArray) -> FloatArray:
    """Return values (m, k) less their offset and drift, if a block has a baseline."""
    if block.baseline is None:
        return values
    result = values.copy()
    for k in range(values.shape[1]):
        used = np.isfinite(values[:, k])
        base = block.baseline[used]
        amount = np.linalg.lstsq(base, values[used, k], rcond=None)[0] if used.any() else 0.0
        result[used, k] -= base @ amount if used.any() else 0.0
    return result
