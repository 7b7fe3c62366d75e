"""Solutions of a calibration: errors, uncertainties, and the choice of distinct solutions."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.targets import Targets
from wm_drake.studies.fitting.posterior import Posterior

GOOD = 1.25
"""Largest ratio of the mean error of a good solution to that of the best solution."""

DISTINCT = 0.5
"""Least distance between distinct solutions: RMS over the quantities, in prior deviations."""


@dataclass(frozen=True)
class Solution:
    """The end point of a search.

    Attributes:
        start: Number of the start.
        point: (n) values of the free quantities, in SI units.
        amplitude: (case, sensor) computed amplitudes. [m]
        responses: (response) other computed responses. [unit for reading]
        data_cost, prior_cost: Half the sums of squares of data and prior.
        posterior: Normal distribution around the point, in units of the prior.
        evaluations: Number of points that the search evaluated.
    """

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

    def response_errors(self, targets: Targets) -> FloatArray:
        """Return (computed - target) / target (response); NaN where the weight is 0."""
        values = np.array([target.value for target in targets.responses])
        return np.where(targets.response_weight > 0.0, self.responses / values - 1.0, np.nan)

    def errors(self, targets: Targets) -> FloatArray:
        """Return (computed - measured) / measured (case, sensor); NaN where the weight is 0."""
        return np.where(targets.weight > 0.0, self.amplitude / targets.amplitude - 1.0, np.nan)


def distinct(solutions: list[Solution], targets: Targets) -> list[Solution]:
    """Return the good solutions, best first, without those that are close to a better one."""
    ordered = sorted(solutions, key=lambda solution: solution.cost)
    limit = GOOD * float(np.nanmean(np.abs(ordered[0].errors(targets))))
    kept: list[Solution] = []
    for solution in ordered:
        far = all(
            np.sqrt(np.mean((solution.coordinates - other.coordinates) ** 2)) > DISTINCT
            for other in kept
        )
        if far and np.nanmean(np.abs(solution.errors(targets))) <= limit:
            kept.append(solution)
    return kept
