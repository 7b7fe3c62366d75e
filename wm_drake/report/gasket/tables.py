"""Tables of text with the results of a screening study."""

from collections.abc import Sequence

from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import MISSING, number, significant
from wm_drake.report.gasket.words import LEVELS, Words
from wm_drake.report.tables import Group, Row, Table, line
from wm_drake.studies.doe import MODELS
from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.screening import (
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    Screening,
    leading_terms,
)

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


def variance(screening: Screening, words: Words) -> Table:
    """Return mean, range, explained variance and R2 of each response, as [B] Table 4."""
    groups = []
    for load in screening.loads:
        rows = []
        for name in screening.names:
            table, values = screening.tables[load, name], screening.responses.values[load][name]
            cells = (digits(table.constant), digits(values.min()), digits(values.max()))
            percents = (table.main_percent, table.interaction_percent, table.residual_percent)
            rows.append(
                Row(
                    (
                        words.response(name),
                        screening.responses.units[name],
                        *cells,
                        *(number(percent, 1) for percent in percents),
                        r2_text(table.adjusted_r2),
                        r2_text(table.predicted_r2),
                    )
                )
            )
        groups.append(Group(load, tuple(rows)))
    header = (
        "load",
        "response",
        "unit",
        "mean",
        "smallest",
        "largest",
        "main effects, %",
        "interactions, %",
        "residual, %",
        "adjusted R²",
        "predicted R²",
    )
    caption = (
        "Percent of the variance of each response that is explained by all main effects, by all "
        "two-factor interactions, and by neither of them (residual). Predicted R²: explained part "
        "of the variance of trials that are left out of the fit."
    )
    return Table(caption, header, tuple(groups), text_columns=3)


def leading(screening: Screening, load: str, words: Words) -> Table:
    """Return the leading terms of each response of a load with their effects, as [B] Table 5."""
    groups = []
    for name in screening.names:
        table, unit = screening.tables[load, name], screening.responses.units[name]
        rows = [Row(("constant", "", digits(table.constant), "", ""), "ours")]
        for term in leading_terms(table):
            rows += _effect_rows(term, words)
        groups.append(Group(f"{words.response(name)}, {unit}", tuple(rows)))
    caption = (
        f"Load {load}: constant, main effects above {LEADING_MAIN_PERCENT:g} % and interactions "
        f"above {LEADING_INTERACTION_PERCENT:g} %, largest first. Each effect is below the value "
        "of the factor that causes it: the deviation from the constant, in the unit of the "
        "response. The effects of a factor sum to zero. For an interaction, each line is a value "
        "of its first factor, and each column a value of its second factor."
    )
    return Table(
        caption,
        ("response", "term", "percent", "low", "middle", "high"),
        tuple(groups),
        text_columns=2,
    )


def _effect_rows(term: Term, words: Words) -> list[Row]:
    """Return a line with the values of the last factor, and the lines with the effects there."""
    *first, last = term.factors
    values = tuple(words.value(last, level) for level in LEVELS)
    rows = [Row((words.term(term.name), number(term.percent, 1), *values), "other")]
    if not first:
        effects = (digits(term.effects[(level,)]) for level in LEVELS)
        return [*rows, Row(("effect", "", *effects))]
    for level in LEVELS:
        effects = (digits(term.effects[level, other]) for other in LEVELS)
        title = f"effect at {first[0]} = {words.value(first[0], level)}"
        rows.append(Row((title, "", *effects)))
    return rows


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
