"""Write the pages of verification, validation and prediction in Markdown, with a reason per row."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from textwrap import fill
from typing import Any

import pandas as pd

from wm_drake.report.provenance import now, program
from wm_drake.studies.validation.rows import FITTED, MISSED, PREDICTED, Row, counts

WIDTH = 100
"""Largest length of a line of prose. [characters]"""

COLUMNS = ("quantity", "published", "ours", "difference", "verdict", "reason")

UNEXPLAINED = "not explained yet"
"""Reason of a row that is missed and has no explanation."""

TITLES = {FITTED: "Validation", PREDICTED: "Prediction"}

ABOUT = {
    FITTED: "Do the equations describe the machines of [A], [B] and [C]? These published numbers "
    "were targets of the calibration. Numbers that were not are on the page "
    "[prediction](prediction.md).",
    PREDICTED: "Does the model tell what it was not fitted to? These published numbers were no "
    "targets of the calibration. Those that were are on the page [validation](validation.md).",
}


@dataclass(frozen=True)
class Made:
    """How a page was made.

    Attributes:
        command: Command that writes the page.
        notes: Sentences on what was run.
        reasons: Explanations by section, by `SECTION | QUANTITY`, and command and tolerance of a
            section by `SECTION | command` and `SECTION | tolerance`.
    """

    command: str
    notes: Sequence[str] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)


def validation_page(
    rows: Sequence[Row], made: Made, kind: str, tables: Mapping[str, pd.DataFrame] = {}
) -> str:
    """Return the page of the rows of one kind as Markdown.

    Args:
        rows: All rows; those of one section follow each other.
        made: How they were made.
        kind: `FITTED` or `PREDICTED`.
        tables: Tables without verdicts by heading, for the end of the page.
    """
    own = [row for row in rows if row.kind == kind]
    text = [
        f"# {TITLES[kind]}",
        "",
        fill(ABOUT[kind], WIDTH),
        "",
        *_origin(made.command),
        "Sources: [A], [B] and [C] are the papers in the [README](../README.md).",
        "",
        *(fill(f"- {note}", WIDTH, subsequent_indent="  ") for note in made.notes),
        "",
        "## Summary",
        "",
        *_summary(own, kind),
    ]
    for section, group in groupby(own, key=lambda row: row.section):
        text += ["", f"## {section}", "", *_head_of_section(section, made.reasons)]
        text += _line(COLUMNS), _line(["---"] * len(COLUMNS))
        text += [_line(_cells(row, made.reasons)) for row in group]
    for heading, table in tables.items():
        text += ["", f"## {heading}", "", *_head_of_section(heading, made.reasons)]
        text += _line(list(map(str, table.columns))), _line(["---"] * len(table.columns))
        text += [_line(list(map(str, row))) for row in table.itertuples(index=False)]
    return "\n".join(text) + "\n"


def verification_page(
    groups: Mapping[str, Sequence[Mapping[str, Any]]],
    command: str,
    outcomes: Mapping[str, tuple[int, int]],
) -> str:
    """Return the page of verification as Markdown.

    Args:
        groups: Rows by heading, each with what, against, agreement, and tests or a command.
        command: Command that writes the page.
        outcomes: How many tests ran and how many of them failed, by test or file of tests; empty
            if they were not run.
    """
    about = (
        "Does the program solve its equations? Each row is compared by tests or by a command. The "
        "tests are part of the test suite: some have the marker `slow`, those with the marker "
        "`hours` are run by hand. `pytest -m ''` followed by the name of a test runs it alone, "
        "whatever its marker."
    )
    text = ["# Verification", "", fill(about, WIDTH), "", *_origin(command)]
    columns = ["what", "against", "agreement", "run by", *(["last run"] if outcomes else [])]
    for heading, rows in groups.items():
        text += ["", f"## {heading}", "", _line(columns), _line(["---"] * len(columns))]
        for row in rows:
            tests = list(row.get("tests", ()))
            run_by = [f"`{name}`" for name in tests]
            run_by += [f"`{row['command']}`"] if "command" in row else []
            cells = [row["what"], row["against"], row["agreement"], "<br>".join(run_by)]
            if outcomes:
                cells.append(_outcome([outcomes.get(name, (0, 0)) for name in tests]))
            text.append(_line(cells))
    return "\n".join(text) + "\n"


def _outcome(of_row: Sequence[tuple[int, int]]) -> str:
    """Return what the tests of a row gave, in words; empty for a row without tests."""
    if not of_row:
        return ""
    if not all(ran for ran, _ in of_row):
        return "not run: marked `hours`, or skipped"
    ran, failed = map(sum, zip(*of_row, strict=True))
    return f"**{failed} of {ran} failed**" if failed else f"{ran} passed"


def _origin(command: str) -> list[str]:
    return [
        "A script writes this page; do not edit it:",
        "",
        "```text",
        command,
        "```",
        "",
        f"Written {now()} by {program()}.",
        "",
    ]


def _head_of_section(section: str, reasons: Mapping[str, str]) -> list[str]:
    """Return explanation, command and tolerance of a section."""
    lines = [fill(reasons[section], WIDTH), ""] if section in reasons else []
    for name in ("command", "tolerance"):
        words = reasons.get(f"{section} | {name}")
        if words:
            code = "; ".join(f"`{part}`" for part in words.split("; "))
            sentence = f"{name.capitalize()}: {code if name == 'command' else words}."
            lines += [sentence if name == "command" else fill(sentence, WIDTH), ""]
    return lines


def _cells(row: Row, reasons: Mapping[str, str]) -> list[str]:
    known = reasons.get(f"{row.section} | {row.quantity}", "")
    if row.verdict == MISSED and not known:
        known = UNEXPLAINED
    why = "; ".join(filter(None, [row.reason, known if row.verdict == MISSED else ""]))
    verdict = f"**{row.verdict}**" if row.verdict == MISSED else row.verdict
    return [row.quantity, row.published, row.ours, row.difference, verdict, why]


def _summary(rows: Sequence[Row], kind: str) -> list[str]:
    if not rows:
        return ["Nothing was compared."]
    table = counts(rows).droplevel(1)
    lines = [_line(["section", *table.columns]), _line(["---"] * (1 + len(table.columns)))]
    lines += [_line(list(map(str, row))) for row in table.reset_index().itertuples(index=False)]
    missed = sum(row.verdict == MISSED for row in rows)
    return [*lines, "", f"Of {len(rows)} {kind} results, {missed} are missed."]


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"
