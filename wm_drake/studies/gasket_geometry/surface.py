"""Response surface of polynomials of degree two, and what each factor contributes."""

import itertools
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray

SPARE = 3
"""Runs beyond the number of coefficients that a surface of degree two needs."""


def basis(levels: FloatArray, degree: int) -> FloatArray:
    """Return polynomials that are orthogonal for even levels from -1 to 1. (n, terms)

    They are 1, x_i, and for degree two (3 x_i^2 - 1)/2 and x_i x_j.
    """
    count = levels.shape[1]
    columns = [np.ones(len(levels)), *levels.T]
    if degree == 2:
        columns += [0.5 * (3.0 * x * x - 1.0) for x in levels.T]
        columns += [levels[:, i] * levels[:, j] for i, j in itertools.combinations(range(count), 2)]
    return np.column_stack(columns)


@dataclass(frozen=True)
class Surface:
    """Response surface.

    Attributes:
        factors: Number of factors.
        degree: Degree: 1, or 2 if there are enough runs.
        coefficients: Of the columns of `basis`. (terms,)
    """

    factors: int
    degree: int
    coefficients: FloatArray

    def at(self, levels: FloatArray) -> FloatArray:
        """Return the response at levels. (n, factors) to (n,)"""
        return np.asarray(basis(levels, self.degree) @ self.coefficients)

    def contributions(self, sample: FloatArray) -> FloatArray:
        """Return the part of each factor in the variance, and that of all pairs. (factors + 1,)

        Args:
            sample: Levels over which the variance is taken. (n, factors)
        """
        count, terms = self.factors, basis(sample, self.degree) * self.coefficients
        main = terms[:, 1 : count + 1]
        if self.degree == 2:
            main = main + terms[:, count + 1 : 2 * count + 1]
        pairs = terms[:, 2 * count + 1 :].sum(axis=1) if self.degree == 2 else np.zeros(len(terms))
        parts = np.append(main.var(axis=0), pairs.var())
        total = float(parts.sum())
        return parts / total if total else parts


def fit(levels: FloatArray, response: FloatArray) -> Surface:
    """Return the least-squares surface of runs at levels (n, factors).

    The square of a factor with two levels is constant: it has the coefficient 0.
    """
    terms = basis(levels[:1], 2).shape[1]
    degree = 2 if len(levels) >= terms + SPARE else 1
    columns = basis(levels, degree)
    columns[:, 1:] *= np.ptp(columns[:, 1:], axis=0) > 1e-12
    coefficients = np.linalg.lstsq(columns, response, rcond=None)[0]
    return Surface(levels.shape[1], degree, np.asarray(coefficients))
