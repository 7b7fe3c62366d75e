"""Build a page from sections of pictures and tables, without a template of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

from wm_drake.parameters import MachineParameters
from wm_drake.report.page import Picture, render
from wm_drake.report.table import Table, parameter_table


@dataclass(frozen=True)
class Section:
    """Section of a page: a heading, sentences, facts, pictures and tables in this order.

    Attributes:
        anchor: Name of the section in an address.
        heading: Heading.
        pictures: Pictures.
        tables: Tables.
        text: Sentences.
        facts: Pairs of word and text.
        links: Names of files beside the page, and the words that link to them.
    """

    anchor: str
    heading: str
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    text: str = ""
    facts: Sequence[tuple[str, str]] = ()
    links: Sequence[tuple[str, str]] = ()

    @property
    def has_content(self) -> bool:
        """Whether the section shows anything; a page leaves an empty one out."""
        return any((self.pictures, self.tables, self.text, self.facts, self.links))


@dataclass(frozen=True)
class SectionedPage:
    """A page: title, answer in words, sections, how it was made, and numbers of the machine.

    Attributes:
        title: Title.
        summary: Answer in a few sentences.
        sections: Sections; pictures should come before tables.
        facts: How the result was computed, as pairs of word and text.
        machine: Machine of the result; its numbers end the page. None for a page of a component.
        warnings: Sentences in a box at the top.
        about: What the page is about, below the title; by default the words of the machine.
        method: Sentences on the method, below the facts.
        tables: Tables of what was run, below them.
    """

    title: str
    summary: str
    sections: Sequence[Section]
    facts: Sequence[tuple[str, str]]
    machine: MachineParameters | None = None
    warnings: Sequence[str] = ()
    about: str = ""
    method: str = ""
    tables: Sequence[Table] = ()

    def html(self) -> str:
        """Return the page as text of one self-contained file."""
        return render(
            "sections.html",
            title=self.title,
            about=self.about or (self.machine.about if self.machine else ""),
            summary=self.summary,
            warnings=list(self.warnings),
            parts=[section for section in self.sections if section.has_content],
            facts=[(word, text) for word, text in self.facts if text],
            method=self.method,
            tables=self.tables,
            numbers=parameter_table(self.machine) if self.machine else None,
        )
