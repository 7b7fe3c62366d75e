"""Parts that all report pages share: layout and style, pictures, contents, software versions."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from wm_drake.parameters import MachineParameters
from wm_drake.report.figure import Figure
from wm_drake.report.formatting import plain
from wm_drake.report.interactive import plotly_of
from wm_drake.report.provenance import now, program
from wm_drake.report.publication import collect
from wm_drake.report.scripts import FOLDER, Scripts, packed_plotly
from wm_drake.report.table import Table, parameter_table


@dataclass(frozen=True)
class Picture:
    """Figure on a page.

    Attributes:
        alternative: Text for readers who cannot see the image.
        caption: Text below the image.
        drawing: Data and layout as JSON, which the page draws.
    """

    alternative: str
    caption: str
    drawing: Markup


def picture(figure: Figure, alternative: str, caption: str) -> Picture:
    """Return a figure in the form that a page shows.

    Args:
        figure: The figure. With `--figures` it is also written to files.
    """
    collect(figure, alternative)
    return Picture(alternative, caption, as_json(plotly_of(figure)))


def as_json(value: Any) -> Markup:
    """Return plain data as JSON for a script element of a page: no text in it can end the script.

    Args:
        value: Plain data; NaN and infinity become null.
    """
    text = json.dumps(plain(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def render(template: str | Path, **values: Any) -> str:
    """Return a page as text of one self-contained HTML file.

    Args:
        template: Name of a template in this folder, or path of one elsewhere. It extends page.html.
        values: `title`, `about`, `warnings` (list of text), `summary`, and the other values that
            the template uses.
    """
    return _template(template).render(
        **values,
        sections=sections,
        scripts=Scripts(),
        plotly=packed_plotly,
        date=now(),
        program=program(),
    )


def fragment(template: Path, **values: Any) -> Markup:
    """Return a part of a page as HTML; the template gets `values`."""
    return Markup(_template(template).render(**values))


def _template(template: str | Path) -> Template:
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    if isinstance(template, Path):
        return environment.from_string(template.read_text(encoding="utf-8"))
    return environment.get_template(template)


def sections(body: str) -> list[tuple[str, Markup]]:
    """Return anchor and heading of each section of a page, for its table of contents.

    A heading is cut at its first colon.
    """
    headings = re.findall(r'<section id="([^"]+)">\s*<h2>(.*?)</h2>', body, re.DOTALL)
    return [(anchor, Markup(heading.split(":")[0])) for anchor, heading in headings]


def versions_of(attrs: Mapping[str, Any]) -> str:
    """Return the software versions in the attributes of a record, as one text."""
    prefix = "version_"
    return ", ".join(
        f"{name.removeprefix(prefix)} {text}"
        for name, text in attrs.items()
        if name.startswith(prefix)
    )


@dataclass(frozen=True)
class Section:
    """Section of a page: heading, sentences, remarks, facts, pictures, tables, other parts.

    Attributes:
        anchor: Name of the section in an address.
        text: Sentences.
        facts: Pairs of word and text.
        anchors: Names of the sections that say more, by the words of facts.
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
    anchors: Mapping[str, str] = field(default_factory=dict)
    links: Sequence[tuple[str, str]] = ()
    remarks: Sequence[str] = ()
    body: str = ""
    has_long_words: bool = False
    is_folded: bool = False

    @property
    def has_content(self) -> bool:
        """Return whether the section shows anything; a page leaves an empty one out."""
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
        script: Script of the page, beside that of the pictures.
        live: Page that runs the machine, shown in a frame when it is opened; "" for none.
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
    script: Path | None = None
    live: str = ""

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
