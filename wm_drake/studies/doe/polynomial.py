"""Polynomial models of trials at any levels, fitted by least squares.

With the columns X of the terms, n different trials, p coefficients and the residual variance
s^2 = SSR / (n - p), a coefficient b_j has the standard error s sqrt(c_jj), c = (X' X)^-1, and its
term the partial sum of squares b_j^2 / c_jj: what the residual grows by without it. The leverage of
a trial is the diagonal of X c X'; the predicted R2 leaves each trial out once, as in `anova`.

A simulation has no noise. Repeated trials give the same responses, so the pure error is zero and
all of the residual is lack of fit.
"""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.special import fdtrc, stdtrit

from wm_drake.errors import check_known, input_error, shortened
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.doe.anova import LARGEST_LEVERAGE
from wm_drake.studies.threads import on_one_thread

POLYNOMIALS = ("linear", "linear+2fi", "quadratic")
"""Named models: first powers, with products of two factors, with these and squares."""

CONSTANT = "constant"
LARGEST_POWER = 4
_TERM = re.compile(r"\s*[:*]\s*")


@dataclass(frozen=True)
class Polynomial:
    """Terms of a model.

    Attributes:
        name: As the user wrote it.
        terms: Names, such as C_L, C_L:K_Lx or C_L^2, the constant first.
        powers: Power of each factor in each term. (terms, factors)
    """

    name: str
    terms: tuple[str, ...]
    powers: np.ndarray

    def columns(self, levels: FloatArray) -> FloatArray:
        """Return the columns of the model. (trials, terms)"""
        return np.asarray(np.prod(levels[:, None, :] ** self.powers, axis=-1), dtype=float)


def polynomial(model: str, factors: Sequence[str]) -> Polynomial:
    """Return the model of a name of `POLYNOMIALS`, or of terms such as "C_L, C_L:K_Lx, K_Lx^2".

    Raises:
        InputError: a term has an unknown factor or no whole power.

    Example:
        >>> polynomial("a, a:b, b^2", ["a", "b"]).powers.tolist()
        [[0, 0], [1, 0], [1, 1], [0, 2]]
    """
    one = np.eye(len(factors), dtype=int)
    pairs = [one[i] + one[j] for i, j in itertools.combinations(range(len(factors)), 2)]
    rows = list(one)
    if model in POLYNOMIALS:
        rows += pairs if model != "linear" else []
        rows += list(2 * one) if model == "quadratic" else []
    else:
        rows = [_powers(term, factors) for term in model.split(",") if term.strip()]
    powers = np.array([np.zeros(len(factors), dtype=int), *rows])
    powers = powers[np.sort(np.unique(powers, axis=0, return_index=True)[1])]
    return Polynomial(model, tuple(_term(row, factors) for row in powers), powers)


def _powers(term: str, factors: Sequence[str]) -> np.ndarray:
    powers = np.zeros(len(factors), dtype=int)
    for part in _TERM.split(term.strip()):
        name, _, power = part.partition("^")
        check_known(
            name.strip(),
            factors,
            f"'{shortened(term.strip(), 40)}' is no model ({', '.join(POLYNOMIALS)}) and no term "
            "of the factors",
            where="--model",
        )
        if power and not (power.strip().isdigit() and 1 <= int(power) <= LARGEST_POWER):
            message = f"'{part}' has no whole power from 1 to {LARGEST_POWER}"
            raise input_error(message, where="--model")
        powers[factors.index(name.strip())] += int(power or 1)
    return powers


def _term(powers: np.ndarray, factors: Sequence[str]) -> str:
    named = [(name, power) for name, power in zip(factors, powers.tolist(), strict=True) if power]
    return ":".join(n if p == 1 else f"{n}^{p}" for n, p in named) or CONSTANT


@dataclass(frozen=True)
class PolynomialDesign:
    """A design with levels of the user, and the model that is fitted to it.

    Attributes:
        kind: Name of its file.
        factors: Names of the factors, one for each column of `levels`.
        levels: One row per trial, without repeated ones; -1 and 1 are the ends of a factor's range.
        model: The model.
    """

    kind: str
    factors: tuple[str, ...]
    levels: FloatArray
    model: Polynomial

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.levels)

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the model."""
        return len(self.model.terms)


def check_determined(design: PolynomialDesign) -> None:
    """Raise an InputError if trials do not determine a model, or leave nothing to test it.

    The message names the terms that cannot be told apart, and a model that the trials determine.
    """
    mixed = _undetermined(design)
    if not mixed and design.trials > design.coefficients:
        return
    what = f"{design.trials} different trials"
    if mixed:
        names = ", ".join(mixed[:6]) + (", ..." if len(mixed) > 6 else "")
        rank = int(np.linalg.matrix_rank(design.model.columns(design.levels)))
        message = (
            f"{what} determine {rank} of the {design.coefficients} coefficients of "
            f"{design.model.name}; these cannot be told apart: {names}"
        )
    else:
        message = (
            f"{what} for {design.coefficients} coefficients of {design.model.name} leave no degree "
            "of freedom, so nothing shows how well the model fits"
        )
    smaller = largest_polynomial(design.factors, design.levels)
    hint = f"--model {smaller}" if smaller else "fewer terms with --model"
    raise input_error(f"{message}; add other trials, or use {hint}", where=design.kind)


def largest_polynomial(factors: tuple[str, ...], levels: FloatArray) -> str:
    """Return the largest named model that trials determine and test; "" if there is none."""
    for name in reversed(POLYNOMIALS):
        design = PolynomialDesign("", factors, levels, polynomial(name, factors))
        if design.trials > design.coefficients and not _undetermined(design):
            return name
    return ""


def _undetermined(design: PolynomialDesign) -> list[str]:
    """Return the terms that are combinations of each other in the trials."""
    columns = design.model.columns(design.levels)
    sizes = np.linalg.norm(columns, axis=0)
    _, values, rows = np.linalg.svd(columns / np.where(sizes > 0.0, sizes, 1.0))
    rank = int(np.sum(values > 1e-9 * values[0]))
    is_mixed = (np.abs(rows[rank:]) > 1e-6).any(axis=0)
    return [term for term, mixed in zip(design.model.terms, is_mixed, strict=True) if mixed]


@on_one_thread
def fitted_polynomial(
    model: Polynomial, levels: FloatArray, values: FloatArray, confidence: float = 0.95
) -> xr.Dataset:
    """Return the fit of a model to responses of trials.

    Args:
        levels: (trials, factors)
        values: (trials, responses)
        confidence: Probability of the interval of a coefficient.

    Returns:
        Over `response` and `term`: `coefficient`, `half_width` of its interval, `share`, its
        partial sum of squares over the total one; `f` and `p` of its F test against the residual,
        with `df` and `residual_df` degrees of freedom. Over `response`: `residual_deviation` s,
        `r2`, `adjusted_r2` and `predicted_r2`; the last one is NaN if a trial alone determines a
        coefficient. Over `trial`: `leverage`; with `response` too `fitted` and `residual`.
    """
    columns = model.columns(levels)
    inverse = np.linalg.pinv(columns)
    coefficients = inverse @ values
    fitted, leverage = columns @ coefficients, np.einsum("ij,ji->i", columns, inverse)
    residual, variances = values - fitted, np.einsum("ij,ij->i", inverse, inverse)
    count, freedom = len(levels), len(levels) - len(model.terms)
    ssr, total = np.sum(residual**2, axis=0), np.sum((values - values.mean(axis=0)) ** 2, axis=0)
    noise = ssr / freedom
    partial = coefficients**2 / variances[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        left = residual / np.where(leverage < LARGEST_LEVERAGE, 1.0 - leverage, np.nan)[:, None]
        r2 = 1.0 - ssr / total
        variables = {
            "coefficient": (("term", "response"), coefficients),
            "half_width": (
                ("term", "response"),
                stdtrit(freedom, 0.5 + 0.5 * confidence) * np.sqrt(noise * variances[:, None]),
            ),
            "share": (("term", "response"), partial / total),
            "df": ("term", np.ones(len(model.terms))),
            "f": (("term", "response"), partial / noise),
            "p": (("term", "response"), fdtrc(1, freedom, partial / noise)),
            "residual_df": ((), float(freedom)),
            "residual_deviation": ("response", np.sqrt(noise)),
            "r2": ("response", r2),
            "adjusted_r2": ("response", 1.0 - (1.0 - r2) * (count - 1) / freedom),
            "predicted_r2": ("response", 1.0 - np.sum(left**2, axis=0) / total),
            "leverage": ("trial", leverage),
            "fitted": (("trial", "response"), fitted),
            "residual": (("trial", "response"), residual),
        }
    return xr.Dataset(variables, {"term": list(model.terms)})
