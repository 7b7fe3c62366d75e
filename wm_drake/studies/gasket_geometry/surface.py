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

    def contributions(self) -> FloatArray:
        """Return the part of each factor in the variance, and that of all pairs. (factors + 1,)

        The variance is that for levels evenly distributed from -1 to 1: the polynomials are
        orthogonal, and their mean squares are 1/3, 1/5 and 1/9.
        """
        count, squares = self.factors, self.coefficients[1:] ** 2
        main = squares[:count] / 3.0
        pairs = 0.0
        if self.degree == 2:
            main = main + squares[count : 2 * count] / 5.0
            pairs = float(squares[2 * count :].sum()) / 9.0
        total = float(main.sum()) + pairs
        return np.append(main, pairs) / total if total else np.zeros(count + 1)


def fit(levels: FloatArray, response: FloatArray) -> Surface:
    """Return the least-squares surface of runs at levels (n, factors)."""
    terms = basis(levels[:1], 2).shape[1]
    degree = 2 if len(levels) >= terms + SPARE else 1
    coefficients = np.linalg.lstsq(basis(levels, degree), response, rcond=None)[0]
    return Surface(levels.shape[1], degree, np.asarray(coefficients))
