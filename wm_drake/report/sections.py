"""Build a page from sections of pictures and tables, without a template of its own."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wm_drake.parameters import MachineParameters
from wm_drake.report.page import Picture, render
from wm_drake.report.table import Table, parameter_table


@dataclass(frozen=True)
class Section:
    """Section of a page: heading, sentences, remarks, facts, pictures, tables, other parts.

    Attributes:
        anchor: Name of the section in an address.
        text: Sentences.
        facts: Pairs of word and text.
        links: Names of files beside the page, and the words that link to them.
        remarks: Sentences of a list.
        body: Other parts as HTML, from `report.page.fragment`.
        has_long_words: Whether the words of the tables are broken into lines.
        is_folded: Whether a reader must open the section to see more than its heading.
    """

    anchor: str
    heading: str
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    text: str = ""
    facts: Sequence[tuple[str, str]] = ()
    links: Sequence[tuple[str, str]] = ()
    remarks: Sequence[str] = ()
    body: str = ""
    has_long_words: bool = False
    is_folded: bool = False

    @property
    def has_content(self) -> bool:
        """Whether the section shows anything; a page leaves an empty one out."""
        return any(
            (self.pictures, self.tables, self.text, self.facts, self.links, self.remarks, self.body)
        )


@dataclass(frozen=True)
class SectionedPage:
    """A page: title, answer in words, sections, how it was made, and numbers of the machine.

    Attributes:
        summary: Answer in a few sentences.
        sections: Sections; pictures should come before tables. None stands for one left out.
        facts: How the result was computed, as pairs of word and text.
        machine: Machine of the result; its numbers end the page. None for a page of a component.
        warnings: Sentences in a box at the top.
        about: What the page is about, below the title; by default the words of the machine.
        method: Sentences on the method, below the facts.
        tables: Tables of what was run, below them.
        advice: Section without anchor between the summary and the contents.
        numbers_title: Heading of the numbers of the machine.
        script: Script of the page, beside that of the pictures.
    """

    title: str
    summary: str
    sections: Sequence[Section | None]
    facts: Sequence[tuple[str, str]]
    machine: MachineParameters | None = None
    warnings: Sequence[str] = ()
    about: str = ""
    method: str = ""
    tables: Sequence[Table] = ()
    advice: Section | None = None
    numbers_title: str = "Parameters"
    script: Path | None = None

    def html(self) -> str:
        """Return the page as text of one self-contained file."""
        return render(
            "sections.html",
            page=self,
            title=self.title,
            about=self.about or (self.machine.about if self.machine else ""),
            summary=self.summary,
            warnings=list(self.warnings),
            parts=[section for section in self.sections if section and section.has_content],
            numbers=parameter_table(self.machine) if self.machine else None,
        )
