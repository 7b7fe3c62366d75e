"""Results of a screening as tables and plain data, for files and other programs."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import FactorLevels
from wm_drake.parameters.published import CONSTANT, INTERACTIONS, MAIN, RANGE
from wm_drake.studies.doe import Design
from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.compared import NOT_COMPARED, Compared
from wm_drake.studies.gasket.published import Published
from wm_drake.studies.gasket.screening import Label, Screening, leading_terms


def all_tables(
    screening: Screening,
    factors: Sequence[FactorLevels] = (),
    compared: Compared = NOT_COMPARED,
) -> dict[str, pd.DataFrame]:
    """Return all tables but the design by name of the file, without suffix.

    Args:
        screening: Result of the study.
        factors: Levels of the factors, for their physical values.
        compared: What the results are compared with.
    """
    tables = {
        "runs": runs_table(screening, physical_values(screening.design, factors)),
        "variance": variance_table(screening),
        "contributions": contributions_table(screening),
        "effects": effects_table(screening),
        "leading_terms": leading_table(screening),
    }
    if compared.published:
        tables["published"] = published_table(screening, compared.published)
    if compared.level_zero is not None:
        tables["level_zero"] = compared.level_zero.frame()
    if compared.check is not None:
        tables["check"] = compared.check.frame()
    return tables


def physical_values(design: Design, factors: Sequence[FactorLevels]) -> pd.DataFrame:
    """Return the physical values of each trial: one column `NAME [unit]` for each factor.

    If the keys of a factor have different values, there is a column `NAME KEY [unit]` for each.
    """
    columns = {}
    for factor in factors:
        places = design.levels[:, design.factors.index(factor.name)] + 1
        is_same = len(set(factor.numbers.values())) == 1
        for key in list(factor.numbers)[: 1 if is_same else None]:
            title = factor.name if is_same else f"{factor.name} {key}"
            columns[f"{title} [{factor.units[key]}]"] = np.array(factor.numbers[key])[places]
    return pd.DataFrame(columns, index=range(design.trials))


def runs_table(screening: Screening, physical: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return the table of all runs.

    Its columns are trial, load, levels, physical values, responses, whether the tub touches the
    housing, the springs that go slack, and the reason if the run failed.

    Args:
        screening: Result of the study.
        physical: Physical values of each trial, from `physical_values`.
    """
    design, responses = screening.design, screening.responses
    parts = []
    for load in screening.loads:
        values = responses.values[load].rename(
            columns={name: f"{name} [{unit}]" for name, unit in responses.units.items()}
        )
        part = pd.concat([design.frame(), physical, values], axis=1)
        part.insert(1, "load", load)
        part["touches"] = [
            "yes" if (trial, load) in responses.touching else "" for trial in range(design.trials)
        ]
        part["slack"] = [
            ", ".join(responses.slack.get((trial, load), [])) for trial in range(design.trials)
        ]
        part["failed"] = [responses.failed.get((trial, load), "") for trial in range(design.trials)]
        parts.append(part)
    return pd.concat(parts).sort_values("trial", kind="stable")


def variance_table(screening: Screening) -> pd.DataFrame:
    """Return the table of variance of each response, as [B] Table 4.

    It has the percentages of main effects, interactions and residual, mean and range of the runs,
    and adjusted and predicted R2.
    """
    rows = []
    for (load, name), table in screening.tables.items():
        values = screening.responses.values[load][name]
        rows.append(
            {
                "load": load,
                "response": name,
                "unit": screening.responses.units[name],
                "constant": table.constant,
                "smallest": values.min(),
                "largest": values.max(),
                "main_percent": table.main_percent,
                "interaction_percent": table.interaction_percent,
                "residual_percent": table.residual_percent,
                "total_sum_sq": table.total_sum_sq,
                "residual_sum_sq": table.residual_sum_sq,
                "residual_df": table.residual_df,
                "adjusted_r2": table.adjusted_r2,
                "predicted_r2": table.predicted_r2,
            }
        )
    return pd.DataFrame(rows)


def contributions_table(screening: Screening) -> pd.DataFrame:
    """Return contribution, sum of squares (type III) and degrees of freedom of all terms."""
    return pd.DataFrame(
        {
            "load": load,
            "response": name,
            "term": t.name,
            "percent": t.percent,
            "sum_sq": t.sum_sq,
            "df": t.df,
        }
        for (load, name), table in screening.tables.items()
        for t in table.terms
    )


def effects_table(screening: Screening) -> pd.DataFrame:
    """Return the table of all effects.

    Its columns include the term, the levels of its factors joined by a colon, and the effect in the
    unit of the response.
    """
    return pd.DataFrame(
        {"load": load, "response": name, "term": t.name, "levels": levels, "effect": effect}
        for (load, name), table in screening.tables.items()
        for t in table.terms
        for levels, effect in effects_of(t).items()
    )


def leading_table(screening: Screening) -> pd.DataFrame:
    """Return the table of leading terms, as [B] Table 5.

    It has the constant of each response, and contribution and effects of the terms above the
    thresholds of [B].
    """
    rows: list[dict[str, Any]] = []
    for (load, name), table in screening.tables.items():
        head = {"load": load, "response": name, "unit": screening.responses.units[name]}
        rows.append(
            head | {"term": "constant", "percent": np.nan, "levels": "", "effect": table.constant}
        )
        for term in leading_terms(table):
            rows += [
                head
                | {"term": term.name, "percent": term.percent, "levels": levels, "effect": effect}
                for levels, effect in effects_of(term).items()
            ]
    return pd.DataFrame(rows)


def published_table(screening: Screening, published: Published) -> pd.DataFrame:
    """Return our numbers and the published ones of each term that was published.

    Grand means are in the rows of the term `constant`, smallest and largest values in those of the
    term `range`, percentages of all main effects and all interactions in those of `main effects`
    and `interactions`. The columns are those of `leading_table`, with the published percentage and
    effect, and with "yes" where the effects of a term have another sign than the published ones.
    """
    rows: list[dict[str, Any]] = []
    for (load, name), table in screening.tables.items():
        label, unit = (load, name), screening.responses.units[name]
        head = {"load": load, "response": name, "unit": unit}
        mean = published.mean(label)
        if mean is not None:
            row = {"term": CONSTANT, "effect": table.constant, "published_effect": mean}
            rows.append(head | row | {"levels": ""})
        rows += [head | row for row in _published_sums(screening, published, label)]
        for of_label, term in published.compared_terms(screening):
            if of_label != label:
                continue
            percent, effects = published.percent(label, term), published.effects(label, term)
            differs = "yes" if published.sign_differs(label, term) else ""
            for levels, effect in term.effects.items():
                row = {
                    "term": term.name,
                    "percent": term.percent,
                    "published_percent": percent,
                    "levels": ":".join(map(str, levels)),
                    "effect": effect,
                    "published_effect": effects.get(levels),
                    "sign_differs": differs,
                }
                rows.append(head | row)
    columns = ("percent", "published_percent", "levels", "effect", "published_effect")
    heads = ("load", "response", "unit", "term", *columns, "sign_differs")
    return pd.DataFrame(rows, columns=heads)


def _published_sums(
    screening: Screening, published: Published, label: Label
) -> Iterator[dict[str, Any]]:
    """Yield the published range and sums of percentages of a response beside ours."""
    table, values = screening.tables[label], screening.responses.values[label[0]][label[1]]
    known_range = zip(
        ("smallest", "largest"), (values.min(), values.max()), published.range(label), strict=False
    )
    for level, value, theirs in known_range:
        yield {"term": RANGE, "levels": level, "effect": value, "published_effect": theirs}
    percents = (table.main_percent, table.interaction_percent)
    for term, percent, known in zip(
        (MAIN, INTERACTIONS), percents, published.sums(label), strict=True
    ):
        if known is not None:
            yield {"term": term, "levels": "", "percent": percent, "published_percent": known}


def effects_of(term: Term) -> dict[str, float]:
    """Return the effects of a term by levels as text: "-1", or "-1:0" for an interaction."""
    return {":".join(map(str, levels)): effect for levels, effect in term.effects.items()}


def as_plain_data(screening: Screening, compared: Compared = NOT_COMPARED) -> dict[str, Any]:
    """Return a screening as data for JSON.

    It has the design with its efficiency, the runs in which the tub touches the housing or a spring
    goes slack, and for each load and response the contributions, the effects at each level, and how
    well the model predicts. Published numbers and level 0 are compared ours if there are any.
    """
    published, zero = compared.published, compared.level_zero
    responses: dict[str, dict[str, Any]] = {load: {} for load in screening.loads}
    for (load, name), table in screening.tables.items():
        responses[load][name] = {
            "unit": screening.responses.units[name],
            "mean": finite(table.constant),
            "main_percent": finite(table.main_percent),
            "interaction_percent": finite(table.interaction_percent),
            "residual_percent": finite(table.residual_percent),
            "residual_df": table.residual_df,
            "adjusted_r2": finite(table.adjusted_r2),
            "predicted_r2": finite(table.predicted_r2),
            "terms": [
                {
                    "term": t.name,
                    "percent": finite(t.percent),
                    "effects": {k: finite(v) for k, v in effects_of(t).items()},
                    **_published_term(published, (load, name), t),
                }
                for t in table.terms
            ],
            **_published_mean(screening, published, (load, name)),
        }
    design = screening.design
    extra: dict[str, Any] = {}
    if published:
        extra["published"] = published.source
    if compared.check is not None:
        extra["check"] = [
            {k: finite(v) if isinstance(v, float) else v for k, v in row.items()}
            for row in compared.check.frame().to_dict("records")
        ]
    if zero is not None:
        extra["level_zero"] = {
            "tables": zero.tables,
            "responses": [
                {k: finite(v) if isinstance(v, float) else v for k, v in row.items()}
                for row in zero.frame().to_dict("records")
            ],
        }
    return {
        "design": design.kind,
        "model": design.model,
        "seed": design.seed,
        "trials": design.trials,
        "d_efficiency": design.efficiency(),
        "residual_df": design.residual_df,
        "touching": [
            {"trial": trial + 1, "load": load, "gap_mm": gap}
            for (trial, load), gap in screening.responses.touching.items()
        ],
        "slack": [
            {"trial": trial + 1, "load": load, "springs": springs}
            for (trial, load), springs in screening.responses.slack.items()
        ],
        "responses": responses,
        **extra,
    }


def _published_mean(screening: Screening, published: Published, label: Label) -> dict[str, Any]:
    """Return what was published of a response as a whole, and the difference of the means."""
    mean = published.mean(label)
    if mean is None:
        return {}
    difference = published.mean_difference(screening, label)
    entries: dict[str, Any] = {"published_mean": mean, "mean_difference_percent": difference}
    main, interactions = published.sums(label)
    known = {
        "published_main_percent": main,
        "published_interaction_percent": interactions,
        "published_range": list(published.range(label)) or None,
    }
    return entries | {key: value for key, value in known.items() if value is not None}


def _published_term(published: Published, label: Label, term: Term) -> dict[str, Any]:
    """Return the published contribution and effects of a term, if there are any."""
    entries: dict[str, Any] = {}
    percent, effects = published.percent(label, term), published.effects(label, term)
    if percent is not None:
        entries["published_percent"] = percent
    if effects:
        entries["published_effects"] = {":".join(map(str, k)): v for k, v in effects.items()}
        entries["sign_differs"] = published.sign_differs(label, term)
    return entries


def finite(value: float) -> float | None:
    """Return a number, or None if it is not finite, because JSON has no NaN."""
    return value if math.isfinite(value) else None
