"""Uncertainty of an optimum of the envelope distance: delete-one-curve jackknife.

The samples of one measured curve depend on each other, because the envelopes are smooth. So the
curves (one sensor with one load), not the samples, are taken as the independent data. Each curve is
left out once, and the optimum without it is found. With m curves and optima d_i,

    s^2 = (m - 1) / m sum (d_i - mean d)^2,   95 % interval: +- t(m - 1) s

The curves are linear functions of the damping near the optimum, r + J d, so that an optimum without
a curve needs no further runs: it minimizes a sum of 2-norms, one for each load.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import t as student

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import NormProblem

CONFIDENCE = 0.95

FEWEST_CURVES = 3
"""Smallest number of curves for which an interval is given."""

STEP = 0.01
"""Step of the central differences, in units of the region."""


@dataclass(frozen=True)
class Interval:
    """Confidence interval of an optimum.

    Attributes:
        best: The optimum for which it holds. [SI]
        low, high: Ends of the 95 % intervals, at most at the bounds of the region. [SI]
        curves: Number of curves.
    """

    best: FloatArray
    low: FloatArray
    high: FloatArray
    curves: int


def jackknife_interval(problem: NormProblem, best: FloatArray) -> Interval | None:
    """Return the confidence interval of an optimum.

    Args:
        best: The optimum (p,). [SI]

    Returns:
        The interval; None if there are fewer than three curves, or if the model fails beside the
        optimum.
    """
    m, p = len(problem.curves), len(problem.unknowns)
    lower, upper = (
        np.array([getattr(unknown, side) for unknown in problem.unknowns])
        for side in ("lower", "upper")
    )
    width = upper - lower
    steps = STEP * np.diag(width)
    sides = np.clip(np.concatenate([best + steps, best - steps]), lower, upper)
    residuals = problem.evaluate(np.concatenate([best[None], sides]))
    if m < FEWEST_CURVES or not np.isfinite(residuals).all():
        return None
    spans = [(sides[k] - sides[p + k])[k] / width[k] for k in range(p)]
    slopes = np.array([(residuals[1 + k] - residuals[1 + p + k]) / spans[k] for k in range(p)])
    moments = [_moments(residuals[0, where], slopes[:, where].T) for _, where in problem.curves]
    groups = [group for group, _ in problem.curves]
    optima = np.array(
        [
            _optimum(moments[:out] + moments[out + 1 :], groups[:out] + groups[out + 1 :])
            for out in range(m)
        ]
    )
    spread = np.sqrt((m - 1) / m * np.sum((optima - optima.mean(axis=0)) ** 2, axis=0))
    half = float(student.ppf(0.5 + 0.5 * CONFIDENCE, m - 1)) * spread * width
    return Interval(best, np.clip(best - half, lower, upper), np.clip(best + half, lower, upper), m)


def _moments(residual: FloatArray, slope: FloatArray) -> FloatArray:
    """Return [r J]' [r J], which has all that the norm of r + J d depends on."""
    whole = np.column_stack([residual, slope])
    return np.asarray(whole.T @ whole)


def _optimum(moments: Sequence[FloatArray], groups: Sequence[str]) -> FloatArray:
    """Return the step d that minimizes the sum over the groups of |r + J d|."""
    sums = [
        np.sum([m for m, name in zip(moments, groups, strict=True) if name == group], axis=0)
        for group in dict.fromkeys(groups)
    ]

    def distance(step: FloatArray) -> float:
        whole = np.append(1.0, step)
        return float(sum(np.sqrt(max(whole @ total @ whole, 0.0)) for total in sums))

    together = np.sum(sums, axis=0)
    start = -np.linalg.lstsq(together[1:, 1:], together[1:, 0], rcond=None)[0]
    options = {"xatol": 1e-7, "fatol": 0.0, "maxiter": 4000}
    return np.asarray(minimize(distance, start, method="Nelder-Mead", options=options).x)
