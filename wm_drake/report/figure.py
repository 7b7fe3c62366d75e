"""Declaration of a figure: panels in a grid, their axes, and the marks in them.

A figure is declared once, as plain frozen data. `interactive.py` makes the picture of a page of
it, `publication.py` the files for a paper and the table of its data. A position is in pixels of a
page that is `WIDTH` wide. Text is never markup.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray

OURS, MEASURED, MARK, QUIET, GRID = "#0072b2", "#b34700", "#1a1a1a", "#6b7280", "#e2e5ea"
"""Colours: blue and vermilion of Okabe and Ito, which stay distinct for the colour-blind and in
grey print; ink, grey text and grid lines."""

COLOURS = (OURS, "#d55e00", "#009e73", "#cc79a7", "#7a6a00", "#56b4e9")
"""Colours of lines that differ in nothing else: those of Okabe and Ito, the yellow darkened."""

SHADES = {
    "Blues": "#f7fbff #deebf7 #c6dbef #9ecae1 #6baed6 #4292c6 #2171b5 #08519c #08306b",
    "RdBu": "#67001f #b2182b #d6604d #f4a582 #fddbc7 #f7f7f7 #d1e5f0 #92c5de #4393c3 #2166ac "
    "#053061",
    "viridis": "#440154 #482475 #414487 #355f8d #2a788e #21918c #22a884 #44bf70 #7ad151 #bddf26 "
    "#fde725",
}
"""Colour scales from low to high: Blues and RdBu of ColorBrewer, viridis of matplotlib."""

WIDTH = 1060
"""Width of a figure. [px]"""

TEXT, LABEL, TITLE = 12.5, 13.0, 14.0
"""Sizes of the texts at ticks and of subtitles, of the labels of axes, and of titles. [px]"""

Dash: TypeAlias = Literal["", "dashed", "dotted", "long"]
Along: TypeAlias = Literal["x", "y"]
Numbers: TypeAlias = np.ndarray[Any, Any] | Sequence[float]
Ticks: TypeAlias = tuple[tuple[float, str], ...]


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Colour scale of values.

    Attributes:
        low, high: Values at both ends.
        shades: Name in `SHADES`; with a minus sign before it from high to low.
        kind: How colours follow values; root: their square root, which shows small values.
        label: Quantity and unit; "" without a colour bar.
        ticks: Values with names at the colour bar; None for round numbers.
    """

    low: float
    high: float
    shades: str = "viridis"
    kind: Literal["linear", "log", "root"] = "linear"
    label: str = ""
    ticks: Ticks | None = None

    def colors(self) -> list[str]:
        """Return the colours from low to high."""
        colors = SHADES[self.shades.removeprefix("-")].split()
        return colors[::-1] if self.shades.startswith("-") else colors

    def place(self, values: Numbers) -> FloatArray:
        """Return the numbers that colours are linear in; values beyond the ends are cut."""
        cut = np.clip(np.asarray(values, dtype=float), self.low, self.high)
        if self.kind == "log":
            return np.asarray(np.log10(cut))
        return np.asarray(np.sqrt(cut) if self.kind == "root" else cut)

    def ends(self) -> tuple[float, float]:
        """Return the numbers of `place` at both ends."""
        low, high = self.place([self.low, self.high])
        return float(low), float(high)

    def bar_ticks(self) -> Ticks:
        """Return values with names at the colour bar: given ones, powers of ten, round numbers."""
        if self.ticks is not None:
            return self.ticks
        numbers = round_numbers(self.low, self.high, 6)
        if self.kind == "log":
            low, high = self.ends()
            numbers = 10.0 ** np.arange(np.ceil(low - 1e-9), np.floor(high + 1e-9) + 1.0)
        return tuple((value, f"{value:g}") for value in numbers.tolist())


@dataclass(frozen=True, kw_only=True)
class Mark:
    """Part of what a panel shows.

    Attributes:
        color: Colour as #rrggbb.
        opacity: Opacity of all of it.
        key: Entry of the legend that it belongs to, and by which a reader hides it; "" for none.
        name: Name at the pointer and in the table of the data; "" for that of `key`.
        is_second: Whether its ordinates belong to the second vertical axis of the panel.
    """

    color: str = OURS
    opacity: float = 1.0
    key: str = ""
    name: str = ""
    is_second: bool = False


@dataclass(frozen=True)
class Line(Mark):
    """Line through points (n,); NaN is a gap. `symbol` marks the points (see `Points`)."""

    x: Numbers
    y: Numbers
    width: float = field(default=1.5, kw_only=True)
    dash: Dash = field(default="", kw_only=True)
    symbol: str = field(default="", kw_only=True)
    size: float = field(default=7.0, kw_only=True)


@dataclass(frozen=True)
class Points(Mark):
    """Points (n,).

    Attributes:
        x, y: Places.
        symbol: Form, by its name in Plotly.
        size: Diameter. [px]
        is_open: Whether only the outline is drawn.
        values: Values that give the colours by `scale`.
        scale: Colour scale.
    """

    x: Numbers
    y: Numbers
    symbol: str = field(default="circle", kw_only=True)
    size: float = field(default=7.0, kw_only=True)
    is_open: bool = field(default=False, kw_only=True)
    values: Numbers | None = field(default=None, kw_only=True)
    scale: Scale | None = field(default=None, kw_only=True)


@dataclass(frozen=True)
class Area(Mark):
    """Filled polygons with corners (n,), NaN between them. `edge`: colour of the outline."""

    x: Numbers
    y: Numbers
    edge: str = field(default="", kw_only=True)
    width: float = field(default=1.5, kw_only=True)


@dataclass(frozen=True)
class Bars(Mark):
    """Bars.

    Attributes:
        at: Places of the bars (n,) on the axis of the categories.
        size: Lengths (n,).
        base: Where the bars begin (n,).
        thickness: Thickness, in the unit of `at`.
        colors: Colours (n,) in place of one.
        is_across: Whether the bars are horizontal.
    """

    at: Numbers
    size: Numbers
    base: Numbers | float = field(default=0.0, kw_only=True)
    thickness: float = field(default=0.7, kw_only=True)
    colors: tuple[str, ...] = field(default=(), kw_only=True)
    is_across: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Cells(Mark):
    """Coloured cells (rows, columns) with the middles of evenly spaced columns and rows."""

    values: FloatArray
    x: Numbers
    y: Numbers
    scale: Scale = field(kw_only=True)


@dataclass(frozen=True)
class Rule(Mark):
    """Straight line over the whole panel, parallel to the axis `along`."""

    at: float
    along: Along = "x"
    width: float = field(default=1.1, kw_only=True)
    dash: Dash = field(default="", kw_only=True)


@dataclass(frozen=True)
class Span(Mark):
    """Strip over the whole height of the panel, behind all marks."""

    begin: float
    end: float


@dataclass(frozen=True)
class Text(Mark):
    """Text in a panel.

    Attributes:
        x, y: Place, in data or in parts of the panel.
        text: Text, of one or more lines.
        size: Size. [px]
        is_bold: Whether it is bold.
        across: Part of the text that lies at x.
        up: Part of the text that lies at y.
        in_data: Whether x and y are in data, not in parts of the panel.
        shift: How far the text is moved to the right and upwards. [px]
    """

    x: float
    y: float
    text: str
    color: str = field(default=MARK, kw_only=True)
    size: float = field(default=TEXT, kw_only=True)
    is_bold: bool = field(default=False, kw_only=True)
    across: Literal["left", "center", "right"] = field(default="center", kw_only=True)
    up: Literal["top", "middle", "bottom"] = field(default="middle", kw_only=True)
    in_data: tuple[bool, bool] = field(default=(True, True), kw_only=True)
    shift: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Axis of a panel.

    Attributes:
        label: Quantity and unit.
        range: Both ends; None: from the data.
        ticks: Places with names; None for round numbers; () for none.
        is_log: Whether the axis is logarithmic.
        has_numbers: Whether the ticks have texts.
        has_grid: Whether there are lines at the ticks.
        has_line: Whether the axis itself is drawn.
        is_far: Whether the horizontal axis is at the top.
        scale: Axes with the same name have the same range, and are zoomed together.
        size: Size of the texts at the ticks. [px]
        color: Colour of the label.
    """

    label: str = ""
    range: tuple[float | None, float | None] = (None, None)
    ticks: Ticks | None = None
    is_log: bool = False
    has_numbers: bool = True
    has_grid: bool = True
    has_line: bool = True
    is_far: bool = False
    scale: str = ""
    size: float = TEXT
    color: str = MARK


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Panel of a figure.

    Attributes:
        marks: What it shows; later ones lie over earlier ones.
        x, y: Axes.
        second: Second vertical axis, at the right.
        top: Second horizontal axis, at the top, with ticks in the unit of x.
        title: Title above it, bold.
        subtitle: Words below the title, grey, of one or more lines.
        name: Name on the button that shows this panel alone; "" for the title.
        row, column: Place in the grid.
        rows: Number of rows that it takes.
        is_square: Whether both axes have the same scale.
    """

    marks: tuple[Mark, ...]
    x: Axis = Axis()
    y: Axis = Axis()
    second: Axis | None = None
    top: Axis | None = None
    title: str = ""
    subtitle: str = ""
    name: str = ""
    row: int = 0
    column: int = 0
    rows: int = 1
    is_square: bool = False


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Figure.

    Attributes:
        height: Height of the panels of one row. [px]
        widths: Relative widths of the columns; () for equal ones.
        x_label: Label of all horizontal axes.
        key_title: Words before the legend.
        keys: Legend, in this order, if it is another one than that of the marks.
    """

    panels: tuple[Panel, ...]
    height: float = 160.0
    widths: tuple[float, ...] = ()
    x_label: str = ""
    key_title: str = ""
    keys: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return the number of panels and marks in one line."""
        marks = sum(len(panel.marks) for panel in self.panels)
        return f"<{type(self).__name__} of {len(self.panels)} panels with {marks} marks>"


def in_grid(
    panels: Iterable[Panel | None],
    columns: int = 3,
    *,
    share: Literal["", "x", "y", "both", "x and rows"] = "",
) -> tuple[Panel, ...]:
    """Return panels at places in a grid, row by row.

    Axes that are shared have one range. Only the lowest panel of a column has numbers and label of
    a shared horizontal axis, only the first of a row those of a shared vertical one, and only the
    highest of a column has a top axis.

    Args:
        panels: Panels; None leaves a place empty.
        columns: Number of panels in a row.
        share: Which axes are shared; "x and rows": x by all, y by the panels of a row.
    """
    placed = [
        replace(panel, row=index // columns, column=index % columns)
        for index, panel in enumerate(panels)
        if panel is not None
    ]
    lowest = {p.column: p.row for p in sorted(placed, key=lambda p: p.row)}
    highest = {p.column: p.row for p in sorted(placed, key=lambda p: -p.row)}
    first = {p.row: p.column for p in sorted(placed, key=lambda p: -p.column)}
    shares_y = {"y": "y", "both": "y", "x and rows": "row"}.get(share, "")
    shown = []
    for panel in placed:
        x, y, top = panel.x, panel.y, panel.top
        if share in ("x", "both", "x and rows"):
            x = replace(x, scale="x")
            if panel.row != lowest[panel.column]:
                x = replace(x, has_numbers=False, label="")
            top = top if panel.row == highest[panel.column] else None
        if shares_y:
            y = replace(y, scale="y" if shares_y == "y" else f"y{panel.row}")
            if panel.column != first[panel.row]:
                y = replace(y, has_numbers=False, label="")
        shown.append(replace(panel, x=x, y=y, top=top))
    return tuple(shown)


def band(x: Numbers, low: Numbers, high: Numbers, **style: Any) -> Area:
    """Return the area between two lines (n,) over x."""
    x, low, high = (np.asarray(values, dtype=float) for values in (x, low, high))
    style = {"opacity": 0.22, **style}
    return Area(np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]]), **style)


def segments(begins: tuple[Numbers, Numbers], ends: tuple[Numbers, Numbers], **style: Any) -> Line:
    """Return straight lines from places (x, y) to places (x, y), each (n,), as one line."""
    sides = []
    for begin, end in zip(begins, ends, strict=True):
        begin, end = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (begin, end)))
        sides.append(np.column_stack([begin, end, np.full(len(begin), np.nan)]).ravel())
    return Line(sides[0], sides[1], **style)


def boxes(places: Numbers, samples: Sequence[FloatArray], half: float, **style: Any) -> list[Mark]:
    """Return lines from smallest to largest value, boxes between the quartiles, and the medians.

    Args:
        places: Middles of the boxes (n,).
        samples: Values of each box; a box without values is left out.
        half: Half of the width of a box.
    """
    pairs = [
        (at, np.percentile(v, (0, 25, 50, 75, 100)))
        for at, v in zip(places, samples, strict=True)
        if len(v)
    ]
    if not pairs:
        return []
    at = np.array([place for place, _ in pairs])
    low, first, median, third, high = np.array([marks for _, marks in pairs]).T
    left, right, gap = at - half, at + half, np.full(len(at), np.nan)
    x = np.column_stack([left, right, right, left, left, gap]).ravel()
    y = np.column_stack([first, first, third, third, first, gap]).ravel()
    color = style.get("color", MARK)
    edged = {**style, "color": "#ffffff", "opacity": 0.45, "edge": color}
    return [
        segments((at, low), (at, high), width=1.2, **style),
        Area(x, y, **edged),
        segments((left, median), (right, median), width=2.6, **style),
    ]


def named(names: Iterable[str], places: Iterable[float] | None = None) -> Ticks:
    """Return ticks with names, at 0, 1, 2, ... or at places."""
    texts = list(names)
    return tuple(
        zip(map(float, range(len(texts)) if places is None else places), texts, strict=True)
    )


def shade(part: float, shades: str = "viridis") -> str:
    """Return the colour at a part of a colour scale, from 0 to 1."""
    colors = Scale(low=0.0, high=1.0, shades=shades).colors()
    channels = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in colors])
    at = np.linspace(0.0, 1.0, len(colors))
    mixed = [round(float(np.interp(part, at, channel))) for channel in channels.T]
    return "#" + "".join(f"{value:02x}" for value in mixed)


def nice_step(span: float, most: int) -> float:
    """Return the smallest step 1, 2 or 5 times a power of ten with at most `most` in a span."""
    power = 10.0 ** np.floor(np.log10(span / most))
    return float(power * next(f for f in (1, 2, 5, 10) if f * power * most >= span * 0.999))


def round_numbers(low: float, high: float, most: int) -> FloatArray:
    """Return at most about `most` round numbers from low to high."""
    if not high > low:
        return np.array([low])
    step = nice_step(high - low, most)
    count = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0)
    return np.asarray(count * step + 0.0)
