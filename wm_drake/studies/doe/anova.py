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
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import fdtrc

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.threads import on_one_thread

LARGEST_LEVERAGE = 1.0 - 1e-9
"""Leverage above which a trial cannot be left out: the others do not determine the model."""

Combination = tuple[int, ...]
"""One level for each factor of a term."""


@dataclass(frozen=True)
class Term:
    """Contribution, test and effects of one term of the model.

    Attributes:
        factors: Names of the factors; one for a main effect, two for an interaction.
        share: Contribution: mean square of the effects over all level combinations, as a part of
            the total variance there.
        sum_sq: Sum of squares of type III over the trials. [unit of the response, squared]
        df: Degrees of freedom.
        f, p: F statistic against the residual and its p-value. They are meaningful only if the
            residual is noise.
        effects: By level combination: deviation from the prediction by all terms of lower order.
            [unit of the response]
    """

    factors: tuple[str, ...]
    share: float
    sum_sq: float
    df: int
    f: float
    p: float
    effects: dict[Combination, float]

    @property
    def name(self) -> str:
        """Names of the factors, joined by a colon."""
        return ":".join(self.factors)


@dataclass(frozen=True)
class AnovaTable:
    """Analysis of variance of one response.

    Attributes:
        constant: Mean over all level combinations. [unit of the response]
        terms: Main effects, then interactions, in the order of the factors.
        main, interaction, unexplained: Contributions of all main effects, all interactions and the
            residual; they sum to 1. If there are as many coefficients as trials, the residual is
            unknown: NaN, and the other two sum to 1.
        total_sum_sq, residual_sum_sq: Sums of squares over the trials, about the mean and about the
            fit. [unit of the response, squared]
        residual_df: Degrees of freedom of the residual.
        adjusted_r2: Explained part of the variance, adjusted for the degrees of freedom; NaN
            without any. At most 1.
        predicted_r2: Part of the variance that the model predicts of trials that are left out, one
            at a time; NaN without degrees of freedom. At most 1; negative if the mean predicts
            better than the model.
        fitted, residual: (trials,) fitted value and residual. [unit of the response]
    """

    constant: float
    terms: tuple[Term, ...]
    main: float
    interaction: float
    unexplained: float
    total_sum_sq: float
    residual_sum_sq: float
    residual_df: int
    adjusted_r2: float
    predicted_r2: float
    fitted: FloatArray
    residual: FloatArray


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
        """The covariance of the coefficients for responses of unit variance."""
        return np.asarray(self.inverse @ self.inverse.T)

    @functools.cached_property
    def leverages(self) -> FloatArray:
        """The diagonal of the hat matrix. (trials,)"""
        return np.asarray(np.einsum("ij,ji->i", self.matrix, self.inverse))

    @functools.cached_property
    def rank(self) -> int:
        """The number of coefficients that the design determines."""
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

    def effects(self, term: tuple[str, ...], coefficients: FloatArray) -> dict[Combination, float]:
        """Return the effects of a term at all its level combinations, from its coefficients."""
        table = coefficients.reshape([self.codes[name].shape[1] for name in term])
        for axis, name in enumerate(term):
            table = np.moveaxis(np.tensordot(self.codes[name], table, axes=(1, axis)), 0, axis)
        combinations = itertools.product(*(self.levels[name] for name in term))
        return dict(zip(combinations, map(float, table.ravel()), strict=True))


def _sum_code(levels: int) -> FloatArray:
    """Return the sum-to-zero code (levels, levels - 1) of one factor, as in R and patsy.

    There is one column for each level except the last. The row of the last level is -1.
    """
    return np.vstack([np.eye(levels - 1), -np.ones(levels - 1)])


@on_one_thread
def anova(
    levels: pd.DataFrame, responses: pd.DataFrame, interactions: bool = True
) -> dict[str, AnovaTable]:
    """Return the analysis of variance of each response.

    Args:
        levels: One row per trial, one column per factor.
        responses: One row per trial, one column per response.
        interactions: Whether the model has two-factor interactions.

    Returns:
        Tables by name of the response. If a response is constant, all its contributions are NaN.
    """
    coding = SumCoding(levels, interactions)
    return {
        str(name): _analysed(coding, responses[name].to_numpy(dtype=float))
        for name in responses.columns
    }


def _analysed(coding: SumCoding, response: FloatArray) -> AnovaTable:
    params = coding.inverse @ response
    fitted = coding.matrix @ params
    residual = response - fitted
    df_resid, ssr = len(response) - coding.rank, float(residual @ residual)
    total = float(np.sum((response - response.mean()) ** 2))
    noise = ssr / df_resid if df_resid > 0 else np.nan
    effects = {
        term: coding.effects(term, params[columns]) for term, columns in coding.columns.items()
    }
    variances = {
        term: float(np.mean(np.square(list(values.values())))) for term, values in effects.items()
    }
    unexplained = coding.residual_variance(ssr)
    variance = sum(variances.values()) + (0.0 if math.isnan(unexplained) else unexplained)
    # the variance of a constant response is not 0 but about 1e-32 of its square, by rounding
    scale = 1.0 / variance if variance > 1e-20 * float(np.mean(response**2)) else np.nan
    terms = []
    for term, columns in coding.columns.items():
        df, coefficients = columns.stop - columns.start, params[columns]
        sum_sq = float(
            coefficients @ np.linalg.solve(coding.covariance[columns, columns], coefficients)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            f = float(np.divide(sum_sq / df, noise))
        p = float(fdtrc(df, df_resid, f)) if df_resid > 0 else np.nan
        terms.append(Term(term, scale * variances[term], sum_sq, df, f, p, effects[term]))
    adjusted_r2 = predicted_r2 = math.nan
    if math.isfinite(scale) and df_resid:
        adjusted_r2 = 1.0 - (len(response) - 1) / df_resid * (ssr / total)
        if np.max(coding.leverages) <= LARGEST_LEVERAGE:  # else a trial alone determines a term
            press = np.sum((residual / (1.0 - coding.leverages)) ** 2)
            predicted_r2 = 1.0 - float(press) / total
    return AnovaTable(
        constant=float(params[0]),
        terms=tuple(terms),
        main=sum(term.share for term in terms if len(term.factors) == 1),
        interaction=sum(term.share for term in terms if len(term.factors) > 1),
        unexplained=scale * unexplained,
        total_sum_sq=total,
        residual_sum_sq=ssr,
        residual_df=df_resid,
        adjusted_r2=adjusted_r2,
        predicted_r2=predicted_r2,
        fitted=fitted,
        residual=residual,
    )
