"""Fitted model of a screening between the levels: predictions, intervals, checks by runs.

The analysis of variance has an effect for each of the three levels of a factor. Three points
determine one parabola, so the same model is a polynomial in the places x from -1 to 1 of the
factors: with interactions, products of two parabolas. At the levels it gives the fitted values.

With the row r(x) of the sum-coded model, n trials, p coefficients and the residual variance
s^2 = SSR / (n - p), the 95 % interval of the mean has the half width

    t(0.975; n - p) s sqrt(r' (X' X)^-1 r)

and that of a single new run the half width

    t(0.975; n - p) s sqrt(1 + r' (X' X)^-1 r)

A run has no noise: what is random is only where in the range it is. Both intervals hold for
settings like those of the design, not for each single setting.
"""

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import xarray as xr
from scipy.special import stdtrit

from wm_drake.parameters import at_places
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe.anova import AnovaTable, SumCoding
from wm_drake.studies.gasket.screening import Label, Responses, Screening
from wm_drake.studies.gasket.study import GasketTrials, as_responses

CONFIDENCE = 0.95
"""Probability of the intervals."""


def codes(places: FloatArray) -> FloatArray:
    """Return the two sum-coded columns of factors at places from -1 to 1. (..., 2)

    They are parabolas through the codes (1, 0), (0, 1), (-1, -1) of the levels -1, 0 and 1.
    """
    x = np.asarray(places, dtype=float)
    low, middle, high = 0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)
    return np.stack([low - high, middle - high], axis=-1)


def model_rows(places: FloatArray, *, interactions: bool) -> FloatArray:
    """Return the rows of the model: constant, mains, interactions. (n, p)

    Args:
        places: Places of all factors. (n, factors)
        interactions: Whether the model has two-factor interactions.
    """
    of_factors = codes(places)
    count = len(places)
    blocks = [np.ones((count, 1)), of_factors.reshape(count, -1)]
    if interactions:
        for i, j in itertools.combinations(range(places.shape[1]), 2):
            product = of_factors[:, i, :, None] * of_factors[:, j, None, :]
            blocks.append(product.reshape(count, -1))
    return np.concatenate(blocks, axis=1)


def model_row(places: Sequence[float], *, interactions: bool) -> FloatArray:
    """Return the row of the model at places of all factors: constant, mains, interactions. (p,)"""
    row: FloatArray = model_rows(np.array([places], dtype=float), interactions=interactions)[0]
    return row


@dataclass(frozen=True)
class Surfaces:
    """Fitted models of all responses of a screening.

    Attributes:
        interactions: Whether the model has two-factor interactions.
        coefficients: By label: of the row of the model (p,). [unit of the response]
        deviations: By label: residual standard deviation s; NaN without degrees of freedom.
        quantiles: By label: quantile of Student's t for the intervals.
        inverses: By load: (X' X)^-1 of its trials (p, p).
    """

    factors: tuple[str, ...]
    interactions: bool
    coefficients: Mapping[Label, FloatArray]
    deviations: Mapping[Label, float]
    quantiles: Mapping[Label, float]
    inverses: Mapping[str, FloatArray]

    def prediction(self, label: Label, places: Sequence[float]) -> float:
        """Return the fitted response at places of the factors. [unit of the response]"""
        row = model_row(places, interactions=self.interactions)
        return float(row @ self.coefficients[label])

    def half_width(self, label: Label, places: Sequence[float], *, of_run: bool) -> float:
        """Return the half width of the interval of a new run, or of the mean."""
        row = model_row(places, interactions=self.interactions)
        return self._half_width(label, row, of_run=of_run)

    def mean_half_width(self, label: Label, factor: str, place: float) -> float:
        """Return the half width of the mean over all levels of the other factors."""
        row = model_row([0.0] * len(self.factors), interactions=self.interactions) * 0.0
        row[0], at = 1.0, 1 + 2 * self.factors.index(factor)
        row[at : at + 2] = codes(np.array(place))
        return self._half_width(label, row, of_run=False)

    def _half_width(self, label: Label, row: FloatArray, *, of_run: bool) -> float:
        leverage = float(row @ self.inverses[label[0]] @ row)
        scale = self.quantiles[label] * self.deviations[label]
        return scale * math.sqrt(leverage + (1.0 if of_run else 0.0))


def surfaces(screening: Screening) -> Surfaces:
    """Return the fitted models of a screening; its design has three levels of each factor."""
    design = screening.design
    interactions = design.model != "main"
    inverses = {}

    @functools.cache
    def inverse(good: bytes) -> FloatArray:
        rows = design.levels[np.frombuffer(good, dtype=bool)]
        matrix = SumCoding(pd.DataFrame(rows, columns=list(design.factors)), interactions).matrix
        return np.asarray(np.linalg.inv(matrix.T @ matrix))

    for load, values in screening.responses.values.items():
        good = np.isfinite(values.to_numpy()).all(axis=1)
        inverses[load] = inverse(good.tobytes())
    deviations, quantiles = {}, {}
    for label, table in screening.tables.items():
        df = table.residual_df
        deviations[label] = math.sqrt(table.residual_sum_sq / df) if df else math.nan
        quantiles[label] = float(stdtrit(df, 0.5 + 0.5 * CONFIDENCE)) if df else math.nan
    coefficients = {label: _coefficients(table) for label, table in screening.tables.items()}
    return Surfaces(
        tuple(design.factors), interactions, coefficients, deviations, quantiles, inverses
    )


def _coefficients(table: AnovaTable) -> FloatArray:
    """Return the coefficients: of sum-coded columns they are the effects at -1 and 0."""
    coefficients = [table.constant]
    for term in table.terms:
        coefficients += [
            term.effects[at] for at in itertools.product((-1, 0), repeat=len(term.factors))
        ]
    return np.array(coefficients)


@dataclass(frozen=True)
class Setting:
    """Setting of the factors that is to be checked.

    Attributes:
        text: As the user wrote it.
        places: A place from -1 to 1 for each factor.
    """

    text: str
    places: tuple[float, ...]


@dataclass(frozen=True)
class Check:
    """Settings with their predictions and runs.

    Attributes:
        responses: Responses of the runs, one row per setting.
    """

    settings: tuple[Setting, ...]
    surfaces: Surfaces
    responses: Responses

    def frame(self) -> pd.DataFrame:
        """Return prediction, 95 % half width, run and difference of each setting and response."""
        return self._frame.copy()

    @cached_property
    def _frame(self) -> pd.DataFrame:
        rows = []
        for number, setting in enumerate(self.settings):
            for load, values in self.responses.values.items():
                for name in map(str, values):
                    label = (load, name)
                    run = float(values[name].iloc[number])
                    rows.append(self._row(setting, label, run))
        return pd.DataFrame(rows)

    def _row(self, setting: Setting, label: Label, run: float) -> dict[str, object]:
        predicted = half = math.nan  # of a load that the study leaves out
        if label in self.surfaces.coefficients:
            predicted = self.surfaces.prediction(label, setting.places)
            half = self.surfaces.half_width(label, setting.places, of_run=True)
        return {
            "setting": setting.text,
            "load": label[0],
            "response": label[1],
            "unit": self.responses.units[label[1]],
            "predicted": predicted,
            "half_width": half,
            "run": run,
            "difference": run - predicted,
            "is_inside": abs(run - predicted) <= half,
        }


def run_check(
    trials: GasketTrials,
    settings: Sequence[Setting],
    surfaces: Surfaces,
    run: Callable[[Iterable[Case]], xr.Dataset],
) -> Check:
    """Run settings and return them with their predictions."""
    cases: list[Case] = []
    for number, setting in enumerate(settings, start=1):
        changed = at_places(trials.parameters, trials.factors, setting.places)
        cases += trials.cases_of(changed, f"check {number}")
    loads = [case.name for case in trials.loads]
    return Check(tuple(settings), surfaces, as_responses(run(cases), loads, trials.chosen))
