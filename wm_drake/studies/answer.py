"""The result of a study: an answer in words, and parts of sentences, pictures and tables.

Files, JSON, terminal, page and notebook follow from it. A study computes labelled datasets whose
variables carry their quantities (`wm_drake.report.quantity`) and returns an `Answer` that shows
them; it declares no class of its own.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import pandas as pd

from wm_drake.errors import check_known
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.reading import READING, read_in
from wm_drake.report.figure import Figure
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.provenance import command_line
from wm_drake.studies.facts import PAGE, Facts

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

    from wm_drake.report.page import SectionedPage


WritesFile: TypeAlias = Callable[[Path], None]
"""Function that writes a file."""


@dataclass(frozen=True)
class Plot:
    """A figure of a page.

    Attributes:
        alternative: Text for readers who cannot see it.
        caption: Text below it.
    """

    figure: Figure
    alternative: str
    caption: str


@dataclass(frozen=True)
class Part:
    """A section of a page; one that shows nothing is left out.

    Attributes:
        heading: Heading. Before its first colon it is the name of the section in an address.
        shown: Pictures and tables.
        text: Sentences above them.
        links: Names of files beside the page, and the words that link to them.
        remarks: Sentences of a list.
        facts: Pairs of word and text.
        more: Headings of the parts of the page that say more, by the words of facts.
        body: Function that returns other parts as HTML, from `report.page.fragment`; called by each
            page, whose figures it makes.
        has_long_words: Whether the words of the tables are broken into lines.
        is_folded: Whether a reader must open the section to see more than its heading.
    """

    heading: str
    shown: Sequence[Plot | LabelledTable] = ()
    text: str = ""
    links: Sequence[tuple[str, str]] = ()
    remarks: Sequence[str] = ()
    facts: Sequence[tuple[str, str]] = ()
    more: Mapping[str, str] = field(default_factory=dict)
    body: Callable[[], str] | None = None
    has_long_words: bool = False
    is_folded: bool = False

    @property
    def tables(self) -> Iterator[LabelledTable]:
        """Yield the tables of the part, also those of files only."""
        return (shown for shown in self.shown if isinstance(shown, LabelledTable))


@dataclass(frozen=True)
class Answer:
    """Result of a study.

    Attributes:
        title: Title of the page.
        answer: Answer to the question of the study in a few sentences.
        machine: Machine of the result; its numbers end the page. None for that of a component.
        parts: Sections of the page, with all tables of the result.
        details: How the result was computed, as pairs of word and text.
        method: Sentences on the method, below the details.
        files: Other files by their names: text, bytes, or a function that writes the file.
        warned: Sentences on what a reader must know before the answer, in a box at the top and on
            the terminal.
        short: Part in a box between the answer and the contents. Its facts are also printed.
        diverged: A line for each run that diverged, or another reason for exit code 1.
        others: Answers with pages of their own beside this one, by the names of their files.
        script: Script of the page, beside that of the pictures.
        live: Page that runs the machine (`wm_drake.live`), in a frame of this one; "" for none.
        units: In which its numbers are read, of `parameters.reading`; those in which it was made.
    """

    title: str
    answer: str
    machine: MachineParameters | None
    parts: tuple[Part, ...]
    details: tuple[tuple[str, str], ...] = ()
    method: str = ""
    files: "Mapping[str, str | bytes | WritesFile]" = field(default_factory=dict)
    warned: tuple[str, ...] = ()
    short: Part | None = None
    diverged: tuple[str, ...] = ()
    others: "Mapping[str, Answer]" = field(default_factory=dict)
    script: Path | None = None
    live: str = ""
    units: str = field(default_factory=READING.get)

    def __repr__(self) -> str:
        """Return title, answer and names of the tables in three lines."""
        names = ", ".join(self.labelled())
        return f"<{type(self).__name__} '{self.title}'\n{self.answer}\ntables: {names}>"

    def labelled(self) -> dict[str, LabelledTable]:
        """Return the tables by name."""
        parts = (*self.parts, self.short) if self.short else self.parts
        return {table.name: table for part in parts for table in part.tables}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables as frames, in units for reading, by name."""
        with read_in(self.units):
            return {name: table.frame() for name, table in self.labelled().items()}

    def as_json(self) -> dict[str, Any]:
        """Return title, machine, answer, and each table as a list of rows."""
        about = {} if self.machine is None else {"machine": self.machine.name}
        with read_in(self.units):
            tables = {n: t.records() for n, t in self.labelled().items() if t.is_in_json}
        return {"title": self.title, **about, "answer": self.answer, **tables}

    def terminal(self) -> "list[TerminalTable | str]":
        """Return some tables, the answer, and the facts of the part in short."""
        chosen = [table for table in self.labelled().values() if table.is_in_terminal]
        facts = self.short.facts if self.short else ()
        with read_in(self.units):
            shown = [table.terminal() for table in chosen]
        return [
            *shown,
            self.answer,
            *(f"{word}: {text}" for word, text in facts),
        ]

    def page(self, facts: Facts) -> str:
        """Return the page: answer, parts, how it was made, and the numbers of the machine."""
        with read_in(self.units):
            return self._sectioned(facts).html()

    def _sectioned(self, facts: Facts) -> "SectionedPage":
        from wm_drake.report.page import SectionedPage

        about = [] if self.machine is None else [("Machine", self.machine.name)]
        seconds = f"{facts.wall_s:.0f} s"
        time = [("Runs", f"{facts.runs} in {seconds}") if facts.runs else ("Time", seconds)]
        return SectionedPage(
            self.title,
            self.answer,
            [_section(part) for part in self.parts],
            [*about, *(time if facts.wall_s else []), *self.details, *facts.rows()],
            self.machine,
            [*facts.warnings, *self.warned],
            method=self.method,
            advice=_section(self.short) if self.short else None,
            script=self.script,
            live=self.live,
        )

    def pages(self, facts: Facts) -> Mapping[str, str]:
        """Return the page, and those of other answers, by the names of their files."""
        others = {name: answer.page(facts) for name, answer in self.others.items()}
        return {PAGE: self.page(facts), **others}

    def to_dataframe(self, name: str = "") -> pd.DataFrame:
        """Return a table of the result.

        Args:
            name: Name of the table, as in `tables()`; the first one if empty.

        Example:
            >>> import wm_drake as wm
            >>> result = wm.run_study("drive", load=["middle"], quick=True, quiet=True)
            >>> result.to_dataframe("map").equals(result.tables()["map"])
            True
        """
        tables = self.tables()
        return tables[_chosen(name, list(tables), "table")]

    def pictures(self) -> dict[str, Figure]:
        """Return the figures of the page by the texts that describe them."""
        from wm_drake.report.publication import collected

        with collected() as drawn:
            self.pages(Facts())
        return {title: figure for figure, title in drawn}

    def plot(self, title: str = "") -> Any:
        """Return a figure of the page, drawn with matplotlib; a notebook shows it.

        Args:
            title: First words of its text, as in `pictures()`; the first figure if empty.

        Raises:
            InputError: there is no such figure.
        """
        from wm_drake.report.drawing import matplotlib_of

        figures = self.pictures()
        full = next((text for text in figures if title and text.startswith(title)), title)
        return matplotlib_of(figures[_chosen(full, list(figures), "figure")])

    def _repr_html_(self) -> str:
        """Return the tables for a notebook, long ones shortened in the middle."""
        return "".join(
            f"<h4>{escape(name)}</h4>{table.to_html(max_rows=MOST_ROWS, index=False)}"
            for name, table in self.tables().items()
        )

    def write(self, folder: Path) -> None:
        """Write the tables as CSV, and the other files."""
        for name, table in self.tables().items():
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.9g")
        for name, content in self.files.items():
            if isinstance(content, str):
                (folder / name).write_text(content, encoding="utf-8")
            elif isinstance(content, bytes):
                (folder / name).write_bytes(content)
            else:
                content(folder / name)

    def save(self, folder: Path | str, facts: Facts | None = None) -> None:
        """Write the pages and all files to a folder, which is made if it is not there.

        Args:
            facts: How the result was computed; None if no more is known than the command.
        """
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        self.write(place)
        for name, text in self.pages(facts or Facts(command_line())).items():
            (place / name).write_text(text, encoding="utf-8")


MOST_ROWS = 12
"""Largest number of rows of a table in a notebook; `to_dataframe` has all."""


def _chosen(name: str, known: Sequence[str], kind: str) -> str:
    """Return the name of a table or figure of a result; the first one if the name is empty."""
    if name or not known:
        check_known(name, known, f"no {kind} '{name}'", key=kind)
    return name or known[0]


def pictures_first(parts: Sequence[Part]) -> tuple[Part, ...]:
    """Return parts in which all pictures stand before all tables; one with both becomes two."""
    pictures, others = list[Part](), list[Part]()
    for part in parts:
        plots = tuple(one for one in part.shown if isinstance(one, Plot))
        tables = tuple(part.tables)
        if plots:
            pictures.append(replace(part, shown=plots))
            if tables:
                stem = part.heading.partition(":")[0]
                others.append(Part(f"{stem} in numbers", tables))
        else:
            others.append(part)
    return (*pictures, *others)


def _anchor(heading: str) -> str:
    """Return the name of a part in an address."""
    return heading.partition(":")[0].lower().replace(" ", "-")


def _section(part: Part) -> Any:
    """Return a part as section of a page."""
    from wm_drake.report.page import Section, picture

    return Section(
        _anchor(part.heading),
        part.heading,
        [picture(p.figure, p.alternative, p.caption) for p in part.shown if isinstance(p, Plot)],
        [table.table() for table in part.tables if table.heading],
        part.text,
        links=part.links,
        remarks=part.remarks,
        facts=part.facts,
        anchors={word: _anchor(heading) for word, heading in part.more.items()},
        body=part.body() if part.body else "",
        has_long_words=part.has_long_words,
        is_folded=part.is_folded,
    )
