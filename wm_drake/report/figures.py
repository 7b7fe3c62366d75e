"""Style that all figures share, and the inline form of a figure for a page.

Figures are made without pyplot, so that they need no display and no global state.
"""

import base64
import io
import re
from collections.abc import Iterable
from typing import Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator

OURS, MEASURED, MARK, QUIET, GRID = "#0072b2", "#b34700", "#1a1a1a", "#6b7280", "#e2e5ea"
"""Colours: blue and vermilion of Okabe and Ito, which stay distinct for the colour-blind and in
grey print; ink, grey text and grid lines."""

WIDTH = 10.6
"""Width of a figure. At the full width of the page, one point of type is about one point. [in]"""

LARGEST_SVG = 200_000
"""Size of the largest SVG that is put on a page; a larger figure becomes a PNG. [bytes]"""

PNG_DPI = 130


def inline_svg_or_png(figure: Figure) -> str:
    """Return a figure as data URI for the src of an image.

    The format is SVG, which is sharp at any size, or PNG if the SVG is large. The same figure
    always gives the same text: it holds no date and no random names.
    """
    svg = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "wm-drake", "svg.fonttype": "path"}):
        figure.savefig(svg, format="svg", metadata={"Date": None})
    if len(svg.getvalue()) <= LARGEST_SVG:
        # matplotlib repeats each text as a comment, names from files among them
        drawn = re.sub(rb"<!--.*?-->\n?", b"", svg.getvalue(), flags=re.DOTALL)
        return f"data:image/svg+xml;base64,{base64.b64encode(drawn).decode()}"
    return inline_png(figure)


def inline_png(figure: Figure) -> str:
    """Return a figure as PNG in a data URI, for a figure that consists of images."""
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=PNG_DPI, metadata={"Software": None})
    return f"data:image/png;base64,{base64.b64encode(png.getvalue()).decode()}"


def style_axes(axes: Axes) -> None:
    """Apply the common style: small tick labels, no frame at the top and the right."""
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def name_ticks(
    axes: Axes, which: Literal["x", "y"], places: Iterable[float], names: list[str]
) -> None:
    """Give an axis ticks with names, in a third of the time of `set_xticks` and `set_yticks`.

    Those make every tick at once, which is the largest part of the time of a figure that is never
    drawn here. The limits of the axis stay as they are.

    Args:
        axes: The panel.
        which: The axis.
        places: Places of the ticks.
        names: Their names; a dollar sign in them is a dollar sign.
    """
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(FixedLocator(list(places)))
    axis.set_major_formatter(FixedFormatter([name.replace("$", r"\$") for name in names]))
