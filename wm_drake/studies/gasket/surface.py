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

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr
from scipy.special import stdtrit

from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import three_digits
from wm_drake.report.quantity import Quantity, each_of
from wm_drake.studies.doe.anova import SumCoding
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.gasket.screening import MEAN, good_trials
from wm_drake.studies.gasket.study import GasketTrials, responses_of

CONFIDENCE = 0.95
"""Probability of the intervals."""

HALF_WIDTH = Quantity("± 95 %", form=three_digits)
"""Half width of the 95 % interval of a new run."""


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


def models_of(screening: xr.Dataset) -> xr.Dataset:
    """Return the fitted models of a screening; its design has three levels of each factor.

    Returns:
        Over `load` and `response`: `coefficient` of the row of the model, over `column` too, and
        `spread`, the residual standard deviation times the quantile of Student's t; NaN without
        degrees of freedom. Over `load`, `column` and `other`: `inverse`, (X' X)^-1 of its trials.
        Attributes: `factors`, their names, and `interactions`, whether the model has them.
    """
    design, each = screening.design, each_of(screening.value)
    interactions = design.model != "main"
    # of sum-coded columns, the coefficients are the effects at -1 and 0
    effects = screening.effect.sel(level=[-1, 0])
    pairs = [":" in term for term in screening.term.values.tolist()]
    of_mains, of_pairs = (
        effects.isel(term=np.flatnonzero(np.array(pairs) == is_pair)).sel(other_level=others).values
        for is_pair, others in ((False, [""]), (True, ["-1", "0"]))
    )
    shape = (screening.sizes["load"], screening.sizes["response"], -1)
    coefficients = np.concatenate(
        [screening["mean"].values[..., None], of_mains.reshape(shape), of_pairs.reshape(shape)], -1
    )
    df = screening.residual_df.values
    quantile = np.where(df > 0, stdtrit(np.maximum(df, 1), 0.5 + 0.5 * CONFIDENCE), np.nan)
    labels = ("load", "response")
    return xr.Dataset(
        {
            "coefficient": MEAN.of_each("response", each, (*labels, "column"), coefficients),
            "spread": MEAN.of_each(
                "response", each, labels, quantile * screening.residual_deviation.values
            ),
            "inverse": (("load", "column", "other"), _inverses(screening, interactions)),
        },
        {name: screening[name] for name in labels},
        {"factors": design.factors, "interactions": interactions},
    )


def _inverses(screening: xr.Dataset, interactions: bool) -> FloatArray:
    """Return (X' X)^-1 of the good trials of each load. (loads, p, p)"""
    design, known, inverses = screening.design, dict[bytes, FloatArray](), []
    for load in screening["load"].values:
        good = good_trials(screening.value.sel(load=load))
        if good.tobytes() not in known:
            rows = pd.DataFrame(design.levels[good], columns=list(design.factors))
            matrix = SumCoding(rows, interactions).matrix
            known[good.tobytes()] = np.asarray(np.linalg.inv(matrix.T @ matrix), dtype=float)
        inverses.append(known[good.tobytes()])
    return np.array(inverses)


def predicted(models: xr.Dataset, places: FloatArray) -> xr.Dataset:
    """Return the responses that the models predict at settings, and their intervals.

    Args:
        models: As of `models_of`.
        places: Places of all factors. (n, factors)

    Returns:
        Over `setting`, `load` and `response`: `predicted`, and `half_width` of the 95 % interval of
        a new run.
    """
    rows = model_rows(np.asarray(places, dtype=float), interactions=models.interactions)
    each, dims = each_of(models.coefficient), ("setting", "load", "response")
    values = np.einsum("np,lrp->nlr", rows, models.coefficient.values)
    widths = half_widths(models, rows, of_run=True)
    return xr.Dataset(
        {
            "predicted": MEAN.named("predicted").of_each("response", each, dims, values),
            "half_width": HALF_WIDTH.of_each("response", each, dims, widths),
        },
        {name: models[name] for name in dims[1:]},
    )


def half_widths(models: xr.Dataset, rows: FloatArray, *, of_run: bool) -> FloatArray:
    """Return the half widths of the intervals of new runs, or of means. (n, loads, responses)

    Args:
        models: As of `models_of`.
        rows: Rows of the model. (n, p)
        of_run: Whether they are those of runs.
    """
    leverage = np.einsum("np,lpq,nq->nl", rows, models.inverse.values, rows)
    return np.asarray(np.sqrt(leverage + float(of_run))[..., None] * models.spread.values)


def mean_half_widths(models: xr.Dataset, places: Sequence[float]) -> FloatArray:
    """Return the half widths of the means over all levels of the other factors.

    Returns:
        (factors, places, loads, responses) [SI]
    """
    count = len(models.factors)
    rows = np.zeros((count, len(places), models.sizes["column"]))
    rows[..., 0] = 1.0
    for factor in range(count):
        rows[factor, :, 1 + 2 * factor : 3 + 2 * factor] = codes(np.array(places))
    widths = half_widths(models, rows.reshape(-1, rows.shape[-1]), of_run=False)
    return widths.reshape(count, len(places), *widths.shape[1:])


@dataclass(frozen=True)
class Setting:
    """Setting of the factors that is to be run.

    Attributes:
        text: As the user wrote it.
        places: A place from -1 to 1 for each factor.
    """

    text: str
    places: tuple[float, ...]


def run_settings(
    trials: GasketTrials,
    settings: Sequence[Setting],
    models: xr.Dataset,
    experiment: Experiment,
) -> xr.Dataset:
    """Run settings and return them with their predictions.

    Args:
        trials: Machine, factors and responses.
        settings: The settings.
        models: As of `models_of`.
        experiment: Runs of the machine with some loads.

    Returns:
        Over `setting`, `load` and `response`: `predicted` and `half_width` as of `predicted`, NaN
        with a load that the models do not have; `run`, `difference` of both, and `is_inside`,
        whether the run lies in the interval.
    """
    machines = (trials.varying.at_levels(setting.places) for setting in settings)
    names = [f"check {number}" for number in range(1, len(settings) + 1)]
    data = experiment.at(names, machines, "settings")
    runs = responses_of(data, trials.chosen).value.rename(trial="setting")
    runs = runs.transpose("setting", ...)
    return compared_with_models(models, settings, runs)


def compared_with_models(
    models: xr.Dataset, settings: Sequence[Setting], runs: xr.DataArray
) -> xr.Dataset:
    """Return runs of settings beside what the models predict, as `run_settings` does.

    Args:
        models: As of `models_of`.
        settings: The settings.
        runs: Over `setting`, `load` and `response`.
    """
    texts = [setting.text for setting in settings]
    check = predicted(models, np.array([setting.places for setting in settings]))
    check = check.assign_coords(setting=texts).reindex(load=runs["load"])
    check["run"] = runs.assign_coords(setting=texts)
    check["run"] = MEAN.named("run").on(check["run"])
    difference = check.run - check.predicted
    each = each_of(runs)
    check["difference"] = MEAN.named("difference").of_each(
        "response", each, difference.dims, difference
    )
    check["is_inside"] = np.abs(difference) <= check.half_width
    return check
