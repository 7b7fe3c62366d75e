"""Analysis of variance of factors at a few levels: contribution and effects of each term.

The coding is sum-to-zero: the constant is the mean over all level combinations, and the effects of
a term sum to zero over the levels of each of its factors. Fits are least-squares fits.

A contribution is the variance of a term's effects over the grid of all level combinations, as a
fraction of the total variance there. On the full factorial it equals the ratio of the term's sum of
squares to the total one, for all types of sums of squares. On other designs, sums of squares of
type III do not add up to the total, and those of type I depend on the order of the terms.
Contributions by variance and the residual add up to 100 % on any design.

The variance of the residual over the grid is estimated from the n trials with the degrees of
freedom that p coefficients leave, and with the finite number N of level combinations:

    s^2 = SSR / (n - p) (1 - p / N)

It is SSR / n on the full factorial (n = N), where nothing is estimated. Repeated trials show noise,
which has no grid: N is infinite then.

All these numbers describe the trials of the design. How well the model predicts a trial that it has
not seen is the predicted R2. It leaves each trial out once (PRESS: prediction error sum of
squares), by the leverages h of the hat matrix:

    R2_predicted = 1 - sum (e_i / (1 - h_i))^2 / SST
"""

import functools
import itertools
import math
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy.special import fdtrc

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.threads import on_one_thread

LARGEST_LEVERAGE = 1.0 - 1e-9
"""Leverage above which a trial cannot be left out: the others do not determine the model."""

DIMENSIONS = {
    **dict.fromkeys(("constant", "main", "interaction", "unexplained"), ()),
    **dict.fromkeys(("total_sum_sq", "residual_sum_sq", "residual_df"), ()),
    **dict.fromkeys(("adjusted_r2", "predicted_r2"), ()),
    **dict.fromkeys(("share", "sum_sq", "df", "f", "p"), ("term",)),
    "effect": ("term", "level", "other_level"),
    **dict.fromkeys(("fitted", "residual"), ("trial",)),
}
"""Dimensions of the variables of an analysis, beside `response`."""


class SumCoding:
    """Sum-coded columns of a design: main effects and, optionally, two-factor interactions."""

    def __init__(self, levels: pd.DataFrame, interactions: bool) -> None:
        """Compute the columns for a design.

        Args:
            levels: One row per trial and one column per factor. Levels are hashable and sortable,
                and each factor has at least two.
            interactions: Whether the model has two-factor interactions.
        """
        self.levels = {str(name): sorted(set(levels[name])) for name in levels.columns}
        self.codes = {name: _sum_code(len(values)) for name, values in self.levels.items()}
        indices = {
            name: levels[name].map({v: i for i, v in enumerate(values)})
            for name, values in self.levels.items()
        }
        names, self.terms, blocks = list(self.levels), [], [np.ones((len(levels), 1))]
        for size in (1, 2) if interactions else (1,):
            for term in itertools.combinations(names, size):
                block = np.ones((len(levels), 1))
                for name in term:
                    code = self.codes[name][indices[name].to_numpy()]
                    block = (block[:, :, None] * code[:, None, :]).reshape(len(levels), -1)
                self.terms.append(term)
                blocks.append(block)
        ends = np.cumsum([block.shape[1] for block in blocks])
        self.columns = dict(
            zip(self.terms, itertools.starmap(slice, itertools.pairwise(ends)), strict=True)
        )
        self.matrix = np.hstack(blocks)
        self.residual_df = len(levels) - self.matrix.shape[1]
        self._is_repeated = bool(levels.duplicated().any())
        self._grid_size = math.prod(len(values) for values in self.levels.values())

    @functools.cached_property
    def inverse(self) -> FloatArray:
        """Return the pseudoinverse of the columns, which all responses share."""
        return np.asarray(np.linalg.pinv(self.matrix))

    @functools.cached_property
    def covariance(self) -> FloatArray:
        """Return the covariance of the coefficients for responses of unit variance."""
        return np.asarray(self.inverse @ self.inverse.T)

    @functools.cached_property
    def leverages(self) -> FloatArray:
        """Return the diagonal of the hat matrix. (trials,)"""
        return np.asarray(np.einsum("ij,ji->i", self.matrix, self.inverse))

    @functools.cached_property
    def rank(self) -> int:
        """Return the number of coefficients that the design determines."""
        return int(np.linalg.matrix_rank(self.matrix))

    def residual_variance(self, sum_sq: float) -> float:
        """Return the variance over the grid of what the model does not explain.

        Args:
            sum_sq: Sum of squares of the residual over the trials. [unit of the response, squared]

        Returns:
            The estimate of the module docstring. [unit of the response, squared] NaN without
            degrees of freedom.
        """
        if self.residual_df == 0:
            return math.nan
        unseen = 0.0 if self._is_repeated else self.matrix.shape[1] / self._grid_size
        return sum_sq / self.residual_df * (1.0 - unseen)

    def effects(self, term: tuple[str, ...], coefficients: FloatArray) -> FloatArray:
        """Return the effects of a term at its level combinations. (levels, 1 + levels)

        Those of a main effect are in the first column, those of an interaction in the others; NaN
        elsewhere.

        Args:
            coefficients: Those of the term.
        """
        table = coefficients.reshape([self.codes[name].shape[1] for name in term])
        for axis, name in enumerate(term):
            table = np.moveaxis(np.tensordot(self.codes[name], table, axes=(1, axis)), 0, axis)
        most = max(map(len, self.levels.values()))
        effects = np.full((most, 1 + most), np.nan)
        if table.ndim == 1:
            effects[: len(table), 0] = table
        else:
            effects[: len(table), 1 : 1 + table.shape[1]] = table
        return effects


def _sum_code(levels: int) -> FloatArray:
    """Return the sum-to-zero code (levels, levels - 1) of one factor, as in R and patsy.

    There is one column for each level except the last. The row of the last level is -1.
    """
    return np.vstack([np.eye(levels - 1), -np.ones(levels - 1)])


@on_one_thread
def anova(levels: pd.DataFrame, responses: pd.DataFrame, interactions: bool = True) -> xr.Dataset:
    """Return the analysis of variance of responses.

    Args:
        levels: One row per trial, one column per factor.
        responses: One row per trial, one column per response.
        interactions: Whether the model has two-factor interactions.

    Returns:
        Over `response`, in its unit or the square of it: `constant`, the mean over all level
        combinations; the contributions of all `main` effects, all interactions (`interaction`) and
        the residual (`unexplained`), which sum to 1, NaN if the response is constant; if there are
        as many coefficients as trials, the residual is NaN and the other two sum to 1;
        `total_sum_sq` and `residual_sum_sq` over the trials, about the mean and about the fit;
        `residual_df`, degrees of freedom; `adjusted_r2`, the explained part of the variance,
        adjusted for these, and `predicted_r2`, the part that the model predicts of trials that are
        left out, one at a time: both at most 1, NaN without degrees of freedom; the second is
        negative if the mean predicts better than the model.
        Over `term` too, main effects, then interactions with names such as a:b: `share`, its
        contribution; `sum_sq` of type III over the trials; `df`; `f` and `p`, F statistic against
        the residual and its p-value, meaningful only if the residual is noise.
        `effect` of each term at the `level` of its first factor and `other_level`, 0 for a main
        effect, else 1 and more for the levels of its second factor in rising order: the deviation
        from the prediction by all terms of lower order.
        `fitted` and `residual` of each `trial`.
    """
    coding = SumCoding(levels, interactions)
    analysed = [_analysed(coding, column.to_numpy(dtype=float)) for _, column in responses.items()]
    return xr.Dataset(
        {
            name: (("response", *dims), np.array([numbers[name] for numbers in analysed]))
            for name, dims in DIMENSIONS.items()
        },
        {"response": list(responses.columns), "term": [":".join(term) for term in coding.terms]},
    )


def _analysed(coding: SumCoding, response: FloatArray) -> dict[str, Any]:
    """Return the numbers of `DIMENSIONS` of one response."""
    params = coding.inverse @ response
    fitted = coding.matrix @ params
    residual = response - fitted
    df_resid, ssr = len(response) - coding.rank, float(residual @ residual)
    total = float(np.sum((response - response.mean()) ** 2))
    noise = ssr / df_resid if df_resid > 0 else np.nan
    parts = {term: params[columns] for term, columns in coding.columns.items()}
    effects = [coding.effects(term, part) for term, part in parts.items()]
    variances = [float(np.mean(np.square(of[np.isfinite(of)]))) for of in effects]
    unexplained = coding.residual_variance(ssr)
    variance = sum(variances) + (0.0 if math.isnan(unexplained) else unexplained)
    # the variance of a constant response is not 0 but about 1e-32 of its square, by rounding
    scale = 1.0 / variance if variance > 1e-20 * float(np.mean(response**2)) else np.nan
    sums = [
        float(part @ np.linalg.solve(coding.covariance[columns, columns], part))
        for columns, part in zip(coding.columns.values(), parts.values(), strict=True)
    ]
    df, shares = np.array([len(part) for part in parts.values()]), scale * np.array(variances)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = np.divide(np.array(sums) / df, noise)
    adjusted_r2 = predicted_r2 = math.nan
    if math.isfinite(scale) and df_resid:
        adjusted_r2 = 1.0 - (len(response) - 1) / df_resid * (ssr / total)
        if np.max(coding.leverages) <= LARGEST_LEVERAGE:  # else a trial alone determines a term
            press = np.sum((residual / (1.0 - coding.leverages)) ** 2)
            predicted_r2 = 1.0 - float(press) / total
    is_main = np.array([len(term) == 1 for term in parts], dtype=bool)
    return {
        "constant": params[0],
        "main": sum(shares[is_main].tolist()),
        "interaction": sum(shares[~is_main].tolist()),
        "unexplained": scale * unexplained,
        "total_sum_sq": total,
        "residual_sum_sq": ssr,
        "residual_df": df_resid,
        "adjusted_r2": adjusted_r2,
        "predicted_r2": predicted_r2,
        "share": shares,
        "sum_sq": sums,
        "df": df,
        "f": f,
        "p": fdtrc(df, df_resid, f) if df_resid > 0 else np.full(len(df), np.nan),
        "effect": effects,
        "fitted": fitted,
        "residual": residual,
    }
