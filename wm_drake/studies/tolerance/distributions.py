"""Distributions of uncertain quantities, as functions of standard normal scores.

A sample is a point z of independent standard normal scores. Correlated scores are L z with the
Cholesky factor L of the correlation matrix (Gaussian copula), and each quantity is the quantile of
its distribution at the probability of its score. It is independent of machines.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from wm_drake.parameters.types import FloatArray

LARGEST_SCORE = 7.0
"""Bound of the normal scores; a larger one has a probability of 1.3e-12.

Every quantity is checked at its ends, which a bound makes finite for every distribution.
"""


@dataclass(frozen=True)
class Marginal:
    """The distribution of one quantity.

    Attributes:
        frozen: Distribution of scipy, of the quantity or of its logarithm.
        is_log: Whether it is that of the logarithm.
    """

    frozen: Any
    is_log: bool = False

    def values(self, scores: FloatArray) -> FloatArray:
        """Return the quantity at standard normal scores."""
        bounded = np.clip(scores, -LARGEST_SCORE, LARGEST_SCORE)
        # the upper tail keeps its digits if it is taken as a lower tail
        quantiles = np.where(
            bounded < 0.0,
            self.frozen.ppf(stats.norm.cdf(np.minimum(bounded, 0.0))),
            self.frozen.isf(stats.norm.cdf(-np.maximum(bounded, 0.0))),
        )
        return np.exp(quantiles) if self.is_log else quantiles


def normal(
    mean: float, deviation: float, low: float = -math.inf, high: float = math.inf
) -> Marginal:
    """Return a normal distribution, truncated if an end is finite.

    Args:
        mean, deviation: Of the distribution before it is truncated. deviation > 0
        low, high: Ends. low < high
    """
    if math.isinf(low) and math.isinf(high):
        return Marginal(stats.norm(mean, deviation))
    ends = (low - mean) / deviation, (high - mean) / deviation
    return Marginal(stats.truncnorm(*ends, loc=mean, scale=deviation))


def lognormal(mean: float, deviation: float, low: float = 0.0, high: float = math.inf) -> Marginal:
    """Return a lognormal distribution with a given mean and standard deviation.

    With the mean m and deviation d of the quantity, its logarithm is normal with variance
    s^2 = ln(1 + (d/m)^2) and mean ln(m) - s^2/2.

    Args:
        mean, deviation: Of the distribution before it is truncated. > 0
        low, high: Ends. low < high
    """
    variance = math.log1p((deviation / mean) ** 2)
    ends = (math.log(low) if low > 0.0 else -math.inf, math.log(high))
    of_log = normal(math.log(mean) - 0.5 * variance, math.sqrt(variance), *ends)
    return Marginal(of_log.frozen, is_log=True)


def uniform(low: float, high: float) -> Marginal:
    """Return a uniform distribution between two ends, low < high."""
    return Marginal(stats.uniform(low, high - low))


def triangular(low: float, mode: float, high: float) -> Marginal:
    """Return a triangular distribution, low <= mode <= high and low < high."""
    return Marginal(stats.triang((mode - low) / (high - low), low, high - low))


@dataclass(frozen=True)
class Joint:
    """The distribution of all quantities.

    Attributes:
        marginals: Distribution of each quantity.
        factor: Lower Cholesky factor of the correlation matrix of the scores; None if the
            quantities are independent.
    """

    marginals: tuple[Marginal, ...]
    factor: FloatArray | None = None

    @property
    def size(self) -> int:
        """Number of quantities."""
        return len(self.marginals)

    def values(self, scores: FloatArray) -> FloatArray:
        """Return the quantities at independent standard normal scores. (n, size)"""
        correlated = scores if self.factor is None else scores @ self.factor.T
        columns = [m.values(correlated[:, i]) for i, m in enumerate(self.marginals)]
        return np.column_stack(columns)


def scores_of(probabilities: FloatArray) -> FloatArray:
    """Return the standard normal scores of probabilities between 0 and 1."""
    return np.clip(stats.norm.ppf(probabilities), -LARGEST_SCORE, LARGEST_SCORE)


def base_samples(size: int, count: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return two independent sets of scores (count, size), from one scrambled Sobol sequence.

    With the same seed, the first rows of a larger set are those of a smaller one. The second set is
    for Sobol indices ([Saltelli 2010], matrices A and B).

    Args:
        size: Number of quantities.
        count: Number of samples, a power of two.
    """
    sequence = stats.qmc.Sobol(2 * size, scramble=True, seed=np.random.default_rng(seed))
    both = scores_of(sequence.random(count))
    return both[:, :size], both[:, size:]
