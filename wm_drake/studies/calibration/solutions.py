"""Solutions of a calibration: errors, uncertainties, and the choice of distinct solutions."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.targets import Targets

GOOD = 1.25
"""Largest ratio of the mean error of a good solution to that of the best solution."""

DISTINCT = 0.5
"""Least distance between distinct solutions: RMS over the quantities, in prior deviations."""

DETERMINED, UNDETERMINED = 0.5, 0.9
"""Limits of the ratio of a quantity's standard deviation given the data to that of its prior.

Below the first, the data determine the quantity. Above the second, only the prior does.
"""

AT_BOUND = 1e-2
"""Distance from a bound, as a fraction of the range, within which a quantity is at the bound."""


@dataclass(frozen=True)
class Solution:
    """The end point of a search.

    Attributes:
        start: Number of the start.
        point: (n) values of the free quantities, in SI units.
        coordinates: (n) point in units of the prior: (quantity - expected) / deviation.
        amplitude: (case, sensor) computed amplitudes. [m]
        responses: (response) other computed responses. [unit for reading]
        data_cost, prior_cost: Half the sums of squares of data and prior.
        all_slopes: (m + k, n) derivatives of the residuals with respect to the coordinates: of the
            data, then of what is known beside the priors.
        data_count: Number m of residuals of the data.
        evaluations: Number of points that the search evaluated.
    """

    start: int
    point: FloatArray
    coordinates: FloatArray
    amplitude: FloatArray
    responses: FloatArray
    data_cost: float
    prior_cost: float
    all_slopes: FloatArray
    data_count: int
    evaluations: int

    @property
    def cost(self) -> float:
        """Cost that the search minimizes: the sum of data cost and prior cost."""
        return self.data_cost + self.prior_cost

    @property
    def slopes(self) -> FloatArray:
        """Derivatives (m, n) of the data's residuals with respect to the coordinates."""
        return self.all_slopes[: self.data_count]

    def response_errors(self, targets: Targets) -> FloatArray:
        """Return (computed - wanted) / wanted (response); NaN where the weight is 0."""
        wanted = np.array([target.value for target in targets.responses])
        return np.where(targets.response_weight > 0.0, self.responses / wanted - 1.0, np.nan)

    def errors(self, targets: Targets) -> FloatArray:
        """Return (computed - measured) / measured (case, sensor); NaN where the weight is 0."""
        return np.where(targets.weight > 0.0, self.amplitude / targets.amplitude - 1.0, np.nan)

    def spread(self) -> FloatArray:
        """Return the standard deviation of each quantity given the data, in prior deviations. (n)

        It is 1 if the data contain no information about the quantity. The posterior is approximated
        by a normal distribution around the point, with the logarithms of the amplitudes linearized.
        """
        return np.asarray(np.sqrt(np.diag(self.covariance())))

    def covariance(self, scatter: float = 1.0) -> FloatArray:
        """Return the covariance (n, n) of the coordinates given the data (Laplace approximation).

        The residuals are linearized around the point.

        Args:
            scatter: Standard deviation of the residuals of the data. It is 1 if they scatter as the
                plan assumes.
        """
        slopes = self.all_slopes.copy()
        slopes[: self.data_count] /= scatter
        return np.asarray(np.linalg.inv(slopes.T @ slopes + np.eye(len(self.coordinates))))

    def directions(self) -> FloatArray:
        """Return the singular values of the slopes, in falling order.

        Each one is the ratio of prior deviation to deviation by the data along a principal
        direction. The number of values above 1 is the number of directions that the data determine.
        """
        return np.asarray(np.linalg.svd(self.slopes, compute_uv=False))


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
