"""Fits of linear models with known slopes, without a machine."""

import numpy as np

from wm_drake.studies.fitting.assessment import assess
from wm_drake.studies.fitting.fit import SearchLog
from wm_drake.studies.fitting.problem import (
    KINKED,
    FitProblem,
    Measurement,
    ModelValues,
    Unknown,
)


def standard(count):
    """Return unknowns with the prior 0 +- 1."""
    return tuple(Unknown(f"x{k}", -9.0, 9.0, prior=(0.0, 1.0)) for k in range(count))


def fit_at(coordinates, slopes, unknowns=None, count=None, wished=None):
    """Return the fit at coordinates of a model whose residuals are in standard deviations.

    Args:
        coordinates: Distances from the expected values in prior deviations.
        slopes: Derivatives of the residuals by the coordinates, those of the data first.
        count: Number of rows of the data, by default all; others are known beside the priors.
        wished: Derivatives of what is wished.
    """
    slopes, unknowns = np.asarray(slopes, dtype=float), unknowns or standard(len(coordinates))
    count = len(slopes) if count is None else count
    problem = None

    def evaluate(points):
        x = problem.coordinates_of(points)
        rows, wish = x @ slopes.T, None if wished is None else x @ np.transpose(wished)
        return ModelValues(rows[:, :count], None, rows[:, count:], wish)

    data = Measurement("m", np.zeros(count), errors="known")
    problem = FitProblem(tuple(unknowns), (data,), evaluate, KINKED)
    return assess(problem, np.asarray(coordinates, dtype=float), SearchLog("by hand"))
