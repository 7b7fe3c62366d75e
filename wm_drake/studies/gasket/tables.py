"""Tables of a gasket study: values for files and JSON, and what page and terminal show of them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import FactorLevels
from wm_drake.parameters.published import CONSTANT, INTERACTIONS, MAIN, RANGE
from wm_drake.report.formatting import MISSING, number, percent, plain, significant
from wm_drake.report.table import Column, Group, Row, Table, line, table_of
from wm_drake.studies.doe.anova import AnovaTable, Term
from wm_drake.studies.doe.coding import LEVELS, MODELS
from wm_drake.studies.doe.design import Design
from wm_drake.studies.gasket.proposal import NOT_COMPARED, Compared
from wm_drake.studies.gasket.screening import (
    FAR,
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    NOT_PUBLISHED,
    Label,
    Published,
    Screening,
    Words,
    contributions,
    leading_terms,
)
from wm_drake.studies.gasket.study import LevelZero
from wm_drake.studies.gasket.surface import Check

OTHER_SIGN = "sign differs"
"""Mark of a term whose effects have another sign than the published ones."""

SIGN_MARK = " \N{NOT EQUAL TO}\N{PLUS-MINUS SIGN}"
"""The same on the terminal."""

MOST_TOUCHING = 20
"""Largest number of runs that the table of contacts shows."""


def digits(value: float) -> str:
    """Return a value with three significant digits and a true minus sign; NaN becomes a dash."""
    if value != value:
        return MISSING
    size = abs(value)
    return number(
        value,
        0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else 3 if size >= 0.1 else 4,
    )


def r2_text(r2: float) -> str:
    """Return an R2 with three decimals; "below 0" if it is negative, a dash if it is NaN."""
    return "below 0" if r2 < 0.0 else number(r2, 3)


def _in_percent(value: float) -> str:
    return f"{number(value, 1)} %"


COLUMNS = {
    "setting": Column("setting"),
    "load": Column("load"),
    "response": Column("response"),
    "leading": Column("leading terms, percent"),
    "unit": Column("unit"),
    "constant": Column("mean", form=digits),
    "published_mean": Column("published mean", form=digits),
    "mean_difference": Column("difference", form=percent),
    "smallest": Column("smallest", form=digits),
    "largest": Column("largest", form=digits),
    "published_range": Column("published range"),
    "main_percent": Column("main effects", "%", 1),
    "published_main_percent": Column("published main effects", "%", 1),
    "interaction_percent": Column("interactions", "%", 1),
    "published_interaction_percent": Column("published interactions", "%", 1),
    "residual_percent": Column("residual", "%", 1),
    "adjusted_r2": Column("adjusted R²", form=r2_text),
    "predicted_r2": Column("predicted R²", form=r2_text),
    "machine": Column("machine", form=digits),
    "scaled": Column("level 0, tables scaled", form=digits),
    "linear": Column("level 0, tables linear", form=digits),
    "scaled_difference_percent": Column("difference, tables scaled", form=_in_percent),
    "linear_difference_percent": Column("difference, tables linear", form=_in_percent),
    "predicted": Column("predicted", form=digits),
    "half_width": Column("± 95 %", form=digits),
    "run": Column("run", form=digits),
    "difference": Column("difference", form=digits),
    "is_inside": Column("inside"),
}
"""Columns of the tables on page and terminal, in this order, by their names in files."""

NOT_ON_TERMINAL = {
    *("smallest", "largest", "adjusted_r2", "difference"),
    *("published_range", "published_main_percent", "published_interaction_percent"),
}
"""Columns for which a terminal is too narrow."""


def _shown(
    frame: pd.DataFrame, words: Words, caption: str, kinds: Sequence[str] = (), *, short: bool
) -> Table:
    """Return a table with the words of its responses; the short form is for a terminal."""
    names = [n for n in COLUMNS if n in frame and not (short and n in NOT_ON_TERMINAL)]
    frame = frame[names].assign(response=[words.response(name) for name in frame["response"]])
    return table_of(frame, caption, COLUMNS, kinds, grouped=not short)


def all_tables(
    screening: Screening, factors: Sequence[FactorLevels] = (), compared: Compared = NOT_COMPARED
) -> dict[str, pd.DataFrame]:
    """Return all tables but the design by name of the file, without suffix."""
    tables = {
        "runs": runs_frame(screening, physical_values(screening.design, factors)),
        "variance": variance_frame(screening),
        "contributions": contributions_frame(screening),
        "effects": effects_frame(screening),
        "leading_terms": leading_frame(screening),
    }
    if compared.published:
        tables["published"] = published_frame(screening, compared.published)
    if compared.level_zero is not None:
        tables["level_zero"] = compared.level_zero.frame()
    if compared.check is not None:
        tables["check"] = compared.check.frame()
    if compared.proposal is not None:
        tables["proposal"] = compared.proposal.frame()
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


def runs_frame(screening: Screening, physical: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return all runs.

    The columns are trial, load, levels, physical values, responses, whether the tub touches the
    housing, the springs that go slack, and the reason if the run failed.
    """
    design, responses = screening.design, screening.responses
    parts = []
    for load in screening.loads:
        values = responses.values[load].rename(
            columns={name: f"{name} [{unit}]" for name, unit in responses.units.items()}
        )
        part = pd.concat([design.frame(), physical, values], axis=1)
        part.insert(1, "load", load)
        places = [(trial, load) for trial in range(design.trials)]
        part["touches"] = ["yes" if place in responses.touching else "" for place in places]
        part["slack"] = [", ".join(responses.slack.get(place, [])) for place in places]
        part["failed"] = [responses.failed.get(place, "") for place in places]
        parts.append(part)
    return pd.concat(parts).sort_values("trial", kind="stable")


def variance_frame(screening: Screening) -> pd.DataFrame:
    """Return the variance of each response, as [B] Table 4.

    It has the percentages of main effects, interactions and residual, mean and range of the runs,
    and adjusted and predicted R2.
    """
    return pd.DataFrame(
        {
            **_head(screening, label),
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
        for label, table in screening.tables.items()
        for values in [screening.responses.values[label[0]][label[1]]]
    )


def _head(screening: Screening, label: Label) -> dict[str, Any]:
    return {"load": label[0], "response": label[1], "unit": screening.responses.units[label[1]]}


def contributions_frame(screening: Screening) -> pd.DataFrame:
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


def effects_frame(screening: Screening) -> pd.DataFrame:
    """Return all effects.

    The columns include the term, the levels of its factors joined by a colon, and the effect in the
    unit of the response.
    """
    return pd.DataFrame(
        {"load": load, "response": name, "term": t.name, "levels": levels, "effect": effect}
        for (load, name), table in screening.tables.items()
        for t in table.terms
        for levels, effect in by_levels(t.effects).items()
    )


def leading_frame(screening: Screening) -> pd.DataFrame:
    """Return the leading terms, as [B] Table 5.

    It has the constant of each response, and contribution and effects of the terms above the
    thresholds of [B].
    """
    rows: list[dict[str, Any]] = []
    for label, table in screening.tables.items():
        head = _head(screening, label)
        constant = {"term": CONSTANT, "percent": np.nan, "levels": "", "effect": table.constant}
        rows.append(head | constant)
        for term in leading_terms(table):
            rows += [
                head
                | {"term": term.name, "percent": term.percent, "levels": levels, "effect": effect}
                for levels, effect in by_levels(term.effects).items()
            ]
    return pd.DataFrame(rows)


def published_frame(screening: Screening, published: Published) -> pd.DataFrame:
    """Return our numbers and the published ones of each term that was published.

    Grand means are in the rows of the term `constant`, smallest and largest values in those of the
    term `range`, percentages of all main effects and all interactions in those of `main effects`
    and `interactions`. The columns are those of `leading_frame`, with the published percentage and
    effect, and with "yes" where the effects of a term have another sign than the published ones.
    """
    rows: list[dict[str, Any]] = []
    for label, table in screening.tables.items():
        head, mean = _head(screening, label), published.mean(label)
        if mean is not None:
            row = {"term": CONSTANT, "effect": table.constant, "published_effect": mean}
            rows.append(head | row | {"levels": ""})
        rows += [head | row for row in _published_sums(screening, published, label)]
        for of_label, term in published.compared_terms(screening):
            if of_label != label:
                continue
            share, effects = published.percent(label, term), published.effects(label, term)
            differs = "yes" if published.sign_differs(label, term) else ""
            for levels, effect in term.effects.items():
                row = {
                    "term": term.name,
                    "percent": term.percent,
                    "published_percent": share,
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
    for term, ours, known in zip(
        (MAIN, INTERACTIONS), percents, published.sums(label), strict=True
    ):
        if known is not None:
            yield {"term": term, "levels": "", "percent": ours, "published_percent": known}


def by_levels(effects: Mapping[tuple[int, ...], float]) -> dict[str, float]:
    """Return effects by levels as text: "-1", or "-1:0" for an interaction."""
    return {":".join(map(str, levels)): effect for levels, effect in effects.items()}


def as_plain_data(screening: Screening, compared: Compared = NOT_COMPARED) -> dict[str, Any]:
    """Return a screening as data for JSON.

    It has the design with its efficiency, the runs in which the tub touches the housing or a spring
    goes slack, and for each load and response the contributions, the effects at each level, and how
    well the model predicts. Published numbers and level 0 are compared ours if there are any.
    """
    published, zero, check = compared.published, compared.level_zero, compared.check
    design, responses = screening.design, screening.responses
    shown: dict[str, Any] = {
        "design": design.kind,
        "model": design.model,
        "seed": design.seed,
        "trials": design.trials,
        "d_efficiency": design.efficiency(),
        "residual_df": design.residual_df,
        "touching": [
            {"trial": trial + 1, "load": load, "gap_mm": gap}
            for (trial, load), gap in responses.touching.items()
        ],
        "slack": [
            {"trial": trial + 1, "load": load, "springs": springs}
            for (trial, load), springs in responses.slack.items()
        ],
        "responses": {
            load: {
                name: _response_as_json(screening, published, (load, name))
                for name in screening.names
            }
            for load in screening.loads
        },
    }
    if published:
        shown["published"] = published.source
    if check is not None:
        shown["check"] = check.frame().to_dict("records")
    if compared.proposal is not None:
        shown["proposal"] = compared.proposal.as_json()
    if zero is not None:
        rows = zero.frame().to_dict("records")
        shown["level_zero"] = {"tables": zero.tables, "responses": rows}
    return plain(shown)


def _response_as_json(screening: Screening, published: Published, label: Label) -> dict[str, Any]:
    table, mean = screening.tables[label], published.mean(label)
    shown = {
        "unit": screening.responses.units[label[1]],
        "mean": table.constant,
        "main_percent": table.main_percent,
        "interaction_percent": table.interaction_percent,
        "residual_percent": table.residual_percent,
        "residual_df": table.residual_df,
        "adjusted_r2": table.adjusted_r2,
        "predicted_r2": table.predicted_r2,
        "terms": [_term_as_json(term, published, label) for term in table.terms],
    }
    if mean is not None:
        shown["published_mean"] = mean
        shown["mean_difference_percent"] = published.mean_difference(screening, label)
        main, interactions = published.sums(label)
        known = {
            "published_main_percent": main,
            "published_interaction_percent": interactions,
            "published_range": published.range(label) or None,
        }
        shown |= {key: value for key, value in known.items() if value is not None}
    return shown


def _term_as_json(term: Term, published: Published, label: Label) -> dict[str, Any]:
    shown = {"term": term.name, "percent": term.percent, "effects": by_levels(term.effects)}
    share, effects = published.percent(label, term), published.effects(label, term)
    if share is not None:
        shown["published_percent"] = share
    if effects:
        shown["published_effects"] = by_levels(effects)
        shown["sign_differs"] = published.sign_differs(label, term)
    return shown


def variance(
    screening: Screening,
    words: Words,
    published: Published = NOT_PUBLISHED,
    *,
    short: bool = False,
    has_terms: bool = False,
) -> Table:
    """Return mean, range, explained variance and R2 of each response, as [B] Table 4.

    The published mean is beside ours if there is one.
    """
    frame, labels = variance_frame(screening), list(screening.tables)
    means = [published.mean(label) for label in labels]
    has_means = any(mean is not None for mean in means)
    if has_means:
        frame["published_mean"] = means
        frame["mean_difference"] = [published.mean_difference(screening, x) for x in labels]
    ranges = [" to ".join(map(digits, published.range(label))) for label in labels]
    if any(ranges):
        frame["published_range"] = [text or None for text in ranges]
    names = ["published_main_percent", "published_interaction_percent"]
    sums = pd.DataFrame(map(published.sums, labels), dtype=float, columns=names)
    if sums.notna().any(axis=None):
        frame[names] = sums
    if has_terms:
        frame["leading"] = [
            _leading_text(table, published, label) for label, table in screening.tables.items()
        ]
    far = published.far_means(screening)
    caption = (
        "Percent of the variance of each response that is explained by all main effects, by all "
        "two-factor interactions, and by neither of them (residual). Predicted R²: explained part "
        "of the variance of trials that are left out of the fit."
    )
    if has_means:
        caption += (
            f" Published mean: from {published.source}. Difference: 100 % × (ours − published) / "
            f"published; rows in which it is above {FAR:g} % are marked."
        )
    kinds = ["alarm" if label in far else "" for label in labels]
    return _shown(frame, words, caption, kinds, short=short)


def _leading_text(table: AnovaTable, published: Published, label: Label) -> str:
    """Return the leading terms of a response with their percentages, and the published ones."""
    texts = []
    for term in leading_terms(table):
        known = published.percent(label, term)
        mark = SIGN_MARK if published.sign_differs(label, term) else ""
        theirs = "" if known is None else f" ({known:.0f}{mark})"
        texts.append(f"{term.name.replace(':', ' × ')} {term.percent:.0f}{theirs}")
    return ", ".join(texts)


def leading(
    screening: Screening, load: str, words: Words, published: Published = NOT_PUBLISHED
) -> Table:
    """Return the leading terms of each response of a load with their effects, as [B] Table 5.

    Published numbers are beside ours; a term that was published is in the table although it is not
    among our leading terms.
    """
    groups = []
    for name in screening.names:
        label, unit = (load, name), screening.responses.units[name]
        table, mean = screening.tables[label], published.mean(label)
        rows = [Row(("constant", "", "", digits(table.constant), "", ""), "ours")]
        if mean is not None:
            rows.append(Row(("published constant", "", "", digits(mean), "", "")))
        shown = leading_terms(table)
        compared = [t for of, t in published.compared_terms(screening) if of == label]
        shown += [t for t in compared if t not in shown]
        for term in shown:
            rows += _effect_rows(term, words, published, label)
        groups.append(Group(f"{words.response(name)}, {unit}", tuple(rows)))
    caption = (
        f"Load {load}: constant, main effects above {LEADING_MAIN_PERCENT:g} % and interactions "
        f"above {LEADING_INTERACTION_PERCENT:g} %, largest first. Each effect is below the value "
        "of the factor that causes it: the deviation from the constant, in the unit of the "
        "response. The effects of a factor sum to zero. For an interaction, each line is a value "
        "of its first factor, and each column a value of its second factor."
    )
    if published:
        caption += (
            f" Published numbers: from {published.source}; their levels are those of [B]. A term "
            f"whose effect at the lowest level has another sign is marked: {OTHER_SIGN}."
        )
    header = ("response", "term", "percent", "published percent", "low", "middle", "high")
    table_of_load = Table(caption, header, tuple(groups), text_columns=2)
    if published.has_terms:
        return table_of_load
    return table_of_load.without("published percent")


def _effect_rows(term: Term, words: Words, published: Published, label: Label) -> list[Row]:
    """Return a line with the values of the last factor, and the lines with the effects there."""
    *first, last = term.factors
    theirs, known = published.percent(label, term), published.effects(label, term)
    share = MISSING if theirs is None else number(theirs, 1)
    values = tuple(words.value(last, level) for level in LEVELS)
    title, kind = words.term(term.name), "other"
    if published.sign_differs(label, term):
        title, kind = f"{title} ({OTHER_SIGN})", "alarm"
    rows = [Row((title, number(term.percent, 1), share, *values), kind)]
    for level in LEVELS if first else (None,):
        where = "" if level is None else f" at {first[0]} = {words.value(first[0], level)}"
        for source, effects in (("effect", term.effects), ("published effect", known)):
            if not effects:
                continue
            keys = [(x,) if level is None else (level, x) for x in LEVELS]
            rows.append(Row((f"{source}{where}", "", "", *(digits(effects[k]) for k in keys))))
    return rows


def level_zero(zero: LevelZero, words: Words) -> Table:
    """Return the responses of the machine and of level 0 with each treatment of tables."""
    caption = (
        "The machine itself and level 0 of all factors. Tables scaled: the forces of a stiffness "
        "table are multiplied by the level. Tables linear: a table is replaced by its slope at "
        "rest, as in [B]. Differences are from the machine."
    )
    return _shown(zero.frame(), words, caption, short=False)


def check(comparison: Check, words: Words, *, short: bool = False) -> Table:
    """Return prediction and run of each setting of `--check`."""
    frame = comparison.frame()
    caption = (
        "Settings of --check: prediction of the fitted model, half width of its 95 % interval for "
        "a new run, the run, and run − prediction. Other factors are at their middle level."
    )
    kinds = ["" if is_inside else "alarm" for is_inside in frame["is_inside"]]
    return _shown(frame, words, caption, kinds, short=short)


def touching(screening: Screening, words: Words) -> Table:
    """Return the runs in which the tub touches the housing, deepest first."""
    ranked = sorted(screening.responses.touching.items(), key=lambda item: item[1])
    names = screening.design.factors
    groups = []
    for (trial, load), gap in ranked[:MOST_TOUCHING]:
        levels = map(int, screening.design.levels[trial])
        values = (words.number(name, x) for name, x in zip(names, levels, strict=True))
        groups.append(line(str(trial + 1), (load, digits(gap), *values)))
    columns = tuple(Column(name, words.unit(name)) for name in names)
    left = len(ranked) - len(groups)
    more = f" {left} more are in runs.csv." if left else ""
    caption = f"Runs in which the tub touches the housing (gap of 0 or less).{more}"
    return Table(caption, ("trial", "load", "gap, mm", *columns), tuple(groups), text_columns=2)


def all_contributions(screening: Screening, load: str, words: Words) -> Table:
    """Return the contribution of every term to every response of a load."""
    shares = contributions(screening)[load]
    rest = [screening.tables[load, name].residual_percent for name in shares]
    groups = [line(words.term(name), values) for name, *values in shares.itertuples(name=None)]
    groups.append(line("residual", rest, "difference"))
    caption = f"Load {load}: contribution of every term, in percent of the variance."
    columns = tuple(Column(str(name), decimals=2) for name in shares)
    return Table(caption, ("term", *columns), tuple(groups))


def design(screening: Screening) -> Table:
    """Return the properties of the design and its efficiency for each model."""
    plan = screening.design
    rows = {"kind": plan.kind, "trials": str(plan.trials), "factors": str(len(plan.factors))}
    rows |= {} if plan.seed is None else {"seed": str(plan.seed)}
    rows |= {f"D-efficiency for {m}": f"{number(plan.efficiency(m), 2)} %" for m in MODELS}
    rows["fitted model"] = plan.model
    caption = (
        "Design of the experiment. main: main effects. main+2fi: main effects and two-factor "
        "interactions. The D-efficiency is det(X′X / n)^(1/p), in percent of the value of the full "
        "factorial. No design can exceed 100 %."
    )
    groups = tuple(line(word, (text,)) for word, text in rows.items())
    return Table(caption, ("property", "value"), groups, text_columns=2)


def factors(levels: Sequence[FactorLevels], words: Words) -> Table:
    """Return the values of the machine file that belong to the levels of each factor."""
    groups = []
    for factor in levels:
        rows = []
        for key, numbers in factor.numbers.items():
            cells = map(significant, numbers)
            value = factor.nominal[key] or MISSING
            rows.append(Row((key, value, *cells, factor.units[key])))
        groups.append(Group(words.factor(factor.name), tuple(rows)))
    header = (
        "factor",
        "key of the machine file",
        "value in the machine",
        "low (−1)",
        "middle (0)",
        "high (+1)",
        "unit",
    )
    caption = (
        "Factors and their levels. All keys of a factor change together. For a stiffness that is "
        "given as a table, the value is the slope of a line through its first 20 %."
    )
    return Table(caption, header, tuple(groups), text_columns=2)
