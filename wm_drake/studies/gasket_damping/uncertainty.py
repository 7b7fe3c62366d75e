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

CONFIDENCE = 0.95

FEWEST_CURVES = 3
"""Smallest number of curves for which an interval is given."""

STEP = 0.01
"""Step of the central differences, in units of the region."""


@dataclass(frozen=True)
class Interval:
    """Confidence interval of an optimum.

    Attributes:
        best: The optimum for which it holds.
        low, high: Ends of the 95 % intervals, at most at the bounds of the region.
        curves: Number of curves.
    """

    best: FloatArray
    low: FloatArray
    high: FloatArray
    curves: int


@dataclass(frozen=True)
class Curve:
    """Difference of one curve from its measurement, as a linear function of the unknowns.

    Attributes:
        load: Its load; the curves of a load share a norm.
        residual: (n,) difference at the optimum.
        slope: (n, p) derivatives by the unknowns, in units of the region.
    """

    load: str
    residual: FloatArray
    slope: FloatArray


def difference_points(best: FloatArray, lower: FloatArray, upper: FloatArray) -> list[FloatArray]:
    """Return the points at which the curves are needed: the optimum, then two for each unknown."""
    steps = STEP * np.diag(upper - lower)
    return [best, *np.clip(np.concatenate([best + steps, best - steps]), lower, upper)]


def curves_of(
    differences: Sequence[dict[str, FloatArray]],
    points: Sequence[FloatArray],
    width: FloatArray,
) -> list[Curve]:
    """Return the curves from their differences at the points of `difference_points`.

    Args:
        differences: For each point and load: (curves, n) differences from the measurement.
        points: The points.
        width: Size of the region.
    """
    p, found = len(width), list[Curve]()
    spans = [(points[1 + k] - points[1 + p + k])[k] / width[k] for k in range(p)]
    for load, residuals in differences[0].items():
        for index, residual in enumerate(residuals):
            columns = [
                (differences[1 + k][load][index] - differences[1 + p + k][load][index]) / spans[k]
                for k in range(p)
            ]
            found.append(Curve(load, residual, np.stack(columns, axis=1)))
    return found


def jackknife_interval(
    best: FloatArray, lower: FloatArray, upper: FloatArray, curves: Sequence[Curve]
) -> Interval | None:
    """Return the confidence interval of an optimum; None if there are fewer than three curves."""
    m, width = len(curves), upper - lower
    if m < FEWEST_CURVES:
        return None
    moments = [_moments(curve) for curve in curves]
    loads = [curve.load for curve in curves]
    optima = np.array(
        [
            _optimum(moments[:out] + moments[out + 1 :], loads[:out] + loads[out + 1 :])
            for out in range(m)
        ]
    )
    spread = np.sqrt((m - 1) / m * np.sum((optima - optima.mean(axis=0)) ** 2, axis=0))
    half = float(student.ppf(0.5 + 0.5 * CONFIDENCE, m - 1)) * spread * width
    return Interval(best, np.clip(best - half, lower, upper), np.clip(best + half, lower, upper), m)


def _moments(curve: Curve) -> FloatArray:
    """Return [r J]' [r J], which has all that the norm of r + J d depends on."""
    whole = np.column_stack([curve.residual, curve.slope])
    return np.asarray(whole.T @ whole)


def _optimum(moments: Sequence[FloatArray], loads: Sequence[str]) -> FloatArray:
    """Return the step d that minimizes the sum over the loads of |r + J d|."""
    sums = [
        np.sum([m for m, name in zip(moments, loads, strict=True) if name == load], axis=0)
        for load in dict.fromkeys(loads)
    ]

    def distance(step: FloatArray) -> float:
        whole = np.append(1.0, step)
        return float(sum(np.sqrt(max(whole @ total @ whole, 0.0)) for total in sums))

    together = np.sum(sums, axis=0)
    start = -np.linalg.lstsq(together[1:, 1:], together[1:, 0], rcond=None)[0]
    options = {"xatol": 1e-7, "fatol": 0.0, "maxiter": 4000}
    return np.asarray(minimize(distance, start, method="Nelder-Mead", options=options).x)
