"""Tables of text with the results of a screening study."""

import math
from collections.abc import Sequence

from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import MISSING, number, percent, significant
from wm_drake.report.table import Group, Row, Table, line
from wm_drake.studies.doe import MODELS
from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.check import Check
from wm_drake.studies.gasket.level_zero import LevelZero
from wm_drake.studies.gasket.published import FAR, NOT_PUBLISHED, Published
from wm_drake.studies.gasket.screening import (
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    Label,
    Screening,
    leading_terms,
)
from wm_drake.studies.gasket.words import LEVELS, Words

OTHER_SIGN = "sign differs"
"""Mark of a term whose effects have another sign than the published ones."""

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


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def r2_text(r2: float) -> str:
    """Return an R2 with three decimals; "below 0" if it is negative, a dash if it is NaN."""
    return "below 0" if r2 < 0.0 else number(r2, 3)


def published_cells(screening: Screening, published: Published, label: Label) -> tuple[str, str]:
    """Return the published mean of a response and the difference of ours from it, as text."""
    mean, difference = published.mean(label), published.mean_difference(screening, label)
    return (
        MISSING if mean is None else digits(mean),
        MISSING if difference is None else percent(difference),
    )


def variance(screening: Screening, words: Words, published: Published = NOT_PUBLISHED) -> Table:
    """Return mean, range, explained variance and R2 of each response, as [B] Table 4.

    The published mean is beside ours if there is one.
    """
    groups, far = [], published.far_means(screening)
    for load in screening.loads:
        rows = []
        for name in screening.names:
            table, values = screening.tables[load, name], screening.responses.values[load][name]
            cells = [digits(table.constant), digits(values.min()), digits(values.max())]
            if published.has_means:
                cells[1:1] = published_cells(screening, published, (load, name))
            if published.has_ranges:
                cells.append(" to ".join(map(digits, published.range((load, name)))) or MISSING)
            percents = [table.main_percent, table.interaction_percent, table.residual_percent]
            if published.has_sums:
                main, interactions = published.sums((load, name))
                percents[1:1] = [_or_nan(main)]
                percents[3:3] = [_or_nan(interactions)]
            rows.append(
                Row(
                    (
                        words.response(name),
                        screening.responses.units[name],
                        *cells,
                        *(number(percent, 1) for percent in percents),
                        r2_text(table.adjusted_r2),
                        r2_text(table.predicted_r2),
                    ),
                    "alarm" if (load, name) in far else "",
                )
            )
        groups.append(Group(load, tuple(rows)))
    header = (
        "load",
        "response",
        "unit",
        "mean",
        *(("published mean", "difference") if published.has_means else ()),
        "smallest",
        "largest",
        *(("published range",) if published.has_ranges else ()),
        "main effects, %",
        *(("published main effects, %",) if published.has_sums else ()),
        "interactions, %",
        *(("published interactions, %",) if published.has_sums else ()),
        "residual, %",
        "adjusted R²",
        "predicted R²",
    )
    caption = (
        "Percent of the variance of each response that is explained by all main effects, by all "
        "two-factor interactions, and by neither of them (residual). Predicted R²: explained part "
        "of the variance of trials that are left out of the fit."
    )
    if published.has_means:
        caption += (
            f" Published mean: from {published.source}. Difference: 100 % × (ours − published) / "
            f"published; rows in which it is above {FAR:g} % are marked."
        )
    return Table(caption, header, tuple(groups), text_columns=3)


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
        rows = [_row("constant", "", "", (digits(table.constant), "", ""), published, "ours")]
        if mean is not None:
            rows.append(_row("published constant", "", "", (digits(mean), "", ""), published))
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
    heads = ("published percent",) if published.has_terms else ()
    return Table(
        caption,
        ("response", "term", "percent", *heads, "low", "middle", "high"),
        tuple(groups),
        text_columns=2,
    )


def _row(
    name: str,
    ours: str,
    theirs: str,
    cells: Sequence[str],
    published: Published,
    kind: str = "",
) -> Row:
    """Return a row of the leading terms; it has a published percentage only if any is known."""
    return Row((name, ours, *((theirs,) if published.has_terms else ()), *cells), kind)


def _effect_rows(term: Term, words: Words, published: Published, label: Label) -> list[Row]:
    """Return a line with the values of the last factor, and the lines with the effects there."""
    *first, last = term.factors
    theirs, known = published.percent(label, term), published.effects(label, term)
    shown = MISSING if theirs is None else number(theirs, 1)
    values = tuple(words.value(last, level) for level in LEVELS)
    title, kind = words.term(term.name), "other"
    if published.sign_differs(label, term):
        title, kind = f"{title} ({OTHER_SIGN})", "alarm"
    rows = [_row(title, number(term.percent, 1), shown, values, published, kind)]
    for level in LEVELS if first else (None,):
        where = "" if level is None else f" at {first[0]} = {words.value(first[0], level)}"
        for source, effects in (("effect", term.effects), ("published effect", known)):
            if not effects:
                continue
            keys = [(x,) if level is None else (level, x) for x in LEVELS]
            cells = [digits(effects[key]) for key in keys]
            rows.append(_row(f"{source}{where}", "", "", cells, published))
    return rows


def level_zero(zero: LevelZero, words: Words) -> Table:
    """Return the responses of the machine and of level 0 with each treatment of tables."""
    groups = []
    for load in zero.responses.values:
        rows = []
        for name in zero.responses.units:
            label = (load, name)
            cells = [digits(zero.value(label, variant)) for variant in zero.variants]
            changes = [_change(zero.difference(label, v)) for v in zero.variants[1:]]
            unit = zero.responses.units[name]
            rows.append(Row((words.response(name), unit, *cells, *changes)))
        groups.append(Group(load, tuple(rows)))
    titles = [f"tables {name}" for name in zero.variants[1:]]
    header = (
        "load",
        "response",
        "unit",
        "machine",
        *(f"level 0, {title}" for title in titles),
        *(f"difference, {title}" for title in titles),
    )
    caption = (
        "The machine itself and level 0 of all factors. Tables scaled: the forces of a stiffness "
        "table are multiplied by the level. Tables linear: a table is replaced by its slope at "
        "rest, as in [B]. Differences are from the machine."
    )
    return Table(caption, header, tuple(groups), text_columns=3)


def check(comparison: Check, words: Words) -> Table:
    """Return prediction and run of each setting of `--check`."""
    groups = []
    for setting, of_setting in comparison.frame().groupby("setting", sort=False):
        rows = []
        for _, row in of_setting.iterrows():
            cells = [digits(row[name]) for name in ("predicted", "half_width", "run", "difference")]
            inside = "yes" if row["is_inside"] else "no"
            kind = "" if row["is_inside"] else "alarm"
            what = (str(row["load"]), words.response(str(row["response"])), str(row["unit"]))
            rows.append(Row((*what, *cells, inside), kind))
        groups.append(Group(str(setting), tuple(rows)))
    caption = (
        "Settings of --check: prediction of the fitted model, half width of its 95 % interval for "
        "a new run, the run, and run − prediction. Other factors are at their middle level."
    )
    header = (
        "setting",
        "load",
        "response",
        "unit",
        "predicted",
        "± 95 %",
        "run",
        "difference",
        "inside",
    )
    return Table(caption, header, tuple(groups), text_columns=4)


def _change(value: float) -> str:
    """Return a difference in percent with one decimal; NaN becomes a dash."""
    return MISSING if value != value else f"{number(value, 1)} %"


def touching(screening: Screening, words: Words) -> Table:
    """Return the runs in which the tub touches the housing, deepest first."""
    ranked = sorted(screening.responses.touching.items(), key=lambda item: item[1])
    names = screening.design.factors
    groups = []
    for (trial, load), gap in ranked[:MOST_TOUCHING]:
        levels = map(int, screening.design.levels[trial])
        values = (words.number(name, x) for name, x in zip(names, levels, strict=True))
        groups.append(line(str(trial + 1), (load, digits(gap), *values)))
    header = ("trial", "load", "gap, mm", *(_symbol(name, words) for name in names))
    left = len(ranked) - len(groups)
    more = f" {left} more are in runs.csv." if left else ""
    caption = f"Runs in which the tub touches the housing (gap of 0 or less).{more}"
    return Table(caption, header, tuple(groups), text_columns=2)


def _symbol(factor: str, words: Words) -> str:
    return ", ".join(filter(None, (factor, words.unit(factor))))


def contributions(screening: Screening, load: str, words: Words) -> Table:
    """Return the contribution of every term to every response of a load."""
    tables = [screening.tables[load, name] for name in screening.names]
    groups = []
    for index, term in enumerate(tables[0].terms):
        cells = tuple(number(table.terms[index].percent, 2) for table in tables)
        groups.append(Group(words.term(term.name), (Row(cells),)))
    groups.append(
        Group(
            "residual",
            (Row(tuple(number(table.residual_percent, 2) for table in tables), "difference"),),
        )
    )
    caption = f"Load {load}: contribution of every term, in percent of the variance."
    return Table(caption, ("term", *screening.names), tuple(groups))


def design(screening: Screening) -> Table:
    """Return the properties of the design and its efficiency for each model."""
    plan = screening.design
    rows = [("kind", plan.kind), ("trials", str(plan.trials)), ("factors", str(len(plan.factors)))]
    if plan.seed is not None:
        rows.append(("seed", str(plan.seed)))
    rows += [
        (f"D-efficiency for {model}", f"{number(plan.efficiency(model), 2)} %") for model in MODELS
    ]
    rows.append(("fitted model", plan.model))
    return Table(
        "Design of the experiment. main: main effects. main+2fi: main effects and two-factor "
        "interactions.",
        ("property", "value"),
        tuple(Group(word, (Row((text,)),)) for word, text in rows),
        text_columns=2,
    )


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
        "given as a table, the value is its slope at rest."
    )
    return Table(caption, header, tuple(groups), text_columns=2)
