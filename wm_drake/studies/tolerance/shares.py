"""Shares and percentiles of samples, with 95 % intervals. It is independent of machines."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from wm_drake.parameters.types import FloatArray

CONFIDENCE = 0.95

PERCENTILES = (5, 50, 95)
"""Percentiles of a measure that results contain. [%]"""


@dataclass(frozen=True)
class SampleShare:
    """Share of samples with a property.

    Attributes:
        count: Number of samples with the property.
        lower, upper: Ends of the 95 % interval. That of Clopper and Pearson holds in 95 of 100
            repeats at least, in 97 to 99 for rare properties; that of Wilson in 95 on average, in
            89 to 98 where 0.2 to 8 samples with the property are expected, in fewer below that.
    """

    count: int
    samples: int
    lower: float
    upper: float

    @property
    def estimate(self) -> float:
        """Share of the samples."""
        return self.count / self.samples


def share_of(has_property: NDArray[Any], method: str = "exact") -> SampleShare:
    """Return the share of samples with a property, from whether each one has it. (n,)

    Args:
        has_property: Whether each sample has the property. (n,)
        method: Interval: "exact" of Clopper and Pearson, or "wilson".
    """
    count, samples = int(np.sum(has_property)), len(has_property)
    ends = stats.binomtest(count, samples).proportion_ci(CONFIDENCE, method=method)
    return SampleShare(count, samples, float(ends.low), float(ends.high))


def bound_if_none(samples: int) -> float:
    """Return the largest share that `samples` runs without an event leave possible.

    With 95 % confidence the share is at most 1 - 0.05^(1/n), about 3/n (rule of three).
    """
    return float(-np.expm1(np.log(1.0 - CONFIDENCE) / samples))


@dataclass(frozen=True)
class Percentile:
    """Percentile of a measure with the ends of its 95 % interval."""

    value: float
    lower: float
    upper: float


def percentile_of(values: FloatArray, percent: float) -> Percentile:
    """Return a percentile of samples.

    The interval is that of order statistics: it needs no assumption about the distribution.

    Args:
        values: Samples. (n,) They are finite.
        percent: Of the samples that are below. [%]
    """
    ordered, count = np.sort(values), len(values)
    if not count:
        return Percentile(np.nan, np.nan, np.nan)
    ends = stats.binom.ppf([0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE], count, 0.01 * percent)
    low, high = (int(np.clip(end, 0, count - 1)) for end in (ends[0] - 1, ends[1]))
    value = float(np.percentile(ordered, percent))
    return Percentile(value, float(ordered[low]), float(ordered[high]))


def band_of(count: int) -> float:
    """Return the half width of a 95 % band around a distribution function of some samples.

    The inequality of Dvoretzky, Kiefer and Wolfowitz holds for the whole curve at once.
    """
    return float(np.sqrt(np.log(2.0 / (1.0 - CONFIDENCE)) / (2.0 * count)))
