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

from wm_drake.report.figure import Area, Bars, Cells, Figure, Line, Mark, Points

DPI = 300
"""Resolution of a PNG, and of pixels in a PDF or SVG. [1/in]"""

LONGEST_NAME = 200
"""Largest number of characters of the name of a file, without number and suffix."""

LONGEST_PLAIN = 20_000
"""Largest number of rows of a CSV file that is not compressed."""

_figures: ContextVar[list[tuple[Figure, str]] | None] = ContextVar("figures", default=None)


@contextmanager
def collected() -> Iterator[list[tuple[Figure, str]]]:
    """Yield a list to which each picture of a page adds its figure and its alternative text."""
    gathered: list[tuple[Figure, str]] = []
    token = _figures.set(gathered)
    try:
        yield gathered
    finally:
        _figures.reset(token)


def collect(figure: Figure, title: str) -> None:
    """Add a figure to the list of the enclosing `collected`, if there is one."""
    gathered = _figures.get()
    if gathered is not None:
        gathered.append((figure, title))


def write_figures(
    figures: list[tuple[Figure, str]], folder: Path, *, columns: int = 2, has_text: bool = False
) -> None:
    """Write figures as PDF, SVG and PNG at journal width, each with a CSV file of its data.

    Args:
        figures: Figures and their alternative texts, which name the files.
        columns: Columns of a journal that a figure takes, 1 or 2.
        has_text: Whether the texts of an SVG are text, which another program can edit and sets in
            its own font; else they are drawn.
    """
    from matplotlib import rc_context  # slow to import: only for --figures

    from wm_drake.report.drawing import matplotlib_of

    kind = "none" if has_text else "path"
    for index, (figure, title) in enumerate(figures, start=1):
        stem = f"{index:02d}_{file_name(title)}"
        drawing = matplotlib_of(figure, columns)
        buffer = io.StringIO()
        with rc_context({"svg.hashsalt": "wm-drake", "svg.fonttype": kind}):
            drawing.savefig(buffer, format="svg", dpi=DPI, metadata={"Date": None})
        # matplotlib repeats each text as a comment, names from files among them
        svg = re.sub(r"<!--.*?-->\n?", "", buffer.getvalue(), flags=re.DOTALL)
        (folder / f"{stem}.svg").write_text(svg, encoding="utf-8")
        metadata = {"CreationDate": None, "Producer": None, "Creator": None}
        with rc_context({"pdf.fonttype": 42}):  # TrueType: journals refuse Type 3
            drawing.savefig(folder / f"{stem}.pdf", dpi=DPI, metadata=metadata)
        drawing.savefig(folder / f"{stem}.png", dpi=DPI, metadata={"Software": None})
        _write_data(figure_data(figure), folder / f"{stem}.csv")


def _write_data(table: pd.DataFrame, path: Path) -> None:
    """Write what a figure shows as CSV; a large one, as of a spectrum, compressed."""
    packed: Any = {"method": "gzip", "mtime": 0} if len(table) > LONGEST_PLAIN else None
    path = path.with_name(f"{path.name}.gz") if packed else path
    table.to_csv(path, index=False, float_format="%.9g", compression=packed)


def file_name(title: str) -> str:
    """Return a text as name of a file: lower-case letters, digits and underscores.

    Its first sentence says what is drawn, the others what comes out, so that a name stays the same.
    """
    (words, *_) = re.split(r"[.;]\s", title.lower())
    words = re.sub(r"[^a-z0-9]+", "_", words).strip("_")
    if len(words) > LONGEST_NAME:  # end with a whole word
        words = words[: LONGEST_NAME + 1].rpartition("_")[0] or words[:LONGEST_NAME]
    return words or "picture"


def figure_data(figure: Figure) -> pd.DataFrame:
    """Return what a figure shows as a table: panel, curve, x, y and, where there is one, value."""
    parts = [
        _rows(mark, f"{index + 1} {panel.name or panel.title}".strip(), number + 1)
        for index, panel in enumerate(figure.panels)
        for number, mark in enumerate(m for m in panel.marks if isinstance(m, _WITH_DATA))
    ]
    columns = {"panel": str, "curve": str, "x": float, "y": float}
    empty = pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in columns.items()})
    return pd.concat(parts, ignore_index=True) if parts else empty


_WITH_DATA = (Line, Points, Area, Bars, Cells)


def _rows(mark: Mark, panel: str, number: int) -> pd.DataFrame:
    curve = mark.name or mark.key or f"{type(mark).__name__.lower()} {number}"
    values: Any = None
    if isinstance(mark, Bars):
        values = np.asarray(mark.size, dtype=float)
        ends = np.asarray(mark.base, dtype=float) + values
        x, y = (ends, mark.at) if mark.is_across else (mark.at, ends)
    elif isinstance(mark, Cells):
        across, up = np.meshgrid(np.asarray(mark.x), np.asarray(mark.y))
        x, y, values = across.ravel(), up.ravel(), np.asarray(mark.values).ravel()
    else:
        assert isinstance(mark, (Line, Points, Area))
        x, y, values = np.asarray(mark.x), np.asarray(mark.y), getattr(mark, "values", None)
    table = pd.DataFrame({"panel": panel, "curve": curve, "x": x, "y": y})
    if values is not None:
        table["value"] = values
    return table
