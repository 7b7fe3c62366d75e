"""Drawing of a figure with matplotlib, for files of `--figures`; nothing else imports matplotlib.

Figures are made without pyplot, so that they need no display and no global state. The places of
panels and texts are those of the picture on a page.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize, to_rgba
from matplotlib.figure import Figure as Drawing
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator, NullLocator

from wm_drake.report import figure as fig
from wm_drake.report.arrangement import (
    LINE,
    Place,
    arrange,
    in_one_column,
    key_texts,
    text_width,
    x_count,
    y_count,
)

COLUMN_WIDTHS = {1: 85.0 / 25.4, 2: 175.0 / 25.4}
"""Width of a drawing by the columns of a journal that it takes. [in]"""

INCH = fig.WIDTH / COLUMN_WIDTHS[2]
"""Pixels of the picture on a page in an inch of the drawing."""

POINT = 72.0 / INCH
"""Points of a pixel."""

THIN = POINT * 1.1
"""Width of axes, ticks and grid. [pt]"""

TICK: dict[str, Any] = {"width": THIN, "pad": POINT * 4.9}
"""Look of ticks. [pt]"""

SIZES: dict[Any, Any] = {
    "font.size": POINT * fig.TEXT,
    "axes.linewidth": THIN,
    "axes.labelpad": POINT * 5.6,
    "lines.linewidth": POINT * 2.1,
    "lines.markeredgewidth": POINT * 1.4,
    "patch.linewidth": POINT * 1.4,
    "text.parse_math": False,
}
"""Sizes that matplotlib would otherwise have for a drawing of any width. [pt]"""

DASHES: dict[str, Any] = {
    "": "solid",
    "dashed": (0, (5, 2.5)),
    "dotted": (0, (1.5, 1.8)),
    "long": (0, (7, 2)),
}
"""Patterns of lines."""

MARKERS = {
    "circle": "o",
    "square": "s",
    "diamond": "D",
    "triangle-up": "^",
    "triangle-down": "v",
    "cross-thin": "+",
    "x-thin": "x",
    "line-ns": "|",
    "line-ew": "_",
}
"""Symbols of points by their names in Plotly."""


def matplotlib_of(figure: fig.Figure, columns: int = 2) -> Drawing:
    """Return a figure as a drawing at journal width, with its legend below the panels.

    Args:
        columns: Columns of a journal that it takes; in one, panels are below each other.
    """
    figure = in_one_column(figure) if columns == 1 else figure
    arrangement = arrange(figure, COLUMN_WIDTHS[columns] * INCH)
    rows = _key_rows(figure, arrangement.width)
    height = arrangement.height + 22.0 * len(rows)
    size = arrangement.width, height
    drawing = Drawing(figsize=(arrangement.width / INCH, height / INCH))
    with rc_context(SIZES):
        for place in arrangement.places:
            _draw_panel(drawing, place, size)
        common: dict[str, Any] = {
            "fontsize": POINT * fig.LABEL,
            "color": fig.MARK,
            "parse_math": False,
        }
        if figure.x_label:
            y = (height - arrangement.height) / height
            drawing.text(0.5, y, figure.x_label, ha="center", va="bottom", **common)
        for index, keys in enumerate(rows):
            _draw_keys(drawing, figure, keys, 22.0 * (len(rows) - index - 1) / height)
    return drawing


def _key_rows(figure: fig.Figure, width: float) -> list[list[str]]:
    """Return the entries of the legend in rows that are not too long."""
    rows: list[list[str]] = []
    used = 0.0
    for key in key_texts(figure):
        used += text_width(key, fig.TEXT) + 60.0
        if not rows or used > width:
            rows.append([])
            used = text_width(key, fig.TEXT) + 60.0
        rows[-1].append(key)
    return rows


def _draw_keys(drawing: Drawing, figure: fig.Figure, keys: list[str], bottom: float) -> None:
    marks = [mark for panel in figure.panels for mark in panel.marks]
    handles = [_sample([mark for mark in marks if mark.key == key]) for key in keys]
    legend = drawing.legend(
        handles,
        keys,
        loc="lower center",
        bbox_to_anchor=(0.5, bottom),
        ncols=len(keys),
        frameon=False,
        fontsize=POINT * fig.TEXT,
        borderaxespad=0.1,
        borderpad=0.1,
        handler_map={tuple: HandlerTuple(ndivide=1)},
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def _sample(marks: list[fig.Mark]) -> Any:
    """Return the samples of the kinds of marks of one entry of the legend, over each other."""
    samples: dict[type[fig.Mark], Any] = {}
    for mark in marks:
        if type(mark) in samples:
            continue
        if isinstance(mark, (fig.Area, fig.Bars, fig.Span)):
            color = mark.colors[0] if isinstance(mark, fig.Bars) and mark.colors else mark.color
            edge = getattr(mark, "edge", "")
            face = to_rgba(color, mark.opacity)
            samples[type(mark)] = Patch(facecolor=face, edgecolor=edge or (0, 0, 0, 0))
        elif isinstance(mark, (fig.Line, fig.Rule)):
            samples[type(mark)] = Line2D([], [], **_line_style(mark))
        elif isinstance(mark, fig.Points):
            samples[type(mark)] = Line2D([], [], **_point_style(mark))
    return tuple(samples.values())


def _draw_panel(drawing: Drawing, place: Place, of_drawing: tuple[float, float]) -> None:
    panel, (width, height) = place.panel, of_drawing
    box = (place.left / width, 1.0 - place.bottom / height)
    size = ((place.right - place.left) / width, (place.bottom - place.top) / height)
    axes = drawing.add_axes((*box, *size))
    axes.set_axisbelow(True)
    for side in ("top", "right", "bottom", "left"):
        axes.spines[side].set_visible(False)
    second = _second_axes(axes, place) if panel.second is not None else None
    for mark in panel.marks:
        _MARKS[type(mark)](second if mark.is_second and second is not None else axes, mark)
    if panel.is_square:
        axes.set_aspect("equal", adjustable="box")
    _style_axis(axes, "x", panel.x, place.texts.x_ticks, x_count(place.right - place.left))
    _style_axis(axes, "y", panel.y, place.texts.y_ticks, y_count(place.bottom - place.top))
    axes.set_xlabel("\n".join(place.texts.x_label))
    axes.set_ylabel("\n".join(place.texts.y_label))
    if panel.x.is_far:
        axes.xaxis.tick_top()
        axes.xaxis.set_label_position("top")
    if place.texts.is_upright:
        axes.tick_params(axis="x", rotation=90)
    if panel.top is not None:
        _draw_top(axes, panel.top)
    _draw_titles(axes, place)
    if place.texts.scale is not None:
        _draw_color_bar(drawing, place, place.texts.scale, of_drawing)


def _second_axes(axes: Axes, place: Place) -> Axes:
    """Return axes over others, whose vertical axis is at the right."""
    assert place.panel.second is not None
    second = axes.twinx()
    for spine in second.spines.values():
        spine.set_visible(False)
    _style_axis(second, "y", place.panel.second, (), y_count(place.bottom - place.top))
    second.yaxis.tick_right()
    second.grid(visible=False)
    second.spines["right"].set_visible(True)
    return second


def _draw_titles(axes: Axes, place: Place) -> None:
    rise = place.texts.above
    for lines, text_size, color, weight in (
        (place.texts.subtitles, fig.TEXT, fig.QUIET, "normal"),
        (place.texts.titles, fig.TITLE, fig.MARK, "bold"),
    ):
        if lines:
            axes.annotate(
                "\n".join(lines),
                (0.0, 1.0),
                (0.0, POINT * rise),
                xycoords="axes fraction",
                textcoords="offset points",
                va="bottom",
                color=color,
                fontsize=POINT * text_size,
                fontweight=weight,
                parse_math=False,
                annotation_clip=False,
            )
            rise += len(lines) * text_size * LINE


def _style_axis(axes: Axes, side: str, axis: fig.Axis, texts: tuple[str, ...], count: int) -> None:
    """Apply range, ticks and label of an axis; `axes` are those of matplotlib."""
    shown = axes.xaxis if side == "x" else axes.yaxis
    if axis.is_log:
        (axes.set_xscale if side == "x" else axes.set_yscale)("log")
    limits = (float(axis.range[0] or 0.0), float(axis.range[1] or 0.0))
    (axes.set_xlim if side == "x" else axes.set_ylim)(*limits)
    if axis.ticks is not None:
        names = list(texts or (text for _, text in axis.ticks))
        shown.set_major_locator(FixedLocator([at for at, _ in axis.ticks]))
        shown.set_major_formatter(FixedFormatter(names))
        shown.set_minor_locator(NullLocator())
    elif not axis.is_log:
        shown.set_major_locator(MaxNLocator(count, steps=[1, 2, 5, 10]))
    shown.set_label_text(axis.label, fontsize=POINT * fig.LABEL, color=axis.color, parse_math=False)
    has_numbers = axis.has_numbers and axis.ticks != ()
    near = {"x": "bottom", "y": "left"}[side]
    has_ticks = has_numbers and axis.has_line
    axes.tick_params(
        axis=side,  # type: ignore[arg-type]
        labelsize=POINT * axis.size,
        labelcolor=fig.QUIET,
        color=fig.QUIET,
        length=POINT * 4.2 if has_ticks else 0.0,
        **TICK,
        **{f"label{near}": has_numbers},
    )
    minor: dict[str, Any] = {"which": "minor", "length": POINT * 2.8, **TICK}
    axes.tick_params(axis=side, **minor)  # type: ignore[arg-type]
    if axis.has_grid:
        axes.grid(axis=side, color=fig.GRID, linewidth=THIN)  # type: ignore[arg-type]
    axes.spines["top" if axis.is_far else near].set_visible(axis.has_line)


def _draw_top(axes: Axes, top: fig.Axis) -> None:
    second = axes.secondary_xaxis("top")
    second.xaxis.set_major_locator(FixedLocator([at for at, _ in top.ticks or ()]))
    second.xaxis.set_major_formatter(FixedFormatter([text for _, text in top.ticks or ()]))
    second.tick_params(labelsize=POINT * fig.TEXT, colors=fig.QUIET, length=POINT * 4.9, **TICK)
    second.set_xlabel(top.label, fontsize=POINT * fig.LABEL, color=fig.QUIET)


def _colormap(scale: fig.Scale) -> Colormap:
    return LinearSegmentedColormap.from_list(scale.shades, scale.colors())


def _norm(scale: fig.Scale) -> Normalize:
    return Normalize(*scale.ends())


def _draw_color_bar(
    drawing: Drawing, place: Place, scale: fig.Scale, of_drawing: tuple[float, float]
) -> None:
    width, height = of_drawing
    box = ((place.right + 8.0) / width, 1.0 - place.bottom / height)
    axes = drawing.add_axes((*box, 12.0 / width, (place.bottom - place.top) / height))
    bar = drawing.colorbar(ScalarMappable(_norm(scale), _colormap(scale)), cax=axes)
    ticks = scale.bar_ticks()
    bar.set_ticks(list(scale.place([at for at, _ in ticks])), labels=[text for _, text in ticks])
    bar.ax.tick_params(labelsize=POINT * fig.TEXT, labelcolor=fig.QUIET, length=POINT * 4.9, **TICK)
    bar.set_label(scale.label, fontsize=POINT * fig.LABEL)
    bar.outline.set_visible(False)


def _line_style(mark: fig.Line | fig.Rule) -> dict[str, Any]:
    style = {
        "color": to_rgba(mark.color, mark.opacity),
        "linewidth": POINT * mark.width * 1.15,
        "linestyle": DASHES[mark.dash],
    }
    if isinstance(mark, fig.Line) and mark.symbol:
        style |= {"marker": MARKERS[mark.symbol], "markersize": POINT * mark.size}
    return style


def _point_style(mark: fig.Points) -> dict[str, Any]:
    color = to_rgba(mark.color, mark.opacity)
    is_thin = mark.symbol.endswith(("-thin", "-ns", "-ew"))
    return {
        "color": color,
        "linestyle": "none",
        "marker": MARKERS[mark.symbol],
        "markersize": POINT * mark.size,
        "markerfacecolor": "none" if mark.is_open else color,
        "markeredgewidth": POINT * 1.9 if mark.is_open or is_thin else 0.0,
    }


def _line(axes: Axes, mark: fig.Line) -> None:
    axes.plot(mark.x, mark.y, **_line_style(mark))


def _points(axes: Axes, mark: fig.Points) -> None:
    if mark.values is not None and mark.scale is not None:
        axes.scatter(
            mark.x,
            mark.y,
            s=(POINT * mark.size) ** 2,
            c=mark.scale.place(mark.values),
            cmap=_colormap(mark.scale),
            norm=_norm(mark.scale),
            zorder=3,
        )
    else:
        axes.plot(mark.x, mark.y, **_point_style(mark), rasterized=len(mark.x) > 500, zorder=3)


def _area(axes: Axes, mark: fig.Area) -> None:
    corners = np.column_stack([mark.x, mark.y]).astype(float)
    gaps = np.flatnonzero(np.isnan(corners).any(axis=1))
    pieces = [piece[~np.isnan(piece).any(axis=1)] for piece in np.split(corners, gaps)]
    paths = [Path(piece, closed=False) for piece in pieces if len(piece)]
    if not paths:
        return
    axes.add_patch(
        PathPatch(
            Path.make_compound_path(*paths),
            facecolor=to_rgba(mark.color, mark.opacity),
            edgecolor=mark.edge or "none",
            linewidth=POINT * mark.width if mark.edge else 0.0,
            zorder=2,
        )
    )


def _bars(axes: Axes, mark: fig.Bars) -> None:
    look: dict[str, Any] = {
        "color": [to_rgba(c, mark.opacity) for c in mark.colors or (mark.color,)]
    }
    if mark.is_across:
        axes.barh(mark.at, mark.size, mark.thickness, left=mark.base, **look)
    else:
        axes.bar(mark.at, mark.size, mark.thickness, bottom=mark.base, **look)


def _cells(axes: Axes, mark: fig.Cells) -> None:
    edges = []
    for middles in (mark.x, mark.y):
        at = np.asarray(middles, dtype=float)
        half = 0.5 * (at[1] - at[0]) if len(at) > 1 else 0.5
        edges += [float(at[0] - half), float(at[-1] + half)]
    axes.imshow(
        mark.scale.place(mark.values),
        extent=tuple(edges),  # type: ignore[arg-type]
        origin="lower",
        aspect="auto",
        cmap=_colormap(mark.scale),
        norm=_norm(mark.scale),
        interpolation="none",
        alpha=mark.opacity,
    )


def _rule(axes: Axes, mark: fig.Rule) -> None:
    (axes.axhline if mark.along == "x" else axes.axvline)(mark.at, **_line_style(mark))


def _span(axes: Axes, mark: fig.Span) -> None:
    color = to_rgba(mark.color, mark.opacity)
    axes.axvspan(mark.begin, mark.end, facecolor=color, linewidth=0.0, zorder=0)


def _text(axes: Axes, mark: fig.Text) -> None:
    x, y = ("data" if inside else "axes fraction" for inside in mark.in_data)
    axes.annotate(
        mark.text,
        (mark.x, mark.y),
        (POINT * mark.shift[0], POINT * mark.shift[1]),
        xycoords=(x, y),
        textcoords="offset points",
        ha=mark.across,
        va="center" if mark.up == "middle" else mark.up,
        color=mark.color,
        fontsize=POINT * mark.size,
        fontweight="bold" if mark.is_bold else "normal",
        parse_math=False,
        annotation_clip=False,
        zorder=4,
    )


_Draw: TypeAlias = Callable[[Axes, Any], None]
_MARKS: dict[type[fig.Mark], _Draw] = {
    fig.Line: _line,
    fig.Points: _points,
    fig.Area: _area,
    fig.Bars: _bars,
    fig.Cells: _cells,
    fig.Rule: _rule,
    fig.Span: _span,
    fig.Text: _text,
}
