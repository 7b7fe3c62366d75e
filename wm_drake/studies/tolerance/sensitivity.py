"""Sobol indices: which uncertain quantity causes how much of the variance of a measure.

It is independent of machines. The samples are those of A. Saltelli et al., Variance based
sensitivity analysis of model output, Computer Physics Communications 181 (2010) 259: matrices A and
B, and A with one column of B for each quantity.
"""

import numpy as np
from scipy import stats

from wm_drake.parameters.types import FloatArray

RESAMPLES = 400
"""Number of bootstrap samples."""

PERCENTILES = (2.5, 97.5)
"""Ends of a 95 % interval."""


def exchanged(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return all scores that Sobol indices need besides A: B, then A with each column of B.

    Args:
        a, b: Independent samples. (n, d)

    Returns:
        ((d + 1) n, d)
    """
    parts = [b]
    for column in range(a.shape[1]):
        mixed = a.copy()
        mixed[:, column] = b[:, column]
        parts.append(mixed)
    return np.concatenate(parts)


def sobol_indices(
    at_a: FloatArray, at_exchanged: FloatArray, *, seed: int = 0
) -> dict[str, FloatArray] | None:
    """Return the Sobol indices of each quantity.

    The intervals are percentiles of a bootstrap over the rows of the samples.

    Args:
        at_a: Measure at the rows of A. (n,) n is a power of two.
        at_exchanged: Measure at the rows of `exchanged`. ((d + 1) n,)

    Returns:
        For each quantity (d,): `first`, the share of the variance that it causes alone, `total`,
        alone and together with others, and the ends of their 95 % intervals, `first_lower` and so
        on. None if the measure is not finite at a row or does not vary.
    """
    n = len(at_a)
    parts = at_exchanged.reshape(-1, n)
    if not (np.isfinite(at_a).all() and np.isfinite(parts).all()) or np.ptp(at_a) == 0.0:
        return None
    random = np.random.default_rng(seed)
    rows = [np.arange(n), *(random.integers(n, size=n) for _ in range(RESAMPLES))]
    twice = np.concatenate([parts[1:], parts[-1:]])  # scipy fails on a single quantity
    estimates = []
    for row in rows:
        values = {"f_A": at_a[None, row], "f_B": parts[:1, row], "f_AB": twice[:, None, row]}
        result = stats.sobol_indices(func=values, n=n)
        estimates.append([result.first_order[:-1], result.total_order[:-1]])
    indices = np.array(estimates)  # (resample, first or total, quantity)
    lower, upper = np.percentile(indices[1:], PERCENTILES, axis=0)
    ends = {"": indices[0], "_lower": lower, "_upper": upper}
    return {
        f"{name}{end}": values[place]
        for place, name in enumerate(("first", "total"))
        for end, values in ends.items()
    }
