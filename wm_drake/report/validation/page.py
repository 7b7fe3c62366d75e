"""Write the validation page: verdicts in Markdown, with date, version and a reason per row."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from textwrap import fill

import pandas as pd

from wm_drake.report.provenance import now, program
from wm_drake.studies.validation.rows import FITTED, MISSED, PREDICTED, Row, counts

WIDTH = 100
"""Largest length of a line of prose. [characters]"""

COLUMNS = ("quantity", "kind", "published", "ours", "difference", "verdict", "reason")


def validation_page(
    rows: Sequence[Row],
    command: str,
    notes: Sequence[str] = (),
    reasons: Mapping[str, str] = {},
    tables: Mapping[str, pd.DataFrame] = {},
) -> str:
    """Return the page as Markdown.

    Args:
        rows: All rows; those of one section follow each other.
        command: Command that writes the page.
        notes: Sentences on what was run.
        reasons: Explanations of missed rows, by section or by `SECTION | QUANTITY`; and of tables,
            by heading.
        tables: Tables without verdicts by heading, for the end of the page.
    """
    text = [
        "# Validation",
        "",
        "What the shipped machines are fitted to, what they predict, and what they miss. Each",
        "result is beside the published number. A script writes the page; do not edit it:",
        "",
        "```text",
        command,
        "```",
        "",
        f"Written {now()} by {program()}.",
        "",
        "Fitted: the number was a target of the calibration. Predicted: it was not. Sources:",
        "[A], [B] and [C] are the papers in the [README](../README.md).",
        "",
        *(fill(f"- {note}", WIDTH, subsequent_indent="  ") for note in notes),
        "",
        "## Summary",
        "",
        *_summary(rows),
    ]
    for section, group in groupby(rows, key=lambda row: row.section):
        text += ["", f"## {section}", ""]
        if section in reasons:
            text += [fill(reasons[section], WIDTH), ""]
        text += _line(COLUMNS), _line(["---"] * len(COLUMNS))
        for row in group:
            known = reasons.get(f"{section} | {row.quantity}", "")
            why = "; ".join(filter(None, [row.reason, known]))
            verdict = f"**{row.verdict}**" if row.verdict == MISSED else row.verdict
            cells = (row.quantity, row.kind, row.published, row.ours, row.difference, verdict, why)
            text.append(_line(cells))
    for heading, table in tables.items():
        text += ["", f"## {heading}", ""]
        if heading in reasons:
            text += [fill(reasons[heading], WIDTH), ""]
        text += _line(list(map(str, table.columns))), _line(["---"] * len(table.columns))
        text += [_line(list(map(str, row))) for row in table.itertuples(index=False)]
    return "\n".join(text) + "\n"


def _summary(rows: Sequence[Row]) -> list[str]:
    table = counts(rows)
    lines = [_line(["section", "kind", *table.columns]), _line(["---"] * (2 + len(table.columns)))]
    lines += [_line(list(map(str, row))) for row in table.reset_index().itertuples(index=False)]
    for kind in (FITTED, PREDICTED):
        own = [row for row in rows if row.kind == kind]
        missed = sum(row.verdict == MISSED for row in own)
        lines += ["", f"Of {len(own)} {kind} results, {missed} are missed."]
    return lines


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"
