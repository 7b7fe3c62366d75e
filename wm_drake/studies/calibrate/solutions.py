"""Solutions of a calibration: errors, uncertainties, distinct solutions, and their machines."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report.quantity import Quantity
from wm_drake.studies.calibrate.parameter_map import ParameterMap
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.fitting.fit import DETERMINED, UNDETERMINED, Fit

GOOD = 1.25
"""Largest ratio of the mean error of a good solution to that of the best solution."""

DISTINCT = 0.5
"""Least distance between distinct solutions: RMS over the quantities, in prior deviations."""


DIFFERENCE = Quantity("difference", Share(), 1)
BEYOND = Quantity("difference", Share(), form="{:+.0f}".format)
LIMIT = Quantity("limit", Share(), form="{:g}".format)
COST = Quantity("cost", decimals=1)
VALUE = Quantity("value")
"""Value of a free quantity, in its own unit."""


def sizes_of(errors: FloatArray) -> tuple[float, float]:
    """Return mean and largest absolute value of errors; NaN values are ignored, NaN of none."""
    if not errors.size:
        return np.nan, np.nan
    sizes = np.abs(errors)
    return float(np.nanmean(sizes)), float(np.nanmax(sizes))


def sizes_text(errors: FloatArray) -> str:
    """Return mean and largest absolute value of relative errors as words."""
    mean, largest = map(DIFFERENCE.text, sizes_of(errors))
    return f"mean {mean}, largest {largest}"


@dataclass(frozen=True)
class Solution:
    """The end point of a search.

    Attributes:
        parameter_map: Map from the free quantities to the machine.
        targets: Targets of the search.
        fit: Fit of the free quantities, at the end of the search.
        amplitude: (case, sensor) computed amplitudes. [m]
        responses: (response) other computed responses. [unit for reading]
        data_cost, prior_cost: Half the sums of squares of data and prior.
    """

    parameter_map: ParameterMap
    targets: Targets
    start: int
    fit: Fit
    amplitude: FloatArray
    responses: FloatArray
    data_cost: float
    prior_cost: float

    @property
    def point(self) -> FloatArray:
        """Return the values of the free quantities (n). [SI]"""
        return self.fit.values

    @property
    def cost(self) -> float:
        """Return the cost that the search minimizes: the sum of data cost and prior cost."""
        return self.data_cost + self.prior_cost

    @property
    def coordinates(self) -> FloatArray:
        """Point in units of the prior: (quantity - expected) / deviation. (n)"""
        return self.fit.linear.point

    @property
    def errors(self) -> FloatArray:
        """(computed - measured) / measured (case, sensor); NaN where the weight is 0."""
        return self.targets.errors(self.amplitude)

    @property
    def response_errors(self) -> FloatArray:
        """(computed - target) / target (response); NaN where the weight is 0."""
        return self.targets.response_errors(self.responses)

    def verdicts(self) -> list[str]:
        """Return what determines each quantity: "data", "prior", "data and prior" or "bound"."""
        at_bound = np.array([estimate.at_bound != "" for estimate in self.fit.estimates])
        spread = self.fit.remaining
        cases = [at_bound, spread < DETERMINED, spread > UNDETERMINED]
        return list(map(str, np.select(cases, ["bound", "data", "prior"], "data and prior")))

    def values_beyond(self) -> list[str]:
        """Return a text for each value beyond its limit, such as ``middle Xf +23 % (20 %)``."""
        targets = self.targets
        loads = [f"{name}{'' if gasket else ' without gasket'}" for name, gasket in targets.loads]
        names = [f"{load} {sensor}" for load in loads for sensor in targets.sensors]
        names += [
            f"{t.load} {t.response.name}{f' {t.of}' if t.is_linear else ''}"
            for t in targets.responses
        ]
        errors = np.concatenate([self.errors.ravel(), self.response_errors])
        used = [(name, e) for name, e in zip(names, errors, strict=True) if e == e]
        return [
            f"{name} {BEYOND.text(error)} ({LIMIT.text(limit)})"
            for (name, error), limit in zip(used, targets.limit_of_each(), strict=True)
            if abs(error) > limit
        ]


def distinct(solutions: list[Solution]) -> list[Solution]:
    """Return the good solutions, best first, without those that are close to a better one."""
    ordered = sorted(solutions, key=lambda solution: solution.cost)
    limit = GOOD * sizes_of(ordered[0].errors)[0]
    kept: list[Solution] = []
    for solution in ordered:
        far = all(
            np.sqrt(np.mean((solution.coordinates - other.coordinates) ** 2)) > DISTINCT
            for other in kept
        )
        if far and sizes_of(solution.errors)[0] <= limit:
            kept.append(solution)
    return kept


def solved_machine(solution: Solution, number: int = 0) -> MachineParameters:
    """Return the machine of a solution.

    Args:
        number: Number of the solution, for the name of the machine; 0 keeps the name.
    """
    ending = f"_calibrated_{number}" if number else ""
    return solution.parameter_map.machine_of(solution.fit, ending)
