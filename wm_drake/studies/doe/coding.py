"""Levels -1, 0, 1 -> columns of a linear model, and how well a design determines its coefficients."""

import itertools
from typing import TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray

Levels: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.int8]]
"""A trial a row, a factor a column, each -1, 0 or 1."""

LEVELS = (-1, 0, 1)

MODELS = {"main": 1, "main+2fi": 2}
"""Models by name: the most factors that a term may join. main+2fi has all two-factor interactions."""

_MAIN = np.array(
    [[-np.sqrt(1.5), np.sqrt(0.5)], [0.0, -np.sqrt(2.0)], [np.sqrt(1.5), np.sqrt(0.5)]]
)
"""Linear and quadratic contrast of the three levels: mean 0, mean square 1, uncorrelated over equally frequent levels."""


def terms_of(factors: int, model: str) -> list[tuple[int, ...]]:
    """The terms of a model without its constant, as factor numbers: main effects, then interactions."""
    return [
        term
        for size in range(1, MODELS[model] + 1)
        for term in itertools.combinations(range(factors), size)
    ]


def columns(factors: int, model: str) -> int:
    """Number of coefficients of a model, constant included."""
    return 1 + sum(2 ** len(term) for term in terms_of(factors, model))


def level_matrix(factors: int) -> Levels:
    """All 3^factors trials, the last factor changing fastest."""
    return np.indices((3,) * factors, dtype=np.int8).reshape(factors, -1).T - np.int8(1)


def model_matrix(levels: Levels, model: str) -> FloatArray:
    """The columns (n, p) of a model: constant, two for each main effect, four for each interaction of two.

    Orthonormal over the full factorial: there X'X = n I, and every trial has the same leverage.
    """
    main = [_MAIN[levels[:, factor].astype(int) + 1] for factor in range(levels.shape[1])]
    blocks = [np.ones((len(levels), 1))]
    for term in terms_of(levels.shape[1], model):
        product = np.ones((len(levels), 1))
        for factor in term:
            product = (product[:, :, None] * main[factor][:, None, :]).reshape(len(levels), -1)
        blocks.append(product)
    return np.hstack(blocks)


def efficiency(levels: Levels, model: str) -> float:
    """D-efficiency of a design against the best there can be: det(X'X / n)^(1/p). [%]

    100 is an exact bound, that of the full factorial: its leverages are all the same, so by the equivalence theorem of Kiefer
    and Wolfowitz no distribution of trials over the grid has a larger determinant. Any other full-rank coding of the same
    terms gives the same number. 0 for a design that leaves some coefficient undetermined.
    """
    if len(levels) < columns(levels.shape[1], model):
        return 0.0
    x = model_matrix(levels, model)
    sign, logarithm = np.linalg.slogdet(x.T @ x / len(x))
    found = 100.0 * float(np.exp(logarithm / x.shape[1])) if sign > 0 else 0.0
    return found if found > 1e-2 else 0.0  # a singular matrix has a determinant of rounding errors
