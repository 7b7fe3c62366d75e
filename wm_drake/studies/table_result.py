"""A result that is a few tables and figures: JSON, terminal and page follow from them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from wm_drake.parameters import MachineParameters
from wm_drake.report.figure import Figure
from wm_drake.report.table import Table, table_of
from wm_drake.studies.study import Facts, Result

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

MOST_LINES = 200
"""Largest number of lines of a table on the page; the CSV file has all."""


@dataclass(frozen=True)
class ShownTable:
    """Table of a result.

    Attributes:
        heading: Heading on the page and the terminal.
        caption: What its columns are.
        frame: Values; the names of the columns end with their units, such as `gap_mm`.
    """

    heading: str
    caption: str
    frame: pd.DataFrame

    @property
    def name(self) -> str:
        """Name of the CSV file, without suffix."""
        return "_".join(self.heading.lower().split())

    def table(self) -> Table:
        """Return the declaration of the table."""
        return table_of(self.frame, self.caption)


@dataclass(frozen=True)
class TableResult(Result):
    """Result that is a few tables and figures.

    Attributes:
        title: Title of the page.
        summary: Answer in a few sentences.
        figures: Figures with the text for readers who cannot see them, and a caption.
        diverged: A line for each run that diverged.
    """

    title: str
    machine: MachineParameters
    summary: str
    shown: tuple[ShownTable, ...]
    figures: tuple[tuple[Figure, str, str], ...] = ()
    diverged: tuple[str, ...] = ()

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables by name."""
        return {table.name: table.frame for table in self.shown}

    def as_json(self) -> dict[str, Any]:
        """Return machine, summary, and each table as a list of rows."""
        tables = {table.name: table.table().records() for table in self.shown}
        return {"machine": self.machine.name, "summary": self.summary, **tables}

    def terminal(self) -> "list[TerminalTable | str]":
        """Return the tables and the summary."""
        return [*(shown.table().terminal(shown.heading) for shown in self.shown), self.summary]

    def page(self, facts: Facts) -> str:
        """Return the page: figures, tables, facts and the numbers of the machine."""
        from wm_drake.report.page import Section, SectionedPage, picture

        pictures = tuple(picture(*figure) for figure in self.figures)
        sections = [Section("figures", "Figures", pictures)] if pictures else []
        for table in self.shown:
            shown = (table_of(table.frame[:MOST_LINES], table.caption),)
            sections.append(Section(table.name, table.heading, tables=shown))
        made = [("Machine", self.machine.name), ("Time", f"{facts.wall_s:.0f} s"), *facts.rows()]
        return SectionedPage(
            self.title, self.summary, sections, made, self.machine, facts.warnings
        ).html()

    def failures(self) -> tuple[str, ...]:
        """Return a line for each run that diverged."""
        return self.diverged
