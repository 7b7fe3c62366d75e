"""Tables of text with the results of a screening study."""

from collections.abc import Sequence

from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import MISSING, number
from wm_drake.report.tables import Group, Row, Table
from wm_drake.studies.doe import MODELS
from wm_drake.studies.gasket.screening import (
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    Screening,
    leading_terms,
)


def term_title(name: str) -> str:
    """Return the name of a term for reading: `K_Lx:C_T` becomes `K_Lx × C_T`."""
    return name.replace(":", " × ")


def digits(value: float) -> str:
    """Return a value with three significant digits and a true minus sign; NaN becomes a dash."""
    if value != value:
        return MISSING
    size = abs(value)
    return number(
        value,
        0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else 3 if size >= 0.1 else 4,
    )


def variance(screening: Screening) -> Table:
    """Return mean, range and explained variance of each response, as [B] Table 4."""
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
                        name,
                        screening.responses.units[name],
                        *cells,
                        *(number(percent, 1) for percent in percents),
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
    )
    caption = (
        "Percent of the variance of each response that is explained by all main effects, by all "
        "two-factor interactions, and by neither of them (residual)."
    )
    return Table(caption, header, tuple(groups), text_columns=3)


def leading(screening: Screening, load: str) -> Table:
    """Return the leading terms of each response of a load with their effects, as [B] Table 5."""
    groups = []
    for name in screening.names:
        table, unit = screening.tables[load, name], screening.responses.units[name]
        rows = [Row(("constant", "", digits(table.constant), "", ""), "ours")]
        for term in leading_terms(table):
            if len(term.factors) == 1:
                effects = [digits(term.effects[(level,)]) for level in (-1, 0, 1)]
                rows.append(Row((term_title(term.name), number(term.percent, 1), *effects)))
            else:
                corners = {levels: digits(term.effects[levels]) for levels in term.effects}
                for index, first in enumerate((-1, 0, 1)):
                    title = (
                        f"{term_title(term.name)}, {term.factors[0]} at {('−1', '0', '+1')[index]}"
                    )
                    percent = number(term.percent, 1) if index == 0 else ""
                    rows.append(
                        Row((title, percent, *(corners[first, second] for second in (-1, 0, 1))))
                    )
        groups.append(Group(f"{name}, {unit}", tuple(rows)))
    caption = (
        f"Load {load}: constant, main effects above {LEADING_MAIN_PERCENT:g} % and interactions "
        f"above {LEADING_INTERACTION_PERCENT:g} %, largest first. Effects are deviations from the "
        "constant, in the unit of the response. The effects of a factor sum to zero. For an "
        "interaction, each line is a level of its first factor, and each column a level of its "
        "second factor."
    )
    return Table(
        caption,
        ("response", "term", "percent", "at −1", "at 0", "at +1"),
        tuple(groups),
        text_columns=2,
    )


def contributions(screening: Screening, load: str) -> Table:
    """Return the contribution of every term to every response of a load."""
    tables = [screening.tables[load, name] for name in screening.names]
    groups = []
    for index, term in enumerate(tables[0].terms):
        cells = tuple(number(table.terms[index].percent, 2) for table in tables)
        groups.append(Group(term_title(term.name), (Row(cells),)))
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


def factors(levels: Sequence[FactorLevels]) -> Table:
    """Return the values of the machine file that belong to the levels of each factor."""
    groups = []
    for factor in levels:
        keys = list(factor.nominal)
        rows = []
        for index, key in enumerate(keys):
            shown = factor.shown if index == 0 else ("", "", "")
            rows.append(
                Row(
                    (
                        key,
                        factor.nominal[key] or MISSING,
                        *shown,
                        factor.about if index == 0 else "",
                    )
                )
            )
        groups.append(Group(factor.name, tuple(rows)))
    header = (
        "factor",
        "key of the machine file",
        "value in the machine",
        "level −1",
        "level 0",
        "level +1",
        "description",
    )
    caption = (
        "Factors and their levels. All keys of a factor change together. For a stiffness that is "
        "given as a table, the value is its slope at rest."
    )
    return Table(caption, header, tuple(groups), text_columns=7)
