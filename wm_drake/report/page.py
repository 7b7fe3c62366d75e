"""Parts that all report pages share: layout and style, pictures, contents, software versions."""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from wm_drake.report.describing import NotDescribableError, as_plain, describe
from wm_drake.report.figures import inline_png, inline_svg_or_png
from wm_drake.report.provenance import now, program
from wm_drake.report.publication import collect
from wm_drake.report.scripts import Scripts, packed_plotly


@dataclass(frozen=True)
class Picture:
    """Figure on a page.

    Attributes:
        alternative: Text for readers who cannot see the image.
        caption: Text below the image.
        drawing: Description of the figure as JSON, which the page draws; None for a static image.
        source: Static image as data URI; "" if the page draws the figure.
    """

    alternative: str
    caption: str
    drawing: Markup | None
    source: str = ""


def picture(figure: Figure, alternative: str, caption: str, *, has_images: bool = False) -> Picture:
    """Return a figure in the form that a page shows.

    A page draws the figure itself, so that it can be zoomed. A figure that has no description for
    a browser, such as one with three-dimensional axes, becomes a static image.

    Args:
        figure: The figure. With `--figures` it is also written to a file.
        alternative: Text for readers who cannot see the image.
        caption: Text below the image.
        has_images: Whether a static image is a PNG, not an SVG.
    """
    collect(figure, alternative)
    try:
        drawing = as_json(as_plain(describe(figure)))
    except NotDescribableError:
        source = inline_png(figure) if has_images else inline_svg_or_png(figure)
        return Picture(alternative, caption, None, source)
    return Picture(alternative, caption, drawing)


def as_json(value: Any) -> Markup:
    """Return plain data as JSON for a script element of a page: no text in it can end the script.

    Args:
        value: Plain data; NaN and infinity become null.
    """
    text = json.dumps(_finite(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


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
        **values,
        sections=sections,
        scripts=Scripts(),
        plotly=packed_plotly,
        date=now(),
        program=program(),
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
