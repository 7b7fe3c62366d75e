"""Tables of a gasket study: what files, JSON, terminal and page have of a screening."""

import numpy as np
import xarray as xr

from wm_drake.parameters.variation import Number
from wm_drake.report.formatting import MISSING
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import CHANGE, SHARE, Quantity, hidden, named, quantity_of
from wm_drake.report.terminal import Console
from wm_drake.studies.doe.coding import LEVELS, MODELS
from wm_drake.studies.doe.design import Design
from wm_drake.studies.gasket.findings import EFFICIENCY
from wm_drake.studies.gasket.screening import (
    CONTRIBUTION,
    FAR,
    LEADING_INTERACTION,
    LEADING_MAIN,
    OTHER_LEVELS,
    VALUE,
    at,
    compared_terms,
    labels_of,
    leading,
    mean_difference,
    sign_differs,
)
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.words import Words

WIDE = 100
"""Width of a terminal from which on its table has the leading terms. [characters]"""

LEVEL_WORDS = {"-1": "low (−1)", "0": "middle (0)", "1": "high (+1)"}
"""Words for the levels in tables."""

SIGN_MARK = " \N{NOT EQUAL TO}\N{PLUS-MINUS SIGN}"
"""Mark of a term whose effects have another sign than the published ones."""


def variance_table(screening: xr.Dataset, published: xr.Dataset, words: Words) -> LabelledTable:
    """Return mean, range, explained variance and R2 of each response, as [B] Table 4."""
    caption = (
        "Percent of the variance of each response that is explained by all main effects, by all "
        "two-factor interactions, and by neither of them (residual). Predicted R²: explained part "
        "of the variance of trials that are left out of the fit."
    )
    if published:
        caption += (
            f" Published: from {published.source}. Difference: of the mean from the published one, "
            f"as a share of that; rows in which it is above {SHARE.text(FAR)} are marked."
        )
    data, design = _variance(screening, published), screening.design
    terms = _terms_of(screening, published)
    texts = [_leading_text(at(terms, label)) for label in labels_of(screening)]
    shape = screening["mean"].shape
    data["leading_terms"] = (("load", "response"), np.reshape(texts, shape))
    return LabelledTable(
        "variance",
        data,
        f"Percent of the variance explained ({design.kind}, {design.trials} trials, D-efficiency "
        f"{EFFICIENCY.text(design.efficiency())})",
        caption,
        marked=("is_far", "alarm") if published else ("", ""),
        words=words.labels(),
        on_page_only=(*NOT_ON_TERMINAL, *(["leading_terms"] if Console().width < WIDE else [])),
        is_in_terminal=True,
    )


NOT_ON_TERMINAL = (
    *("smallest", "largest", "adjusted_r2", "published_smallest", "published_largest"),
    *("published_main", "published_interaction"),
)
"""Columns of the variance for which a terminal is too narrow."""


TESTS_OF_MODEL = ("unexplained", "adjusted_r2", "predicted_r2")
"""Variables that tell how well the model fits."""


def _variance(screening: xr.Dataset, published: xr.Dataset) -> xr.Dataset:
    """Return the numbers of each response, with the published ones beside them if there are any."""
    data = screening[["mean"]]
    for name in ("mean", "main", "interaction", *TESTS_OF_MODEL, "smallest", "largest"):
        data[name] = screening[name]
        if name in published and published[name].notnull().any():
            words = f"published {quantity_of(screening[name]).words}"
            data[f"published_{name}"] = named(published[name], words)
        if published and name == "mean":
            difference = mean_difference(screening, published)
            data["difference"] = CHANGE.named("difference").variable(
                ("load", "response"), difference
            )
            data["is_far"] = np.abs(difference) > FAR
    more = screening[["deviation", "residual_deviation", "residual_df"]]
    return data.assign(hidden(more, *more).data_vars)


def _terms_of(screening: xr.Dataset, published: xr.Dataset) -> xr.Dataset:
    """Return the shares of all terms, with the published ones beside them if there are any.

    Returns:
        `share`; of published results `published_share`, `is_compared` and `sign_differs`.
    """
    terms = screening[["share"]]
    if published:
        terms["published_share"] = named(published.share, "published contribution")
        terms["is_compared"] = compared_terms(published)
        terms["sign_differs"] = sign_differs(screening, published)
    return terms


def _leading_text(of_label: xr.Dataset) -> str:
    """Return the leading terms of a response with their percentages, and the published ones."""
    texts = []
    for term in leading(of_label):
        one = of_label.sel(term=term)
        text = f"{term.replace(':', ' × ')} {SHARE.number(one.share)}"
        if "published_share" in one and one.published_share.notnull():
            mark = SIGN_MARK if one.sign_differs else ""
            text += f" ({SHARE.number(one.published_share)}{mark})"
        texts.append(text)
    return ", ".join(texts)


def leading_table(screening: xr.Dataset, published: xr.Dataset, words: Words) -> LabelledTable:
    """Return the leading terms of each response with their effects, as [B] Table 5.

    Published numbers are beside ours; a term that was published is in the table although it is not
    among our leading terms.
    """
    names, terms = screening.term.values.tolist(), _terms_of(screening, published)
    values = [words.values(name.split(":")[0]) for name in names]
    data = screening[["effect"]].assign(values=("term", values))
    data = data.assign(terms.drop_vars("is_compared", errors="ignore"))
    if published:
        data["published_effect"] = named(published.effect, "published effect")
    symbols = {name: name.replace(":", " × ") for name in names}
    places = [
        (*label, term, other)
        for label in labels_of(screening)
        for term in _shown_terms(at(terms, label))
        for other in (OTHER_LEVELS[1:] if ":" in term else OTHER_LEVELS[:1])
    ]
    columns = zip(*places, strict=True) if places else ((), (), (), ())
    dims = ("load", "response", "term", "other_level")
    rows = {dim: xr.DataArray(list(c), dims="row") for dim, c in zip(dims, columns, strict=True)}
    caption = (
        f"Main effects above {SHARE.text(LEADING_MAIN)} and interactions above "
        f"{SHARE.text(LEADING_INTERACTION)}, largest first. An effect is the deviation from the "
        "mean at a level of the factor; those of a factor sum to zero. For an interaction, each "
        "line is a level of its second factor, and each column a level of its first factor, whose "
        "values are in the line."
    )
    if published:
        caption += (
            f" Published numbers: from {published.source}; their levels are those of [B]. A term "
            "whose effect at the lowest level has another sign is marked."
        )
    return LabelledTable(
        "leading_terms",
        data.sel(rows),
        "Leading terms",
        caption,
        across="level",
        marked=("sign_differs", "alarm") if published else ("", ""),
        words={**words.labels(), **symbols, **LEVEL_WORDS},
    )


def _shown_terms(of_label: xr.Dataset) -> list[str]:
    """Return the leading terms of a response, then those that were published."""
    terms = leading(of_label)
    if "is_compared" in of_label:
        compared = of_label.term.values[of_label.is_compared.values].tolist()
        terms += [term for term in compared if term not in terms]
    return terms


def published_table(screening: xr.Dataset, published: xr.Dataset) -> LabelledTable:
    """Return our numbers and the published ones of each term that was published, for a file."""
    known = compared_terms(published) & screening.effect.notnull()
    signs = sign_differs(screening, published)
    texts = xr.DataArray(np.where(signs, "yes", "").astype(object), signs.coords, signs.dims)
    data = xr.Dataset(
        {
            "contribution": screening.share.where(known),
            "published_contribution": published.share.where(known),
            "effect": screening.effect.where(known),
            "published_effect": published.effect,
            "sign_differs": texts.where(known),
        }
    )
    return LabelledTable("published", data)


def contribution_tables(screening: xr.Dataset, words: Words) -> tuple[LabelledTable, ...]:
    """Return contributions, sums of squares and effects of all terms."""
    residual = screening.unexplained.expand_dims(term=["residual"])
    shares = xr.concat([screening.share, residual], "term").transpose("load", "term", "response")
    by_term = screening[["df", "sum_sq_share"]].transpose("load", "term", "response")
    return (
        LabelledTable(
            "contributions",
            xr.Dataset({"contribution": CONTRIBUTION.on(shares)}),
            "All terms",
            "Contribution of every term to each response, in percent of the variance.",
            across="response",
            words={**words.labels(), **{name: name for name in screening.response.values.tolist()}},
        ),
        LabelledTable("sums_of_squares", by_term, is_in_json=False),
        LabelledTable("effects", screening[["effect"]], is_in_json=False),
    )


def run_tables(screening: xr.Dataset, trials: GasketTrials) -> tuple[LabelledTable, ...]:
    """Return all runs, the design, and the springs that go slack, for files."""
    design, touches = screening.design, screening.overlap.notnull()
    levels = {
        name: ("trial", column)
        for name, column in zip(design.factors, design.levels.T, strict=True)
    }
    plan = xr.Dataset({**levels, **physical_values(design, trials)}, {"trial": screening.trial})
    runs = plan.assign(
        value=screening.value,
        touches=(("load", "trial"), np.where(touches, "yes", "")),
        slack=screening.slack,
        failed=screening.failed,
    )
    slack = screening.slack.stack(run=("trial", "load")).reset_index("run")
    return (
        LabelledTable("runs", runs, across="response", is_in_json=False),
        LabelledTable("design", plan, is_in_json=False),
        LabelledTable("slack", xr.Dataset({"springs": slack.isel(run=(slack != "").values)})),
    )


def physical_values(design: Design, trials: GasketTrials) -> dict[str, xr.Variable]:
    """Return the physical values of each trial, over `trial`: a variable for each factor.

    If the keys of a factor have different values, there is a variable for each of them.
    """
    values = {}
    for factor in trials.factors:
        places = design.levels[:, design.factors.index(factor.name)] + 1
        each = {n.key: (n.unit, factor.levels_of(n)) for n in factor.numbers}
        each = each or {"": (factor.unit, factor.first_levels)}
        is_same = len({levels for _, levels in each.values()}) == 1
        for key, (unit, levels) in list(each.items())[: 1 if is_same else None]:
            quantity = Quantity(factor.name, unit)
            numbers = np.asarray(levels)[places]
            name = factor.name if is_same else f"{factor.name}_{key}"
            values[f"{name}{quantity.suffix or '_value'}"] = quantity.variable("trial", numbers)
    return values


def touching_table(screening: xr.Dataset, trials: GasketTrials) -> LabelledTable:
    """Return the runs in which the tub touches the housing, deepest first."""
    runs = screening[["overlap"]].assign(physical_values(screening.design, trials))
    touching = runs.stack(run=("trial", "load")).dropna("run", subset=["overlap"])
    return LabelledTable(
        "touching",
        touching.sortby("overlap").reset_index("run").rename(overlap="gap"),
        "Runs in which the tub touches the housing",
        "Runs in which the tub touches the housing (gap of 0 or less), deepest first.",
    )


def level_zero_table(zero: xr.Dataset, words: Words) -> LabelledTable:
    """Return the responses of the machine and of level 0 with each treatment of tables."""
    return LabelledTable(
        "level_zero",
        zero,
        "Level 0 and the machine",
        "The machine itself and level 0 of all factors. Tables scaled: the forces of a stiffness "
        "table are multiplied by the level. Tables linear: a table is replaced by the slope of its "
        "first 20 %, as in [B]. Differences are from the machine.",
        words=words.labels(),
    )


def check_table(check: xr.Dataset, words: Words) -> LabelledTable:
    """Return prediction and run of each setting of `--check`."""
    return LabelledTable(
        "check",
        check.assign(is_outside=~check.is_inside),
        "Fitted model and runs of --check",
        "Settings of --check: prediction of the fitted model, half width of its 95 % interval for "
        "a new run, the run, and run − prediction. Other factors are at their middle level.",
        marked=("is_outside", "alarm"),
        words=words.labels(),
        on_page_only=("difference",),
        is_in_terminal=True,
    )


def design_table(design: Design) -> LabelledTable:
    """Return the properties of the design and its efficiency for each model."""
    seed = MISSING if design.seed is None else str(design.seed)
    texts = {"kind": design.kind, "model": design.model, "seed": seed}
    counts = {
        "trials": design.trials,
        "factors": len(design.factors),
        "coefficients": design.coefficients,
    }
    efficiency = {
        f"d_efficiency_{model.replace('+', '_')}": EFFICIENCY.named(
            f"{EFFICIENCY.words} for {model}"
        ).variable((), design.efficiency(model))
        for model in MODELS
    }
    return LabelledTable(
        "settings",
        xr.Dataset({**texts, **counts, **efficiency}),
        "Design",
        "Design of the experiment. main: main effects. main+2fi: main effects and two-factor "
        "interactions. The D-efficiency is det(X′X / n)^(1/p), in percent of the value of the full "
        "factorial. No design can exceed 100 %.",
    )


def factors_table(trials: GasketTrials, words: Words) -> LabelledTable:
    """Return the values of the machine file that belong to the levels of each factor."""
    keys = [(factor, number) for factor in trials.factors for number in factor.numbers]
    each = {number.key: Quantity(number.key, number.unit) for _, number in keys}
    values = [factor.levels_of(number) for factor, number in keys]
    data = xr.Dataset(
        {
            "factor": ("key", [words.factor(factor.name) for factor, _ in keys]),
            "in_machine": ("key", [_nominal_text(number) for _, number in keys]),
            "level_value": VALUE.named("value").of_each("key", each, ("key", "level"), values),
        },
        {"key": [number.key for _, number in keys], "level": list(LEVELS)},
    )
    return LabelledTable(
        "factors",
        data,
        "Factors and their levels",
        "Factors and their levels. All keys of a factor change together. For a stiffness that is "
        "given as a table, the value is the slope of a line through its first 20 %.",
        across="level",
        words=LEVEL_WORDS,
    )


def _nominal_text(number: Number) -> str:
    return MISSING if number.nominal is None else number.unit.reading(number.nominal)
