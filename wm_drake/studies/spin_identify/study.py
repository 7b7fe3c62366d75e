"""Identification of parameters from vibrations of the whole machine in a spin cycle.

[A] section 4.2 identifies the parameters of its Table 8 in this way.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.parameters.units import Share
from wm_drake.parameters.vary import Entry
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.blocks import Block, BlockModel
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.fitting.free_numbers import (
    FreeNumbers,
    free_numbers,
    free_numbers_of_texts,
)
from wm_drake.studies.fitting.problem import Errors
from wm_drake.studies.spin_cycle.measured import DIMS
from wm_drake.studies.spin_cycle.study import RECORDED, labels_of, runs_of

PLANTED = (0.8, 1.25)
"""Range of the ratio of true number to machine's number in a virtual experiment."""

RESIDUAL = Quantity("residual", Share(), 2)

TABLE_8 = (
    ("bushing_types.connecting.friction_torque_y",),
    ("bushing_types.connecting.full_friction_rate_y",),
    ("gasket.rotational_stiffness_x", "gasket.rotational_stiffness_z"),
    ("gasket.rotational_stiffness_y",),
    ("gasket.friction_torque_x", "gasket.friction_torque_y", "gasket.friction_torque_z"),
    ("gasket.full_friction_rate_x", "gasket.full_friction_rate_y", "gasket.full_friction_rate_z"),
)
"""Keys of the numbers that [A] could identify from the whole machine only.

They are the friction about the axis of its bushings and all rotational numbers of the gasket.
"""


def unknowns_of(parameters: MachineParameters, texts: Sequence[str]) -> FreeNumbers:
    """Return the unknowns of KEYS[=RANGE] texts, or those of [A] Table 8 if there are none.

    Raises:
        InputError: a key or a range is wrong, or the machine does not have the numbers of Table 8.
    """
    if texts:
        return free_numbers_of_texts(parameters, texts, "identified")
    if not parameters.bushing_types or parameters.gasket is None:
        raise input_error(
            f"machine '{parameters.name}' does not have the numbers of [A] Table 8; give keys "
            "of this machine",
            where="--unknown",
        )
    entries = {"+".join(keys): Entry(keys=keys) for keys in TABLE_8}
    return free_numbers(parameters, entries, "identified")


def planted_values(free: FreeNumbers, seed: int) -> FloatArray:
    """Draw true numbers of a virtual experiment; all differ from the machine's. In SI units."""
    low, high = np.log(PLANTED)
    count = len(free.unknowns)
    drawn = np.random.default_rng(seed).uniform(0.3, 1.0, count) * np.where(
        np.arange(count) % 2, low, high
    )
    return np.clip(free.guesses * np.exp(drawn), 1.02 * free.lower, 0.98 * free.upper)


@dataclass(frozen=True, eq=False)
class SpinModel(BlockModel):
    """RMS displacements of unbalance cases as a function of the unknowns: a block for each case.

    The residuals are those of [A] Eq. (9): each value is divided by the norm of the measured values
    in its case and region. Its error is a part of the value, so each has a variance of its own.

    Attributes:
        sensors: Accelerometer and axis of each sensor.
        measured: (case, region, accelerometer, axis) RMS displacements; NaN where nothing was
            measured. [m]
    """

    profile: SpinProfile
    cases: tuple[UnbalanceCase, ...]
    measured: xr.DataArray

    misfit = RESIDUAL

    @property
    def errors(self) -> Errors:
        """Return what the errors are like: each is a part of the value."""
        return "each"

    @cached_property
    def with_data(self) -> list[int]:
        """Indices of the cases of which something was measured."""
        return [k for k, values in enumerate(self.measured.values) if np.nanmax(values, initial=0)]

    @cached_property
    def blocks(self) -> list[Block]:
        """Return the measured values of each case."""
        blocks, regions = [], self.measured.region.values.tolist()
        for index in self.with_data:
            values = self.measured.values[index].reshape(len(regions), -1)
            norms = np.sqrt(np.nansum(values**2, axis=1, keepdims=True))
            sizes = np.broadcast_to(norms, values.shape)
            blocks.append(Block(f"case {self.cases[index].name}", regions, values, sizes))
        return blocks

    def computed(self, points: FloatArray) -> list[list[FloatArray]]:
        """Return the RMS displacements of each case with data at each point. [m]"""
        regions = self.measured.sizes["region"]
        return [
            [of_point[index].reshape(regions, -1) for index in self.with_data]
            for of_point in self.displacements(points)
        ]

    def displacements(self, points: FloatArray) -> FloatArray:
        """Compute the RMS displacements at points.

        Args:
            points: (k, unknowns) in SI units.

        Returns:
            (k, case, region, accelerometer, axis); NaN where a run diverged. [m]
        """
        labels = {"point": range(len(points)), "case": [case.name for case in self.cases]}
        runs = self.experiment.over(labels, self._runs(points))
        name = RECORDED if RECORDED in runs else "region_displacement"
        return np.asarray(runs[name].values)

    def _runs(self, points: FloatArray) -> Iterator[Case]:
        for point in points:
            parameters = self.free.parameters_at(point)
            for run in runs_of(parameters, self.cases, self.profile):
                yield replace(run, parameters=parameters)

    def missed(self, data: xr.Dataset) -> dict[str, float]:
        """Return the mean errors of single values, as in [A] Table 9: mean of those of the cases.

        They are `before` and `after` the search.
        """
        single = abs(data[["before", "after"]] - data.measured) / data.measured
        of_cases = single.where(data.measured > 0.0).groupby("block").mean(...)
        return {str(name): float(of_case.mean()) for name, of_case in of_cases.items()}


def spin_model(
    experiment: Experiment,
    free: FreeNumbers,
    profile: SpinProfile,
    cases: Sequence[UnbalanceCase],
    measured: xr.DataArray | None = None,
) -> SpinModel:
    """Return the model of unbalance cases; without measured values for a virtual experiment."""
    parameters = experiment.machine.parameters
    labels = labels_of(parameters, cases, profile)
    sensors = [f"{name} {axis}" for name in labels["accelerometer"] for axis in labels["axis"]]
    if measured is None:
        measured = xr.DataArray(np.full([*map(len, labels.values())], np.nan), labels, DIMS)
    return SpinModel(experiment, free, sensors, profile, tuple(cases), measured)


def with_virtual_experiment(
    model: SpinModel, planted: FloatArray, noise: float, seed: int
) -> SpinModel:
    """Return a model with simulated measurements: those of true numbers, with random errors.

    Args:
        planted: True numbers of the unknowns, in SI units.
        noise: Relative standard deviation of the error of each value.
    """
    exact = model.displacements(planted[None])[0]
    errors = np.random.default_rng(seed).standard_normal(exact.shape)
    return replace(model, measured=model.measured.copy(data=exact * (1.0 + noise * errors)))
