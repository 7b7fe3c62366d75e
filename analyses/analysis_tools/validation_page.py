"""Write verification, validation and prediction in Markdown, with a reason per row."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from analysis_tools.validation_rows import FITTED, MISSED, PREDICTED, Row, counts
from wm_drake.report.provenance import now, program

WIDTH = 100
"""Largest length of a line of prose. [characters]"""

COLUMNS = ("quantity", "published", "ours", "difference", "verdict", "reason")

UNEXPLAINED = "not explained yet"
"""Reason of a row that is missed and has no explanation."""

HEADS = {
    FITTED: (
        "Validation",
        "Do the equations describe the machines of [A], [B] and [C]? These published numbers were "
        "targets of the calibration.",
    ),
    PREDICTED: (
        "Prediction",
        "Does the model predict what it was not fitted to? These published numbers were no targets "
        "of the calibration.",
    ),
}
"""Heading and first sentences of a part, by the kind of its rows."""

VERIFICATION = (
    "Does the program solve its equations? Each row is compared by tests or by a command. The "
    "tests are part of the test suite: some have the marker `slow`, those with the marker `hours` "
    "are run by hand. `pytest -m ''` followed by the name of a test runs it alone, whatever its "
    "marker."
)

HOLDS, FAILS, NOT_COMPARABLE = "holds", "**does not hold**", "not comparable"
"""Verdicts on a statement of a paper."""

BEGIN, END = "<!-- validation: begin -->\n", "<!-- validation: end -->"


def renewed(page: str, text: str) -> str:
    """Return a page with a new text between its marks."""
    before, rest = page.split(BEGIN)
    return f"{before}{BEGIN}{text}{END}{rest.split(END)[1]}"


def write(text: str, out: Path | None, page: Path | None) -> None:
    """Write a text to a file, and between the marks of a page; None leaves either out."""
    if out:
        out.write_text(text, encoding="utf-8")
    if page:
        page.write_text(renewed(page.read_text(encoding="utf-8"), text), encoding="utf-8")


def verdict(is_so: object) -> str:
    """Return whether a statement holds, in words."""
    return HOLDS if is_so else FAILS


def listed(values: ArrayLike, unit: str, factor: float = 1.0) -> str:
    """Return numbers as text, with three digits."""
    return ", ".join(f"{factor * value:.3g}" for value in np.ravel(values)) + unit


def origin(command: str, notes: Sequence[str]) -> str:
    """Return the part that says how the text was made.

    Args:
        command: Command that writes the text.
        notes: Sentences on what was run.
    """
    about = f"Written {now()} by {program()}. A script writes this and the parts below:"
    lines = [fill(about, WIDTH), "", "```text", command, "```", ""]
    lines += [fill(f"- {note}", WIDTH, subsequent_indent="  ") for note in notes]
    return "\n".join(lines) + "\n"


def compared(
    rows: Sequence[Row],
    kind: str,
    reasons: Mapping[str, str],
) -> str:
    """Return the part of the rows of one kind as Markdown.

    Args:
        rows: All rows; those of one section follow each other.
        kind: `FITTED` or `PREDICTED`.
        reasons: Explanations by section, by `SECTION | QUANTITY`, and command and tolerance of a
            section by `SECTION | command` and `SECTION | tolerance`.
    """
    chosen = [row for row in rows if row.kind == kind]
    heading, about = HEADS[kind]
    text = ["", f"## {heading}", "", fill(about, WIDTH), "", *_summary(chosen, kind)]
    for section, group in groupby(chosen, key=lambda row: row.section):
        text += ["", f"### {section}", "", *_head_of_section(section, reasons)]
        text += _line(COLUMNS), _line(["---"] * len(COLUMNS))
        text += [_line(_cells(row, reasons)) for row in group]
    return "\n".join(text) + "\n"


def table_text(heading: str, columns: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a heading and a table as Markdown."""
    rows = [columns, ["---"] * len(columns), *lines]
    return "\n".join(["", f"## {heading}", "", *map(_line, rows)]) + "\n"


def verified(
    groups: Mapping[str, Sequence[Mapping[str, Any]]], outcomes: Mapping[str, tuple[int, int]]
) -> str:
    """Return the part of the verification as Markdown.

    Args:
        groups: Rows by heading, each with what, against, agreement, and tests or a command.
        outcomes: How many tests ran and how many of them failed, by test or file of tests; empty
            if they were not run.
    """
    text = ["", "## Verification", "", fill(VERIFICATION, WIDTH)]
    columns = ["what", "against", "agreement", "run by", *(["last run"] if outcomes else [])]
    for heading, rows in groups.items():
        text += ["", f"### {heading}", "", _line(columns), _line(["---"] * len(columns))]
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
