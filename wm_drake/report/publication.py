"""Pictures of a page as files for publication: PDF, SVG and PNG at journal width, and their data.

`collected` gathers the figures of all pages that are made in its block; `write_figures` writes
them. Without such a block nothing is gathered.
"""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.figure import Figure

from wm_drake.report.describing import NotDescribableError, describe

JOURNAL_WIDTH = 180.0 / 25.4
"""Width of a picture over two columns of a journal. [in]"""

PNG_DPI = 300
"""Resolution of a PNG at journal width. [1/in]"""

LONGEST_NAME = 60
"""Largest number of characters of the name of a file, without number and suffix."""

_figures: ContextVar[list[tuple[Figure, str]] | None] = ContextVar("figures", default=None)


@contextmanager
def collected() -> Iterator[list[tuple[Figure, str]]]:
    """Yield a list to which each picture of a page adds its figure and its alternative text."""
    found: list[tuple[Figure, str]] = []
    token = _figures.set(found)
    try:
        yield found
    finally:
        _figures.reset(token)


def collect(figure: Figure, title: str) -> None:
    """Add a figure to the list of the enclosing `collected`, if there is one."""
    found = _figures.get()
    if found is not None:
        found.append((figure, title))


def write_figures(figures: list[tuple[Figure, str]], folder: Path) -> None:
    """Write figures as PDF, SVG and PNG at journal width, each with a CSV file of its data.

    Args:
        figures: Figures and their alternative texts, which name the files.
        folder: Folder that exists.
    """
    for index, (figure, title) in enumerate(figures, start=1):
        stem = f"{index:02d}_{file_name(title)}"
        with rc_context({"svg.hashsalt": "wm-drake", "svg.fonttype": "path"}):
            (folder / f"{stem}.svg").write_text(_svg(figure), encoding="utf-8")
        (folder / f"{stem}.pdf").write_bytes(_pdf(figure))
        scale = JOURNAL_WIDTH / figure.get_size_inches()[0]
        figure.savefig(folder / f"{stem}.png", dpi=PNG_DPI * scale, metadata={"Software": None})
        data = figure_data(figure)
        if data is not None:
            data.to_csv(folder / f"{stem}.csv", index=False, float_format="%.9g")


def file_name(title: str) -> str:
    """Return a text as name of a file: lower-case letters, digits and underscores."""
    words = re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")
    return words[:LONGEST_NAME].strip("_") or "picture"


def _svg(figure: Figure) -> str:
    """Return a figure as SVG text; its texts keep their size relative to the picture."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    # matplotlib repeats each text as a comment, names from files among them
    text = re.sub(r"<!--.*?-->\n?", "", buffer.getvalue(), flags=re.DOTALL)
    width, height = figure.get_size_inches()
    sizes = iter((72.0 * JOURNAL_WIDTH, 72.0 * JOURNAL_WIDTH * height / width))
    return re.sub(
        r'(?<= )(width|height)="[\d.]+pt"', lambda m: f'{m[1]}="{next(sizes):g}pt"', text, count=2
    )


def _pdf(figure: Figure) -> bytes:
    """Return a figure as PDF, scaled as a whole to the width of a journal."""
    from matplotlib.backends import backend_mixed, backend_pdf  # slow to import: only --figures

    width, height = (float(size) for size in figure.get_size_inches())
    scale = JOURNAL_WIDTH / width
    buffer, dpi = io.BytesIO(), figure.dpi
    metadata = {"CreationDate": None, "Producer": None, "Creator": None}
    pdf: Any = backend_pdf  # without type hints
    file = pdf.PdfFile(buffer, metadata=metadata)
    try:
        file.newPage(scale * width, scale * height)
        file.width, file.height = width, height  # paths are cut here, before they are scaled
        file.output(scale, 0, 0, scale, 0, 0, pdf.Op.concat_matrix)
        figure.dpi = 72  # points of a PDF
        vectors = pdf.RendererPdf(file, dpi, height, width)
        mixed: Any = backend_mixed.MixedModeRenderer
        renderer = mixed(figure, width, height, dpi, vectors)
        figure.draw(renderer)
        renderer.finalize()
        file.finalize()
    finally:
        figure.dpi = dpi
        file.close()
    return buffer.getvalue()


def figure_data(figure: Figure) -> pd.DataFrame | None:
    """Return what a figure shows as a table: panel, curve, x, y and, of coloured cells, the value.

    None if the figure has no description, such as one with three-dimensional axes.
    """
    try:
        panels = describe(figure, most_points=None)["panels"]
    except NotDescribableError:
        return None
    parts = [
        _rows(part, f"{index + 1} {panel['name']}".strip(), number + 1)
        for index, panel in enumerate(panels)
        for number, part in enumerate(
            p for p in panel["parts"] if p["kind"] not in ("text", "rule", "span")
        )
    ]
    return pd.concat(parts, ignore_index=True) if parts else None


def _rows(part: dict[str, Any], panel: str, number: int) -> pd.DataFrame:
    curve = part.get("label") or f"{part['kind']} {number}"
    if part["kind"] == "bars":
        ends = part["begins"] + part["sizes"]
        x, y = (ends, part["places"]) if part["is_across"] else (part["places"], ends)
        values = part["sizes"]
    elif part["kind"] == "cells":
        shape = part["values"].size
        x, y = _middles(part["x"], part["y"], shape)
        values = part["values"]
    else:
        x, y, values = part["x"], part["y"], part.get("values")
    table = pd.DataFrame({"panel": panel, "curve": curve, "x": x, "y": y})
    if values is not None:
        table["value"] = values
    return table


def _middles(x: Any, y: Any, count: int) -> tuple[Any, Any]:
    """Return the middles of the cells of an image, row by row, from middles or edges."""
    if len(x) * len(y) != count:
        x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in (x, y))
    across, up = np.meshgrid(x, y)
    return across.ravel(), up.ravel()
