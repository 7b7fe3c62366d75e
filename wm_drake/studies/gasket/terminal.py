"""Results of a gasket study on the terminal."""

from rich.table import Table

from wm_drake.report.terminal import Console
from wm_drake.studies.doe.anova import AnovaTable
from wm_drake.studies.gasket.check import Check
from wm_drake.studies.gasket.page_tables import published_cells, r2_text
from wm_drake.studies.gasket.published import Published
from wm_drake.studies.gasket.screening import Label, Screening, leading_terms
from wm_drake.studies.gasket.words import Words

WIDE = 100
"""Width of a terminal from which on its table has the leading terms. [characters]"""

SIGN_MARK = " \N{NOT EQUAL TO}\N{PLUS-MINUS SIGN}"
"""Mark of a term whose effect has another sign than the published one."""


def variance_table(screening: Screening, words: Words, published: Published) -> Table:
    """Return the percentages of the variance, with published means and terms if there are any."""
    design, has_means = screening.design, published.has_means
    about = f"{design.kind}, {design.trials} trials, D-efficiency {design.efficiency():.2f} %"
    table = Table(title=f"Percent of the variance explained ({about})")
    for name in ("load", "response"):
        table.add_column(name)
    means = ("mean", "pub-\nlished\nmean", "differ-\nence") if has_means else ("mean",)
    for name in (*means, "main", "inter-\nactions", "resid-\nual", "pre-\ndicted\nR2"):
        table.add_column(name, justify="right")
    is_wide = Console().width >= WIDE
    if is_wide:
        table.add_column("leading terms, percent")
    for (load, name), anova in screening.tables.items():
        leading = ", ".join(_leading_texts(anova, published, (load, name)))
        percents = (anova.main_percent, anova.interaction_percent, anova.residual_percent)
        mean = f"{anova.constant:.3g} {screening.responses.units[name]}"
        known = published_cells(screening, published, (load, name)) if has_means else ()
        texts = (load, words.response(name), mean, *known, *(f"{v:.1f}" for v in percents))
        table.add_row(*texts, r2_text(anova.predicted_r2), *([leading] if is_wide else []))
    return table


def _leading_texts(table: AnovaTable, published: Published, label: Label) -> list[str]:
    """Return the leading terms of a response with their percentages, and the published ones."""
    texts = []
    for term in leading_terms(table):
        known = published.percent(label, term)
        mark = SIGN_MARK if published.sign_differs(label, term) else ""
        theirs = "" if known is None else f" ({known:.0f}{mark})"
        texts.append(f"{term.name.replace(':', ' × ')} {term.percent:.0f}{theirs}")
    return texts


def check_table(check: Check) -> Table:
    """Return prediction and run of each setting of `--check`."""
    table = Table(title="Fitted model and runs of --check")
    for name in ("setting", "load", "response"):
        table.add_column(name)
    for name in ("predicted", "± 95 %", "run", "inside"):
        table.add_column(name, justify="right")
    for row in check.frame().to_dict("records"):
        numbers = (f"{row[name]:.4g}" for name in ("predicted", "half_width", "run"))
        inside = "yes" if row["is_inside"] else "no"
        response = f"{row['response']}, {row['unit']}"
        table.add_row(str(row["setting"]), str(row["load"]), response, *numbers, inside)
    return table
