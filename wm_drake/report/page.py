"""Parts that all report pages share: layout and style, pictures, contents, software versions."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from wm_drake.report.figure import Figure
from wm_drake.report.formatting import plain
from wm_drake.report.interactive import plotly_of
from wm_drake.report.provenance import now, program
from wm_drake.report.publication import collect
from wm_drake.report.scripts import FOLDER, Scripts, packed_plotly


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
