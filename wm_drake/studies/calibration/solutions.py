"""Solutions of a calibration: errors, uncertainties, and the choice of distinct solutions."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.parameter_map import ParameterMap
from wm_drake.studies.calibration.targets import Targets
from wm_drake.studies.fitting.posterior import AT_BOUND, DETERMINED, UNDETERMINED, Posterior

GOOD = 1.25
"""Largest ratio of the mean error of a good solution to that of the best solution."""

DISTINCT = 0.5
"""Least distance between distinct solutions: RMS over the quantities, in prior deviations."""


class Percents(NamedTuple):
    """Mean and largest absolute value of relative errors, in percent; NaN without errors."""

    mean: float
    largest: float

    def named(self, prefix: str = "") -> dict[str, float]:
        """Return both by name, such as `mean_percent`, for files."""
        return {f"{prefix}{name}_percent": value for name, value in self._asdict().items()}

    def __str__(self) -> str:
        """Return both as words."""
        return f"mean {self.mean:.1f} %, largest {self.largest:.1f} %"


def percents_of(errors: FloatArray) -> Percents:
    """Return mean and largest absolute value of relative errors; NaN values are ignored."""
    if not errors.size:
        return Percents(np.nan, np.nan)
    sizes = np.abs(errors)
    return Percents(100.0 * float(np.nanmean(sizes)), 100.0 * float(np.nanmax(sizes)))


@dataclass(frozen=True)
class Solution:
    """The end point of a search.

    Attributes:
        parameter_map: Map from the free quantities to the machine.
        targets: Targets of the search.
        point: (n) values of the free quantities, in SI units.
        amplitude: (case, sensor) computed amplitudes. [m]
        responses: (response) other computed responses. [unit for reading]
        data_cost, prior_cost: Half the sums of squares of data and prior.
        posterior: Normal distribution around the point, in units of the prior.
        evaluations: Number of points that the search evaluated.
    """

    parameter_map: ParameterMap
    targets: Targets
    start: int
    point: FloatArray
    amplitude: FloatArray
    responses: FloatArray
    data_cost: float
    prior_cost: float
    posterior: Posterior
    evaluations: int

    @property
    def cost(self) -> float:
        """Cost that the search minimizes: the sum of data cost and prior cost."""
        return self.data_cost + self.prior_cost

    @property
    def coordinates(self) -> FloatArray:
        """Point in units of the prior: (quantity - expected) / deviation. (n)"""
        return self.posterior.coordinates

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
        lower, upper = self.parameter_map.lower, self.parameter_map.upper
        at_bound = np.minimum(self.point - lower, upper - self.point) < AT_BOUND * (upper - lower)
        spread = self.posterior.spread()
        cases = [at_bound, spread < DETERMINED, spread > UNDETERMINED]
        return list(map(str, np.select(cases, ["bound", "data", "prior"], "data and prior")))

    def values_beyond(self) -> list[str]:
        """Return a text for each value beyond its limit, such as ``middle Xf +23 % (20 %)``."""
        targets = self.targets
        loads = [f"{name}{'' if gasket else ' without gasket'}" for name, gasket in targets.loads]
        names = [f"{load} {sensor}" for load in loads for sensor in targets.sensors]
        names += [
            " ".join(filter(None, (target.load, target.response.name, target.factor and target.of)))
            for target in targets.responses
        ]
        errors = np.concatenate([self.errors.ravel(), self.response_errors])
        used = [(name, e) for name, e in zip(names, errors, strict=True) if e == e]
        return [
            f"{name} {100.0 * error:+.0f} % ({100.0 * limit:g} %)"
            for (name, error), limit in zip(used, targets.limit_of_each(), strict=True)
            if abs(error) > limit
        ]


def distinct(solutions: list[Solution]) -> list[Solution]:
    """Return the good solutions, best first, without those that are close to a better one."""
    ordered = sorted(solutions, key=lambda solution: solution.cost)
    limit = GOOD * percents_of(ordered[0].errors).mean
    kept: list[Solution] = []
    for solution in ordered:
        far = all(
            np.sqrt(np.mean((solution.coordinates - other.coordinates) ** 2)) > DISTINCT
            for other in kept
        )
        if far and percents_of(solution.errors).mean <= limit:
            kept.append(solution)
    return kept
