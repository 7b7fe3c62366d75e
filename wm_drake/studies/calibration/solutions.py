"""What a calibration found: solutions, how good and how sure they are, and which are really different."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.targets import Targets

GOOD = 1.25
"""A solution is good if its mean error is at most so many times the best one's."""

DISTINCT = 0.5
"""Solutions are distinct if they differ by so many prior deviations, in the root mean square over the quantities."""

DETERMINED, UNDETERMINED = 0.5, 0.9
"""A quantity is determined by the data if they cut its deviation to less than this part of the prior's; by the prior alone if
they leave more than the second."""

AT_BOUND = 1e-2
"""So near to a bound, in parts of the range, a quantity counts as lying on it."""


@dataclass(frozen=True)
class Solution:
    """A point where a search ended.

    Attributes:
        start: Number of the start it came from.
        point: Of the free quantities. (n) [SI]
        coordinates: The same in units of the prior: (quantity - expected) / deviation. (n)
        amplitude: Computed. (case, sensor) [m]
        data_cost, prior_cost: Halves of the sums of squares.
        slopes: Of the data's residuals over the coordinates. (m, n)
        evaluations: Points that were evaluated on the way.
    """

    start: int
    point: FloatArray
    coordinates: FloatArray
    amplitude: FloatArray
    data_cost: float
    prior_cost: float
    slopes: FloatArray
    evaluations: int

    @property
    def cost(self) -> float:
        """What the search makes small."""
        return self.data_cost + self.prior_cost

    def errors(self, targets: Targets) -> FloatArray:
        """(computed - measured) / measured, (case, sensor); NaN where the target has no weight."""
        return np.where(targets.weight > 0.0, self.amplitude / targets.amplitude - 1.0, np.nan)

    def spread(self) -> FloatArray:
        """Standard deviation of each quantity given the data, in parts of the prior's: 1 where the data say nothing. (n)

        Of the normal distribution about the point in which the amplitudes' logarithms are linear.
        """
        information = self.slopes.T @ self.slopes + np.eye(len(self.coordinates))
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))

    def directions(self) -> FloatArray:
        """How many times better than the prior the data know each principal direction, falling; as many above 1 as count."""
        return np.asarray(np.linalg.svd(self.slopes, compute_uv=False))


def distinct(solutions: list[Solution], targets: Targets) -> list[Solution]:
    """The good solutions, best first, without those that are near a better one."""
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
