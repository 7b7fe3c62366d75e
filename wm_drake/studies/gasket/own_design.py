"""The gasket study with a design of the user: a polynomial model in place of three levels."""

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.report.formatting import listed, three_digits
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, Quantity, each_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.doe.polynomial import CONSTANT, PolynomialDesign, fitted_polynomial
from wm_drake.studies.experiment import failures
from wm_drake.studies.gasket import figures
from wm_drake.studies.gasket.screening import (
    ADJUSTED_R2,
    CONTRIBUTION,
    COUNT,
    LEAST_PREDICTED_R2,
    MEAN,
    PREDICTED_R2,
    VALUE,
    good_trials,
    labels_of,
    r2_text,
)
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.words import Words

LEVERAGE = Quantity("leverage", decimals=2)

HIGH_LEVERAGE = 2.0
"""Multiple of the mean leverage from which a trial is marked, the usual rule of Hoaglin and Welsch
(1978)."""

MOST_NAMED = 3
"""Number of terms that the answer names of a response."""

QUANTITIES = {
    "coefficient": MEAN.named("coefficient"),
    "half_width": MEAN.named("± 95 %"),
    "share": CONTRIBUTION.named("partial sum of squares"),
    "df": COUNT,
    "f": Quantity("F", form=three_digits),
    "p": Quantity("p", form=three_digits),
    "residual_df": COUNT.named("residual degrees of freedom"),
    "residual_deviation": MEAN.named("lack of fit, standard deviation"),
    "r2": Quantity("R²", form=r2_text),
    "adjusted_r2": ADJUSTED_R2,
    "predicted_r2": PREDICTED_R2,
    "leverage": LEVERAGE,
    "fitted": VALUE.named("fitted"),
    "residual": VALUE.named("residual"),
}
"""Quantities of a fit, as of `fitted_polynomial`."""

IN_UNIT_OF_RESPONSE = ("coefficient", "half_width", "residual_deviation", "fitted", "residual")

METHOD = (
    "The model is fitted by least squares in the levels of the factors: -1 and 1 are the ends of a "
    "range, 0 its middle. A simulation has no noise: repeated trials run once, the pure error is "
    "zero, and all of the residual is lack of fit. Intervals and p compare with it. The predicted "
    "R² leaves each trial out once."
)


def fitted_screening(design: PolynomialDesign, runs: xr.Dataset) -> xr.Dataset:
    """Return the runs with the fits of their responses, over `load` too.

    Args:
        runs: As of `screening.runs_of`.

    Raises:
        InputError: so many runs with a load failed that the others do not determine the model.
    """
    fits, each = [], each_of(runs.value)
    for load in runs["load"].values.tolist():
        values = runs.value.sel(load=load).transpose("trial", "response")
        good = good_trials(values)
        columns = design.model.columns(design.levels[good])
        if np.linalg.matrix_rank(columns) < columns.shape[1] or len(columns) <= columns.shape[1]:
            message = (
                f"{np.sum(~good)} of {len(good)} runs failed; the others do not test the model"
            )
            raise input_error(message, where=f"load {load}")
        fit = fitted_polynomial(design.model, design.levels[good], values.values[good])
        fits.append(fit.assign_coords(trial=runs.trial.values[good]))
    loads = xr.Variable("load", runs["load"].values)
    joined = xr.concat(fits, loads, join="outer").reindex(trial=runs.trial)
    joined = joined.assign_coords(response=runs.response)
    for name, quantity in QUANTITIES.items():
        dims = [str(dim) for dim in joined[name].dims]
        if name in IN_UNIT_OF_RESPONSE:
            joined[name] = quantity.of_each("response", each, dims, joined[name].values)
        else:
            joined[name] = quantity.variable(dims, joined[name].values)
    return joined.merge(runs).assign_attrs(design=design)


def polynomial_answer(screening: xr.Dataset, trials: GasketTrials) -> Answer:
    """Return the answer.

    Args:
        screening: As of `fitted_screening`.
        trials: What was run.
    """
    words, design = Words(trials.factors, screening), screening.design
    terms = screening.isel(term=screening.term.values != CONSTANT)
    terms = terms.transpose("load", "response", "term", "trial", ...)
    return Answer(
        f"Gasket study of machine {trials.parameters.name}, design {design.kind}",
        _answer_text(screening, words),
        trials.parameters,
        (
            *(_load_part(terms, load, words) for load in screening["load"].values.tolist()),
            Part("How well the models fit", (_fit_table(screening, words),)),
            Part("Coefficients", (_coefficients(screening, words),), is_folded=True),
            Part("Trials", (_trials_table(screening),), is_folded=True),
        ),
        (
            ("Design", f"{design.kind}, {design.trials} different trials"),
            ("Model", f"{design.model.name}, {design.coefficients} coefficients"),
            ("Factors", "; ".join(f"{words.factor(f)}: {words.values(f)}" for f in design.factors)),
        ),
        METHOD,
        warned=_warned(screening, words),
        diverged=_failed(screening),
    )


def _failed(screening: xr.Dataset) -> tuple[str, ...]:
    return failures(xr.Dataset({"diverged": screening.failed.astype(object)}))


def _answer_text(screening: xr.Dataset, words: Words) -> str:
    """Return the strongest terms of each response, over all loads, and how well models predict."""
    sentences = []
    for name in screening.response.values.tolist():
        of_terms = screening.share.sel(response=name).mean("load")
        of_terms = of_terms.isel(term=of_terms.term.values != CONSTANT).fillna(0.0)
        ranked = of_terms.isel(term=np.argsort(-of_terms.values, kind="stable")[:MOST_NAMED])
        texts = [
            f"{term.replace(':', ' × ')} {SHARE.text(value)}"
            for term, value in zip(ranked.term.values.tolist(), ranked.values, strict=True)
        ]
        sentences.append(f"{words.response(name)}: {listed(texts)}")
    least = float(screening.predicted_r2.min())
    worst = f"; the lowest predicted R² is {r2_text(least)}" if np.isfinite(least) else ""
    return f"Partial sums of squares of the strongest terms. {'; '.join(sentences)}{worst}."


def _warned(screening: xr.Dataset, words: Words) -> tuple[str, ...]:
    """Return warnings of models that predict poorly, and of trials that decide alone."""
    sentences = []
    poor = [
        f"{words.response(name)} with load {load} ({r2_text(r2)})"
        for load, name in labels_of(screening.predicted_r2)
        if not (r2 := screening.predicted_r2.sel(load=load, response=name).item())
        >= LEAST_PREDICTED_R2
    ]
    if poor:
        sentences.append(
            f"The model predicts left-out trials poorly (predicted R² below {LEAST_PREDICTED_R2}): "
            f"{', '.join(poor)}. Its coefficients hold at the trials only."
        )
    high = _is_high(screening)
    if high.any():
        numbers = ", ".join(map(str, screening.trial.values[high][:10].tolist()))
        sentences.append(
            f"Trials with more than {HIGH_LEVERAGE:g} times the mean leverage decide their "
            f"coefficients nearly alone: {numbers}."
        )
    return tuple(sentences)


def _is_high(screening: xr.Dataset) -> np.ndarray:
    design = screening.design
    limit = HIGH_LEVERAGE * design.coefficients / design.trials
    return np.asarray((screening.leverage.max("load") > limit).values)


def _load_part(screening: xr.Dataset, load: str, words: Words) -> Part:
    """Return the pictures of a load: strongest terms, residuals."""
    return Part(
        f"Load {load}",
        (
            Plot(
                figures.pareto_figure(screening, load, words, has_thresholds=False),
                f"Strongest terms of each response with load {load}.",
                "Partial sum of squares of the strongest terms, in percent of the total one.",
            ),
            Plot(
                figures.residuals_figure(screening, load, words),
                f"Residuals over fitted values with load {load}.",
                "Residual of each trial over its fitted value: lack of fit, without noise.",
            ),
        ),
    )


def _fit_table(screening: xr.Dataset, words: Words) -> LabelledTable:
    names = ("r2", "adjusted_r2", "predicted_r2", "residual_deviation")
    return LabelledTable(
        "fits",
        screening[list(names)].drop_dims(["trial", "term"], errors="ignore"),
        "How well the models fit",
        "Explained part of the variance; the same adjusted for the number of coefficients; the "
        "part that is predicted of trials that are left out one at a time; standard deviation of "
        "what the model does not explain.",
        words=words.labels(),
        is_in_terminal=True,
    )


def _coefficients(screening: xr.Dataset, words: Words) -> LabelledTable:
    names = ["coefficient", "half_width", "share", "p"]
    return LabelledTable(
        "coefficients",
        screening[names].drop_dims("trial", errors="ignore").transpose("load", "response", "term"),
        "Coefficients",
        "Change of the response for a change of the term by 1, in the levels of the factors.",
        words=words.labels(),
    )


def _trials_table(screening: xr.Dataset) -> LabelledTable:
    """Return levels, leverage and responses of each trial, with its fitted values."""
    design: PolynomialDesign = screening.design
    levels = {
        name: Quantity(name).variable("trial", design.levels[:, column])
        for column, name in enumerate(design.factors)
    }
    data = xr.Dataset(
        {
            **levels,
            "is_high": ("trial", _is_high(screening)),
            **{name: screening[name] for name in ("leverage", "value", "fitted")},
            "failed": screening.failed,
        },
        {"trial": screening.trial, "load": screening["load"], "response": screening.response},
    )
    return LabelledTable(
        "runs",
        data,
        "Trials",
        "Levels of the factors, leverage, and each response by the run and by the model. Marked: "
        "leverage above twice the mean.",
        across="response",
        marked=("is_high", "alarm"),
        is_in_json=False,
    )
