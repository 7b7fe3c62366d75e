"""Coding of the levels -1, 0, 1 as columns of a linear model, and the D-efficiency of designs."""

import itertools
from typing import TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray

Levels: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.int8]]
"""One row per trial, one column per factor; each value is -1, 0 or 1."""

LEVELS = (-1, 0, 1)

MODELS = {"main": 1, "main+2fi": 2}
"""Largest number of factors in a term, by name of the model.

main+2fi has all two-factor interactions.
"""

_MAIN = np.array(
    [[-np.sqrt(1.5), np.sqrt(0.5)], [0.0, -np.sqrt(2.0)], [np.sqrt(1.5), np.sqrt(0.5)]]
)
"""Linear and quadratic contrast of the three levels.

Over equally frequent levels they have mean 0 and mean square 1 and are uncorrelated.
"""


def terms_of(factors: int, model: str) -> list[tuple[int, ...]]:
    """Return the terms of a model as indices of factors: main effects, then interactions."""
    return [
        term
        for size in range(1, MODELS[model] + 1)
        for term in itertools.combinations(range(factors), size)
    ]


def columns(factors: int, model: str) -> int:
    """Return the number of coefficients of a model, including the constant."""
    return 1 + sum(2 ** len(term) for term in terms_of(factors, model))


def level_matrix(factors: int) -> Levels:
    """Return all 3^factors trials; the last factor changes fastest."""
    return np.indices((3,) * factors, dtype=np.int8).reshape(factors, -1).T - np.int8(1)


def model_matrix(levels: Levels, model: str) -> FloatArray:
    """Return the columns (n, p) of a model for n trials.

    There is one column for the constant, two for each main effect and four for each two-factor
    interaction. Over the full factorial they are orthogonal: X'X = n I, and every trial has the
    same leverage.
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
    """Return the D-efficiency 100 det(X'X / n)^(1/p) of a design. [%]

    The full factorial has 100 %, which is an exact upper bound: all its leverages are equal, so by
    the equivalence theorem of Kiefer and Wolfowitz no distribution of trials over the grid has a
    larger determinant. Any other full-rank coding of the same terms has the same D-efficiency. The
    result is 0 if the design does not determine all coefficients.
    """
    if len(levels) < columns(levels.shape[1], model):
        return 0.0
    x = model_matrix(levels, model)
    sign, logarithm = np.linalg.slogdet(x.T @ x / len(x))
    percent = 100.0 * float(np.exp(logarithm / x.shape[1])) if sign > 0 else 0.0
    return percent if percent > 1e-2 else 0.0  # by rounding, a singular matrix is not exactly 0
