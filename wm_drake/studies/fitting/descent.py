"""Least squares from one point within the unit cube: scipy's trust-region reflective method."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy import optimize

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import rmse
from wm_drake.studies.fitting.search import Optimum

STEP = 1e-5
"""Step of one-sided differences during a search, in ranges."""

ResidualFunction: TypeAlias = Callable[[FloatArray], FloatArray]
"""Points in coordinates (k, p) -> residuals (k, n)."""


def descended(
    evaluate: ResidualFunction,
    begin: FloatArray,
    step_done: Callable[[float], None] = lambda fraction: None,
    most: int = 60,
) -> Optimum:
    """Return where a search ends, with its RMSE as cost.

    Args:
        evaluate: Residuals of the problem.
        begin: First point (p,), moved a little into the cube.
        step_done: Called before every step with the fraction of a usual search.
        most: Evaluations of the residuals at most, without those of derivatives.
    """
    steps = 0
    last: tuple[FloatArray, FloatArray] = (np.full(len(begin), np.nan), np.empty(0))

    def residuals(z: FloatArray) -> FloatArray:
        nonlocal last
        last = (z.copy(), np.asarray(evaluate(z[None])[0]))
        return last[1]

    def jacobian(z: FloatArray) -> FloatArray:
        nonlocal steps
        steps += 1
        step_done(min(1.0, steps / 25))
        here = last[1] if np.array_equal(z, last[0]) else evaluate(z[None])[0]
        sign = np.where(z > 0.5, -1.0, 1.0)
        moved = evaluate(z + np.diag(STEP * sign))
        return np.asarray(((moved - here) / (STEP * sign)[:, None]).T)

    end = optimize.least_squares(
        residuals,
        np.clip(begin, 1e-4, 1.0 - 1e-4),
        jacobian,
        bounds=(0.0, 1.0),
        x_scale=1.0,
        ftol=1e-9,
        xtol=1e-9,
        gtol=1e-14,
        max_nfev=most,
    )
    return Optimum(end.x, float(rmse(end.fun)))
