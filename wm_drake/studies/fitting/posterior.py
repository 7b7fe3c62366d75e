"""Posterior of the unknowns of a problem with priors, from the slopes at its optimum (Laplace)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.fit import Estimate
from wm_drake.studies.fitting.problem import Unknown

DETERMINED, UNDETERMINED = 0.5, 0.9
"""Limits of the ratio of an unknown's standard deviation given the data to that of its prior.

Below the first, the data determine the unknown. Above the second, only the prior does.
"""

NORMAL_95 = 1.959963984540054
"""Half width of a 95 % interval of a normal distribution, in standard deviations."""

AT_BOUND = 1e-2
"""Distance from a bound, as a fraction of the range, within which an unknown is at the bound."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Normal distribution around an optimum, with the residuals linearized there.

    Coordinates are distances from the expected values in standard deviations of the priors.

    Attributes:
        coordinates: (p,) the optimum.
        all_slopes: (n + k, p) derivatives of the residuals: of n values of the data, then of what
            is known beside the priors.
        data_count: Number n.
        unknowns: Unknowns, with their priors and bounds.
    """

    coordinates: FloatArray
    all_slopes: FloatArray
    data_count: int
    unknowns: tuple[Unknown, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimate of each unknown. What the data do not determine, the prior does.

        An interval that would leave the bounds ends there.
        """
        expected, deviation = priors_of(self.unknowns)
        values = expected + self.coordinates * deviation
        reaches = NORMAL_95 * self.spread() * deviation
        return tuple(
            _estimate(unknown, value, reach)
            for unknown, value, reach in zip(
                self.unknowns, values.tolist(), reaches.tolist(), strict=True
            )
        )

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the unknowns (p, p). [SI]"""
        deviation = priors_of(self.unknowns)[1]
        return self.spread_matrix() * np.outer(deviation, deviation)

    @property
    def slopes(self) -> FloatArray:
        """Derivatives (n, p) of the residuals of the data."""
        return self.all_slopes[: self.data_count]

    def spread(self) -> FloatArray:
        """Return the standard deviation of each unknown given the data, in prior deviations. (p,)

        It is 1 if the data contain no information about the unknown.
        """
        return np.asarray(np.sqrt(np.diag(self.spread_matrix())))

    def spread_matrix(self, scatter: float = 1.0) -> FloatArray:
        """Return the covariance (p, p) of the coordinates given the data.

        Args:
            scatter: Standard deviation of the residuals of the data. It is 1 if they scatter as
                assumed.
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


def _estimate(unknown: Unknown, value: float, reach: float) -> Estimate:
    lower, upper = unknown.lower, unknown.upper
    near = AT_BOUND * (upper - lower)
    at_bound = "lower" if value - lower < near else "upper" if upper - value < near else ""
    interval = max(value - reach, lower), min(value + reach, upper)
    return Estimate(
        unknown.name, value, *((np.nan, np.nan) if at_bound else interval), True, at_bound
    )


def priors_of(unknowns: Sequence[Unknown]) -> tuple[FloatArray, FloatArray]:
    """Return expected values and standard deviations of unknowns that all have a prior. [SI]"""
    expected, deviation = np.reshape([unknown.prior for unknown in unknowns], (-1, 2)).T
    return expected, deviation
