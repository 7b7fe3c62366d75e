"""Posterior of the unknowns of a problem with priors, from the slopes at its optimum (Laplace)."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray

DETERMINED, UNDETERMINED = 0.5, 0.9
"""Limits of the ratio of an unknown's standard deviation given the data to that of its prior.

Below the first, the data determine the unknown. Above the second, only the prior does.
"""

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
    """

    coordinates: FloatArray
    all_slopes: FloatArray
    data_count: int

    @property
    def slopes(self) -> FloatArray:
        """Derivatives (n, p) of the residuals of the data."""
        return self.all_slopes[: self.data_count]

    def spread(self) -> FloatArray:
        """Return the standard deviation of each unknown given the data, in prior deviations. (p,)

        It is 1 if the data contain no information about the unknown.
        """
        return np.asarray(np.sqrt(np.diag(self.covariance())))

    def covariance(self, scatter: float = 1.0) -> FloatArray:
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


def least_needed_out(
    slopes: FloatArray, point: FloatArray, count: int
) -> tuple[np.ndarray, FloatArray]:
    """Choose the unknowns that stay free, in the linearised fit.

    At its minimum the cost is a quadratic function with the curvature H = J^T J + 1. If coordinate
    i goes to 0 and the others follow, it rises by x_i^2 / (2 (H^-1)_ii). The one with the least
    rise goes first.

    Args:
        slopes: (n, p) derivatives J of the residuals with respect to the coordinates.
        point: (p,) coordinates x of the minimum.
        count: Number of coordinates that stay free.

    Returns:
        Indices of those, rising (count,), and their values at the minimum without the others
        (count,).
    """
    kept, x = np.arange(len(point)), np.array(point)
    curvature = slopes.T @ slopes + np.eye(len(point))
    while len(kept) > count:
        covariance = np.linalg.inv(curvature)
        out = int(np.argmin(x**2 / np.diag(covariance)))
        x = x - covariance[:, out] / covariance[out, out] * x[out]
        kept, x = np.delete(kept, out), np.delete(x, out)
        curvature = np.delete(np.delete(curvature, out, axis=0), out, axis=1)
    return kept, x
