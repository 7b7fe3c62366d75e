"""Parts that all report pages share: layout and style, pictures, contents, software versions."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from wm_drake.report.figures import inline_png, inline_svg_or_png
from wm_drake.report.provenance import now, program


@dataclass(frozen=True)
class Picture:
    """Figure on a page.

    Attributes:
        source: Image as data URI.
        alternative: Text for readers who cannot see the image.
        caption: Text below the image.
    """

    source: str
    alternative: str
    caption: str


def picture(figure: Figure, alternative: str, caption: str, *, has_images: bool = False) -> Picture:
    """Return a figure in the form that a page shows; one that has images becomes a PNG."""
    source = inline_png(figure) if has_images else inline_svg_or_png(figure)
    return Picture(source, alternative, caption)


def render(template: str, **values: Any) -> str:
    """Return a page as text of one self-contained HTML file.

    Args:
        template: Name of a template in this folder that extends page.html.
        values: `title`, `about`, `warnings` (list of text), `summary`, and the other values that
            the template uses.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(
        **values, sections=sections, date=now(), program=program()
    )


def sections(body: str) -> list[tuple[str, Markup]]:
    """Return anchor and heading of each section of a page, for its table of contents.

    A heading is cut at its first colon.

    Args:
        body: HTML text of the page, with headings that are already escaped.
    """
    found = re.findall(r'<section id="([^"]+)">\s*<h2>(.*?)</h2>', body, re.DOTALL)
    return [(anchor, Markup(heading.split(":")[0])) for anchor, heading in found]


def versions_of(attrs: Mapping[str, Any]) -> str:
    """Return the software versions in the attributes of a record, as one text."""
    prefix = "version_"
    return ", ".join(
        f"{name.removeprefix(prefix)} {text}"
        for name, text in attrs.items()
        if name.startswith(prefix)
    )
