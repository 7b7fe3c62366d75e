"""What all report pages share: layout and style, pictures, and what stands under "What was run"."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from wm_drake.report.figures import inline_svg_or_png


@dataclass(frozen=True)
class Picture:
    """A figure on the page: data URI, what is said to those who do not see it, caption."""

    source: str
    alternative: str
    caption: str


def picture(figure: Figure, alternative: str, caption: str) -> Picture:
    """A figure as it goes on a page."""
    return Picture(inline_svg_or_png(figure), alternative, caption)


def render(template: str, **values: Any) -> str:
    """A page as text of one HTML file that needs nothing else.

    Args:
        template: Name of a template of this folder that extends page.html.
        values: `title`, `about`, `warnings` (list of text), `summary`, and what the template needs.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(**values, sections=sections)


def sections(body: str) -> list[tuple[str, Markup]]:
    """Anchor and heading of each section of a page's text, for its contents; a heading up to its colon."""
    found = re.findall(r'<section id="([^"]+)">\s*<h2>(.*?)</h2>', body, re.DOTALL)
    return [
        (anchor, Markup(heading.split(":")[0])) for anchor, heading in found
    ]  # out of a page: escaped


def versions_of(attrs: Mapping[str, Any]) -> str:
    """Versions of the software, from the attributes of a record."""
    prefix = "version_"
    return ", ".join(
        f"{name.removeprefix(prefix)} {text}"
        for name, text in attrs.items()
        if name.startswith(prefix)
    )
