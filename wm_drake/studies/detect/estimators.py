"""Estimators: from the features of a hold to what a controller wants to know.

A user's own is a function that fits and returns the function that predicts:

    def fit(features, values):                  # (draws, features) with labels, (draws,)
        least = features.sel(feature="torque")
        ...
        return lambda features: ...             # (draws,)

    register_estimator(Estimator("mine", fit))

or an entry point of the group `wm_drake.estimators`; `--estimator mine` chooses it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.parameters.types import FloatArray
from wm_drake.registry import Registry

Predict: TypeAlias = Callable[[xr.DataArray], FloatArray]
"""Function of features (draws, features) that returns estimates (draws,)."""


@dataclass(frozen=True)
class Estimator:
    """A way to estimate a number from features.

    Attributes:
        name: Name for `--estimator`.
        fit: Function of features and of the true values of the same draws; it returns the function
            that predicts. All values are finite.
    """

    name: str
    fit: Callable[[xr.DataArray, FloatArray], Predict]


@dataclass(frozen=True)
class LinearFit:
    """A constant and a coefficient for each feature, in SI.

    Attributes:
        coefficients: By the names of the features.
    """

    constant: float
    coefficients: dict[str, float]

    def __call__(self, features: xr.DataArray) -> FloatArray:
        """Return the estimates. (draws,)"""
        values = features.sel(feature=list(self.coefficients)).values
        return np.asarray(self.constant + values @ np.array(list(self.coefficients.values())))


NEGLIGIBLE = 1e-6
"""Singular value, of standardized features, over the largest one, below which they are one."""


def fit_linear(features: xr.DataArray, values: FloatArray) -> LinearFit:
    """Return the fit of a constant and the features by linear least squares."""
    columns = features.values
    middle, spread = columns.mean(axis=0), columns.std(axis=0)
    scale = np.where(spread > 0.0, spread, 1.0)
    solved = np.linalg.lstsq((columns - middle) / scale, values - values.mean(), rcond=NEGLIGIBLE)
    coefficients = solved[0] / scale
    names = features["feature"].values.tolist()
    constant = float(values.mean() - middle @ coefficients)
    return LinearFit(constant, dict(zip(names, coefficients.tolist(), strict=True)))


LINEAR = Estimator("linear", fit_linear)

ESTIMATORS: Registry[Estimator] = Registry(
    "estimator", "wm_drake.estimators", [f"{__name__}:LINEAR"]
)
"""Estimators by name."""


def register_estimator(estimator: Estimator) -> Estimator:
    """Add an estimator of the study of detection, and return it.

    Raises:
        ValueError: another estimator has this name.

    Example:
        >>> from wm_drake.studies.detect.estimators import LINEAR, register_estimator
        >>> register_estimator(LINEAR).name
        'linear'
    """
    return ESTIMATORS.register(estimator)


def estimated(
    estimator: Estimator, features: xr.DataArray, values: FloatArray, is_fitted: np.ndarray
) -> tuple[Predict, FloatArray]:
    """Return what an estimator learns from some draws, and its estimates of all.

    A draw without features, because its hold failed, has no estimate: NaN.

    Args:
        values: True values, NaN where they are unknown. (draws,)
        is_fitted: Draws of the fit; the others judge it.
    """
    is_seen = np.isfinite(features.values).all(axis=1)
    chosen = is_seen & is_fitted & np.isfinite(values)
    predict = estimator.fit(features[chosen], values[chosen])
    estimates = np.full(len(values), np.nan)
    estimates[is_seen] = predict(features[is_seen])
    return predict, estimates
