"""Screening: run a design and divide the variance of each response among factors and interactions.

It is independent of machines: the function `evaluate` returns the responses of the trials, as
`runs_of` makes them. Everything is one labelled dataset, a screening. With `load` and `response`:

- of each `trial`: `value`, and `fitted` and `residual` of the model; NaN where the run failed;
- of the response: `mean`, `smallest`, `largest`, standard `deviation`; the shares `main`,
  `interaction` and `unexplained` of its variance; `residual_df`, `residual_deviation`,
  `adjusted_r2`, `predicted_r2`;
- of each `term`: `share` of the variance, `sum_sq_share` (type III, of the total), `df`, `f`, `p`;
- `effect` of each term at the `level` of its first factor, and `other_level`, "" for a main effect.

Over `load` and `trial` there are `failed`, the reason of a failed run, `overlap`, the gap of a run
in which the tub touches the housing, and `slack`, names of springs that go slack. Over `response`
there are `kind`, `about` and `better`. The attribute `design` has the `Design`.
"""

import itertools
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, TypeVar

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import PublishedResults, PublishedTerm
from wm_drake.parameters.published import CONSTANT, INTERACTIONS, MAIN, RANGE
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import number, three_digits
from wm_drake.report.quantity import SHARE, Quantity, each_of
from wm_drake.simulation.measures.kind import Better
from wm_drake.studies.doe.anova import anova
from wm_drake.studies.doe.coding import LEVELS, columns, efficiency
from wm_drake.studies.doe.design import Design

LEADING_MAIN = 0.1
"""Contribution above which a main effect is a leading term ([B] Table 5)."""

LEADING_INTERACTION = 0.05
"""Contribution above which an interaction is a leading term ([B] Table 5)."""

FEW_TRIALS = 1.5
"""Trials per coefficient below which a design cannot tell how well its model predicts.

With 129 coefficients, the leave-one-out error of the default study is three to four times that of
fresh trials at 150 trials, twice at 200, and a tenth more at 1000.
"""

LEAST_PREDICTED_R2 = 0.9
"""Predicted R2 below which the model of a response is called poor."""

FAR = 0.3
"""Difference above which a result is named beside the published one: of a mean, as a share of it;
of a contribution."""

Label: TypeAlias = tuple[str, str]
"""Name of a load and name of a response."""


def r2_text(r2: float) -> str:
    """Return an R2 with three decimals; "below 0" if it is negative, a dash if it is NaN."""
    return "below 0" if r2 < 0.0 else number(r2, 3)


VALUE = Quantity("run", form=three_digits)
MEAN = Quantity("mean", form=three_digits)
CONTRIBUTION = SHARE.named("contribution", decimals=1)
PREDICTED_R2 = Quantity("predicted R²", form=r2_text)
ADJUSTED_R2 = Quantity("adjusted R²", form=r2_text)
OVERLAP = Quantity("gap", Unit("m", "mm"), form=three_digits)
EFFECT = Quantity("effect", form=three_digits)
COUNT = Quantity("degrees of freedom", decimals=0)

OF_ANALYSIS = {
    "mean": MEAN,
    "main": CONTRIBUTION.named("main effects"),
    "interaction": CONTRIBUTION.named("interactions"),
    "unexplained": CONTRIBUTION.named("residual"),
    "residual_deviation": MEAN.named("residual standard deviation"),
    "residual_df": COUNT,
    "adjusted_r2": ADJUSTED_R2,
    "predicted_r2": PREDICTED_R2,
    "share": CONTRIBUTION,
    "sum_sq_share": CONTRIBUTION.named("sum of squares"),
    "df": COUNT,
    "f": Quantity("F"),
    "p": Quantity("p"),
    "effect": EFFECT,
}
"""Quantities of what an analysis of variance finds."""

IN_UNIT_OF_RESPONSE = ("mean", "residual_deviation", "effect")
"""Those of them that have the unit of the response."""

OTHER_LEVELS = ("", *map(str, LEVELS))
"""Labels of the level of the second factor of a term; "" if it has none."""


def runs_of(
    values: Mapping[str, Mapping[str, Any]],
    quantities: Mapping[str, Quantity],
    better: Mapping[str, Better] | None = None,
    kinds: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """Return the responses of trials, without failed runs, contact and slack springs.

    Args:
        values: By load and response: one number for each trial, NaN where the run failed. [SI]
        quantities: Quantity of each response, with its words.
        better: Which change of a response is an improvement; "smaller" without.
        kinds: Kind of each response, such as displacement; its name without.
    """
    names = list(quantities)
    array = np.array([[of_load[name] for name in names] for of_load in values.values()], float)
    data = xr.Dataset(
        {
            "value": VALUE.of_each(
                "response", quantities, ("load", "trial", "response"), np.moveaxis(array, 1, 2)
            )
        },
        {"load": list(values), "trial": np.arange(array.shape[2]) + 1, "response": names},
    )
    size = (len(values), array.shape[2])
    texts = np.full(size, "", dtype=object)
    return data.assign(
        failed=(("load", "trial"), texts),
        slack=(("load", "trial"), texts.copy()),
        overlap=OVERLAP.variable(("load", "trial"), np.full(size, np.nan)),
        better=("response", [(better or {}).get(name, "smaller") for name in names]),
        kind=("response", [(kinds or {}).get(name, name) for name in names]),
        about=("response", ["" for _ in names]),
    )


EvaluateFactors: TypeAlias = Callable[[Design], xr.Dataset]
"""Function that returns the responses of the trials of a design, as of `runs_of`."""


def run_screening(design: Design, evaluate: EvaluateFactors) -> xr.Dataset:
    """Run a design and analyse its responses.

    Raises:
        InputError: the design has as many coefficients as trials, or so many runs failed that the
            others do not determine the effects.
    """
    check_degrees_of_freedom(design)
    return analyse(design, evaluate(design))


def check_degrees_of_freedom(design: Design) -> None:
    """Raise an InputError if a part of the grid has as many coefficients as trials.

    The model then meets all trials exactly, whatever they are, and nothing shows how wrong it is.
    The full factorial is allowed: it has no other trials.
    """
    if design.residual_df < 1 and not design.is_complete:
        is_enough = design.trials > columns(len(design.factors), "main")
        raise input_error(
            f"{design.trials} trials for {design.coefficients} coefficients of {design.model} "
            "leave no degree of freedom, so nothing shows how well the model fits; add trials"
            + (", or use --model main" if is_enough else ""),
            key="trials",
        )


def analyse(design: Design, runs: xr.Dataset) -> xr.Dataset:
    """Return the screening of a design: the runs with the analysis of their variance.

    The trials whose run with a load failed are left out for this load.

    Raises:
        InputError: so many runs failed that the others do not determine the effects.
    """
    levels = pd.DataFrame(design.levels, columns=list(design.factors))
    names, analysed = runs.response.values.tolist(), []
    for load in runs["load"].values.tolist():
        values = runs.value.sel(load=load)
        good = good_trials(values)
        if not good.all() and efficiency(design.levels[good], design.model) == 0.0:
            raise input_error(
                f"{np.sum(~good)} of {len(good)} runs failed; the others do not determine the "
                f"effects of {design.model}",
                where=f"load {load}",
            )
        frame = pd.DataFrame(values.values[good], columns=names)
        of_load = anova(levels[good], frame, interactions=design.model != "main")
        analysed.append(of_load.assign_coords(trial=runs.trial.values[good]))
    loads = xr.Variable("load", runs["load"].values)
    joined = xr.concat(analysed, loads, join="outer").reindex(trial=runs.trial)
    screening = runs.assign(_of_runs(runs.value) | _of_analysis(joined, each_of(runs.value)))
    for name in ("fitted", "residual"):
        array = joined[name].transpose(*runs.value.dims)
        screening[name] = runs.value.copy(deep=False, data=array.values)
    labels = {"term": joined.term, "level": list(LEVELS), "other_level": list(OTHER_LEVELS)}
    return screening.assign_coords(labels).assign_attrs(design=design)


def good_trials(values: xr.DataArray) -> np.ndarray:
    """Return which trials of a load have all responses. (trials,)

    Args:
        values: Over `trial` and `response`.
    """
    return np.asarray(np.isfinite(values.values).all(axis=1))


def _of_runs(values: xr.DataArray) -> dict[str, xr.DataArray]:
    """Return smallest and largest value and standard deviation of each response."""
    numbers = {
        "smallest": values.min("trial", keep_attrs=True),
        "largest": values.max("trial", keep_attrs=True),
        "deviation": values.std("trial", ddof=1, keep_attrs=True),
    }
    words = {"deviation": "standard deviation"}
    return {name: VALUE.named(words.get(name, name)).on(array) for name, array in numbers.items()}


def _of_analysis(analysed: xr.Dataset, each: Mapping[str, Quantity]) -> dict[str, xr.Variable]:
    """Return the variables of analyses of variance, with their quantities.

    Args:
        analysed: As of `anova`, over `load` too.
        each: Quantities of the responses.
    """
    freedom, total = analysed.residual_df, analysed.total_sum_sq
    full = analysed.assign(
        mean=analysed.constant,
        residual_deviation=np.sqrt(analysed.residual_sum_sq / freedom.where(freedom != 0)),
        sum_sq_share=analysed.sum_sq / total.where(total != 0.0),
    ).transpose("load", "response", ...)
    variables = {}
    for name, quantity in OF_ANALYSIS.items():
        dims, values = [str(dim) for dim in full[name].dims], full[name].values
        if name in IN_UNIT_OF_RESPONSE:
            variables[name] = quantity.of_each("response", each, dims, values)
        else:
            variables[name] = quantity.variable(dims, values)
    return variables


Labelled = TypeVar("Labelled", xr.Dataset, xr.DataArray)


def labels_of(data: Labelled) -> list[Label]:
    """Return all loads and responses of a screening, or of numbers beside it."""
    return list(itertools.product(data["load"].values.tolist(), data["response"].values.tolist()))


def at(data: Labelled, label: Label) -> Labelled:
    """Return the part of a screening, or of numbers beside it, of a load and response."""
    return data.sel(load=label[0], response=label[1])


def has_few_trials(design: Design) -> bool:
    """Return whether a design has too few trials to judge its model."""
    return design.trials < FEW_TRIALS * design.coefficients and not design.is_complete


def poor(screening: xr.Dataset) -> dict[Label, float]:
    """Return the responses that the model predicts poorly, with their predicted R2."""
    if screening.design.is_complete:
        return {}
    known = {label: at(screening.predicted_r2, label).item() for label in labels_of(screening)}
    return {label: value for label, value in known.items() if value < LEAST_PREDICTED_R2}


def is_main(terms: xr.DataArray) -> np.ndarray:
    """Return whether terms are main effects."""
    return np.array([":" not in name for name in terms.values.tolist()], dtype=bool)


def mains(of_label: xr.Dataset) -> xr.Dataset:
    """Return the main effects of a response, largest first.

    Args:
        of_label: As of `at`.
    """
    main = of_label.isel(term=is_main(of_label.term))
    return main.isel(term=np.argsort(-main.share.values, kind="stable"))


def leading(of_label: xr.Dataset) -> list[str]:
    """Return the terms of a response above the thresholds of [B] Table 5, largest first."""
    least = np.where(is_main(of_label.term), LEADING_MAIN, LEADING_INTERACTION)
    kept = of_label.share.isel(term=of_label.share.values > least)
    return [str(name) for name in kept.term.values[np.argsort(-kept.values, kind="stable")]]


def mean_at(of_label: xr.Dataset, first: str, second: str = "") -> FloatArray:
    """Return the mean of a response at the levels of one or two factors, over all others.

    Returns:
        (3,) or (3, 3), the first factor first. [SI]
    """
    main = of_label.effect.sel(other_level="")
    mean = of_label["mean"].item() + main.sel(term=first).values
    if not second:
        return np.asarray(mean)
    names = of_label.term.values.tolist()
    both = np.add.outer(mean, main.sel(term=second).values)
    for term, is_turned in ((f"{first}:{second}", False), (f"{second}:{first}", True)):
        if term in names:
            pair = of_label.effect.sel(term=term).values[:, 1:]
            both = both + (pair.T if is_turned else pair)
    return np.asarray(both)


def published_for(results: PublishedResults, screening: xr.Dataset, source: str = "") -> xr.Dataset:
    """Return the published numbers that belong to a screening; no variables if there are none.

    Returns:
        `mean`, `smallest`, `largest`, `main`, `interaction`, `share` and `effect` as in the
        screening, NaN where nothing was published. Attribute `source`: where they are from.
    """
    compared = [label for label in labels_of(screening) if label in results]
    if not compared:
        return xr.Dataset()
    names = ("mean", "smallest", "largest", "main", "interaction", "share", "effect")
    published = screening[list(names)].map(
        lambda array: xr.full_like(array, np.nan), keep_attrs=True
    )
    for label in compared:
        _fill(published, label, results[label])
    return published.assign_attrs(source=source)


def _fill(published: xr.Dataset, label: Label, terms: Mapping[str, PublishedTerm]) -> None:
    """Write the published numbers of a response into arrays of NaN."""
    load, name = label
    quantity = each_of(published["mean"])[name]
    place = {"load": load, "response": name}

    def write(variable: str, value: Any, **where: Any) -> None:
        published[variable].loc[{**place, **where}] = value

    for variable, term, place_of_effect in (
        ("mean", CONSTANT, 0),
        ("smallest", RANGE, 0),
        ("largest", RANGE, 1),
    ):
        if term in terms:
            write(variable, quantity.unit.to_si(terms[term].effects[place_of_effect]))
    for variable, term in (("main", MAIN), ("interaction", INTERACTIONS)):
        if term in terms:
            write(variable, CONTRIBUTION.unit.to_si(terms[term].percent))
    for term in published.term.values.tolist():
        straight, turned = terms.get(term), terms.get(":".join(reversed(term.split(":"))))
        known = straight or turned
        if known is None:
            continue
        if known.percent is not None:
            write("share", CONTRIBUTION.unit.to_si(known.percent), term=term)
        if known.effects:
            shape = (len(LEVELS),) * (term.count(":") + 1)
            effects = quantity.unit.to_si(np.array(known.effects)).reshape(shape)
            effects = effects if straight else effects.T
            others = list(OTHER_LEVELS[1:]) if len(shape) > 1 else ""
            write("effect", effects, term=term, other_level=others)


def sign_differs(screening: xr.Dataset, published: xr.Dataset) -> xr.DataArray:
    """Return whether effects have another sign than the published ones, over the terms.

    The effects at the lowest levels are compared. It is False if none were published.
    """
    lowest = (data.effect.sel(level=LEVELS[0]) for data in (screening, published))
    ours, theirs = (
        effect.sel(other_level="").fillna(effect.sel(other_level=str(LEVELS[0])))
        for effect in lowest
    )
    return ours * theirs < 0.0


def compared_terms(published: xr.Dataset) -> xr.DataArray:
    """Return whether a contribution or effects of a term were published."""
    return published.share.notnull() | published.effect.notnull().any(["level", "other_level"])


def mean_difference(screening: xr.Dataset, published: xr.Dataset) -> xr.DataArray:
    """Return by how much means are above the published ones, as a share of those."""
    theirs = published["mean"].where(published["mean"] != 0.0)
    return (screening["mean"] - theirs) / theirs


def leaders(screening: xr.Dataset, published: xr.Dataset) -> dict[Label, tuple[str, str]]:
    """Return our largest main effect and the published one of each response with any."""
    pairs = {}
    for label in labels_of(screening):
        theirs = mains(at(published[["share"]].fillna(0.0), label))
        if theirs.share.values[0] > 0.0:
            ours = mains(at(screening[["share"]], label))
            pairs[label] = ours.term.values[0].item(), theirs.term.values[0].item()
    return pairs
