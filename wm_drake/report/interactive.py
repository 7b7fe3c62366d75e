"""Picture of a figure that a reader can zoom: plain data for Plotly's script in a page.

`pictures.js` draws it; it fits the picture to the width and to the colours of the page. A colour
in the form `rgb()` is the same on light and on dark ground; pictures.js changes the others.
"""

import base64
import html
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.arrangement import (
    LINE,
    Arrangement,
    Place,
    arrange,
    key_texts,
    x_count,
    y_count,
)

Plain: TypeAlias = dict[str, Any]
"""Data for JSON."""

MOST_POINTS = 3000
"""Largest number of points of a line; a longer line keeps the extremes of short intervals."""

DASHES = {"": "solid", "dashed": "6px,3px", "dotted": "2px,2.5px", "long": "9px,2.5px"}
"""Patterns of lines."""

LINE_GREY = "#9aa5b1"
"""Colour of the lines of axes."""


def plotly_of(figure: fig.Figure) -> Plain:
    """Return a figure as data and layout of Plotly.

    `meta` of the layout has what pictures.js needs: edges of the columns, legend, and panels.
    """
    arrangement = arrange(figure)
    layout: Plain = {
        "width": fig.WIDTH,
        "height": round(arrangement.height),
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0, "pad": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "showlegend": False,
        "hovermode": "closest",
        "barmode": "overlay",
        "dragmode": "zoom",
        "font": {"size": fig.TEXT, "color": fig.MARK},
        "shapes": [],
        "annotations": _outer_labels(figure),
    }
    data: list[Plain] = []
    shared: dict[str, str] = {}
    for index, place in enumerate(arrangement.places):
        number = "" if index == 0 else str(index + 1)
        _add_axes(place, number, arrangement, layout, shared)
        _add_titles(place, number, layout)
        for mark in place.panel.marks:
            y = f"y{200 + index}" if mark.is_second else f"y{number}"
            _add_mark(mark, place.panel, (f"x{number}", y), data, layout)
        if place.panel.top is not None:
            data.append(_top_axis(place, index, layout))
        if place.texts.scale is not None:
            data.append(_color_bar(place, place.texts.scale, arrangement))
    layout["meta"] = {
        "columns": [list(map(float, edges)) for edges in arrangement.columns],
        "keys": list(key_texts(figure)),
        "title": figure.key_title,
        "panels": [(place.panel.name or place.panel.title) for place in arrangement.places],
    }
    return {"data": data, "layout": layout}


def _outer_labels(figure: fig.Figure) -> list[Plain]:
    if not figure.x_label:
        return []
    place: Plain = {"xref": "paper", "yref": "paper", "x": 0.5, "y": 0.0, "xanchor": "center"}
    return [_note(figure.x_label, fig.LABEL, fig.MARK, **place, yanchor="bottom")]


def _note(text: str, size: float, color: str, *, is_bold: bool = False, **place: Any) -> Plain:
    """Return a text in a picture."""
    font = {"size": size, "color": color, "weight": 700 if is_bold else 400}
    return {"text": escaped(text), "showarrow": False, "borderpad": 0, "font": font, **place}


def escaped(text: str) -> str:
    """Return a text as it is written in a picture: nothing in it is markup."""
    lines = (html.escape(line, quote=False).replace("%{", "%&#123;") for line in text.split("\n"))
    return "<br>".join(lines)


def _add_axes(
    place: Place, number: str, arrangement: Arrangement, layout: Plain, shared: dict[str, str]
) -> None:
    panel, height = place.panel, arrangement.height
    x, y = _axis(panel.x), _axis(panel.y)
    x |= {
        "domain": [place.left / fig.WIDTH, place.right / fig.WIDTH],
        "anchor": f"y{number}",
        "side": "top" if panel.x.is_far else "bottom",
        "nticks": x_count(place.right - place.left),
        "tickangle": -90 if place.texts.is_upright else 0,
    }
    y |= {
        "domain": [1.0 - place.bottom / height, 1.0 - place.top / height],
        "anchor": f"x{number}",
        "nticks": y_count(place.bottom - place.top),
    }
    x["title"] = _label(panel.x, "\n".join(place.texts.x_label), 4)
    y["title"] = _label(panel.y, "\n".join(place.texts.y_label), 5)
    for plain, axis, texts in (
        (x, panel.x, place.texts.x_ticks),
        (y, panel.y, place.texts.y_ticks),
    ):
        if axis.ticks is not None:
            plain["tickvals"] = [at for at, _ in axis.ticks]
            plain["ticktext"] = list(map(escaped, texts))
            plain["ticklabeloverflow"] = "allow"
    if panel.is_square:
        y |= {"scaleanchor": f"x{number}", "scaleratio": 1, "constrain": "domain"}
        x["constrain"] = "domain"
    for side, plain, axis in (("x", x, panel.x), ("y", y, panel.y)):
        if axis.scale and not panel.is_square:
            first = shared.setdefault(f"{side}{axis.scale}", f"{side}{number}")
            if first != f"{side}{number}":
                plain["matches"] = first
    layout[f"xaxis{number}"], layout[f"yaxis{number}"] = x, y
    if panel.second is not None:
        second = _axis(panel.second) | {"overlaying": f"y{number}", "side": "right"}
        second |= {"anchor": f"x{number}", "showgrid": False, "nticks": y["nticks"]}
        second |= {"tickmode": "auto"}
        second["title"] = _label(panel.second, panel.second.label, 5)
        layout[f"yaxis{199 + int(number or 1)}"] = second


def _label(axis: fig.Axis, text: str, standoff: int) -> Plain:
    font = {"size": fig.LABEL, "color": axis.color}
    return {"text": escaped(text), "standoff": standoff, "font": font}


def _axis(axis: fig.Axis) -> Plain:
    has_numbers = axis.has_numbers and axis.ticks != ()
    ends = np.log10(np.array(axis.range, dtype=float)) if axis.is_log else axis.range
    plain: Plain = {
        "type": "log" if axis.is_log else "linear",
        "range": [float(end) for end in ends if end is not None],
        "zeroline": False,
        "showgrid": axis.has_grid,
        "gridcolor": fig.GRID,
        "showline": axis.has_line,
        "linecolor": LINE_GREY,
        "showticklabels": has_numbers,
        "ticks": "outside" if has_numbers and axis.has_line else "",
        "ticklen": 4,
        "tickcolor": LINE_GREY,
        "tickfont": {"size": axis.size, "color": fig.QUIET},
        "exponentformat": "power",
        "minexponent": 5,
        "hoverformat": ".5~g",
    }
    if axis.is_log and abs(plain["range"][1] - plain["range"][0]) > 1.0:
        plain["dtick"] = 1
    return plain


def _add_titles(place: Place, number: str, layout: Plain) -> None:
    texts = place.texts
    at: Plain = {"x": 0.0, "y": 1.0, "xanchor": "left", "yanchor": "bottom"}
    at |= {"xref": f"x{number} domain", "yref": f"y{number} domain", "align": "left"}
    rise = texts.above
    for lines, size, color in (
        (texts.subtitles, fig.TEXT, fig.QUIET),
        (texts.titles, fig.TITLE, fig.MARK),
    ):
        if lines:
            is_title = lines is texts.titles
            note = _note("\n".join(lines), size, color, is_bold=is_title, **at, yshift=rise)
            layout["annotations"].append(note)
            rise += len(lines) * size * LINE


def _top_axis(place: Place, index: int, layout: Plain) -> Plain:
    """Add the axis at the top of a panel, and return the empty curve that it needs."""
    top, number = place.panel.top, "" if index == 0 else str(index + 1)
    assert top is not None
    base = layout[f"xaxis{number}"]
    layout[f"xaxis{100 + index}"] = {
        "overlaying": f"x{number}",
        "side": "top",
        "anchor": f"y{number}",
        "range": base["range"],
        "matches": base.get("matches", f"x{number}"),
        "tickvals": [at for at, _ in top.ticks or ()],
        "ticktext": [escaped(text) for _, text in top.ticks or ()],
        "showgrid": False,
        "zeroline": False,
        "showline": True,
        "linecolor": LINE_GREY,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": LINE_GREY,
        "tickfont": {"size": fig.TEXT, "color": fig.QUIET},
        "title": {
            "text": escaped(top.label),
            "standoff": 3,
            "font": {"size": fig.LABEL, "color": fig.QUIET},
        },
    }
    axes = {"xaxis": f"x{100 + index}", "yaxis": f"y{number}"}
    return {"type": "scatter", "x": base["range"], "y": [None, None], "hoverinfo": "skip", **axes}


def _color_bar(place: Place, scale: fig.Scale, arrangement: Arrangement) -> Plain:
    """Return the empty curve that carries the colour bar at the right of a panel."""
    (low, high), ticks = scale.ends(), scale.bar_ticks()
    right = (place.right + 8.0) / fig.WIDTH
    middle = 1.0 - 0.5 * (place.top + place.bottom) / arrangement.height
    bar = {
        "x": right,
        "xanchor": "left",
        "xpad": 0,
        "y": middle,
        "yanchor": "middle",
        "ypad": 0,
        "len": place.bottom - place.top,
        "lenmode": "pixels",
        "thickness": 12,
        "outlinewidth": 0,
        "tickvals": [float(v) for v in scale.place([at for at, _ in ticks])],
        "ticktext": [escaped(text) for _, text in ticks],
        "tickfont": {"size": fig.TEXT, "color": fig.QUIET},
        "title": {
            "text": escaped(scale.label),
            "side": "right",
            "font": {"size": fig.LABEL, "color": fig.MARK},
        },
    }
    marker = {"color": [low], "cmin": low, "cmax": high, "showscale": True, "colorbar": bar}
    marker["colorscale"] = _colorscale(scale)
    return {"type": "scatter", "mode": "markers", "x": [None], "y": [None], "marker": marker}


def _colorscale(scale: fig.Scale) -> list[list[Any]]:
    colors = scale.colors()
    return [[k / (len(colors) - 1), fixed(color)] for k, color in enumerate(colors)]


def fixed(color: str) -> str:
    """Return a colour #rrggbb in the form that is the same on light and on dark ground."""
    return f"rgb({','.join(str(int(color[k : k + 2], 16)) for k in (1, 3, 5))})"


def faded(color: str, opacity: float) -> str:
    """Return a colour #rrggbb with an opacity."""
    if opacity >= 1.0:
        return color
    return f"rgba({','.join(str(int(color[k : k + 2], 16)) for k in (1, 3, 5))},{opacity:g})"


def packed(values: Any) -> Plain:
    """Return numbers as a typed array of Plotly: Base64 text of 32-bit numbers."""
    array = np.ascontiguousarray(values, dtype="<f4")
    plain: Plain = {"dtype": "f4", "bdata": base64.b64encode(array.tobytes()).decode()}
    if array.ndim > 1:
        plain["shape"] = ",".join(map(str, array.shape))
    return plain


def thinned(x: FloatArray, y: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Return at most about `most` points of a curve, among them the extremes of each interval."""
    if len(x) <= most:
        return x, y
    length = -(-len(x) // (most // 2))
    kept = {0, len(x) - 1}
    for begin in np.arange(0, len(x), length):
        piece = y[begin : begin + length]
        if np.isnan(piece).all():
            kept.add(int(begin))
            continue
        kept |= {int(begin + np.nanargmin(piece)), int(begin + np.nanargmax(piece))}
    indices = np.array(sorted(kept))
    return x[indices], y[indices]


def _add_mark(
    mark: fig.Mark, panel: fig.Panel, axes: tuple[str, str], data: list[Plain], layout: Plain
) -> None:
    """Add a mark to the curves, shapes or annotations."""
    if isinstance(mark, (fig.Rule, fig.Span)):
        shape = _rule(mark, axes) if isinstance(mark, fig.Rule) else _span(mark, axes)
        layout["shapes"].append(shape | ({"legendgroup": mark.key} if mark.key else {}))
    elif isinstance(mark, fig.Text):
        is_literal = any(isinstance(other, fig.Cells) for other in panel.marks)
        layout["annotations"].append(_text(mark, axes, is_literal))
    else:
        curve = _CURVES[type(mark)](mark)
        curve |= {"xaxis": axes[0], "yaxis": axes[1], "meta": {"name": mark.name or mark.key}}
        if isinstance(mark, fig.Cells):
            curve["meta"]["kind"] = mark.scale.kind
        if "hoverinfo" not in curve and "hovertemplate" not in curve:
            curve["hovertemplate"] = _hover(mark, panel)
        data.append(curve | ({"legendgroup": mark.key} if mark.key else {}))


def _hover(mark: fig.Mark, panel: fig.Panel) -> str:
    name = mark.name or mark.key
    head = f"<b>{escaped(name)}</b><br>" if name else ""
    y_axis = panel.second if mark.is_second and panel.second else panel.y
    x, y = (
        escaped(text.replace("\n", " "))
        for text in (panel.x.label or "x", y_axis.label or panel.name or panel.title or "y")
    )
    return f"{head}{x}: %{{x:.5~g}}<br>{y}: %{{y:.5~g}}<extra></extra>"


def _rule(mark: fig.Rule, axes: tuple[str, str]) -> Plain:
    x, y = axes
    line = {
        "color": faded(mark.color, mark.opacity),
        "width": mark.width,
        "dash": DASHES[mark.dash],
    }
    if mark.along == "x":
        place: Plain = {
            "xref": f"{x} domain",
            "yref": y,
            "x0": 0,
            "x1": 1,
            "y0": mark.at,
            "y1": mark.at,
        }
    else:
        place = {"xref": x, "yref": f"{y} domain", "x0": mark.at, "x1": mark.at, "y0": 0, "y1": 1}
    return {"type": "line", "layer": "above", "line": line, **place}


def _span(mark: fig.Span, axes: tuple[str, str]) -> Plain:
    place = {"xref": axes[0], "yref": f"{axes[1]} domain", "x0": mark.begin, "x1": mark.end}
    look = {"fillcolor": faded(mark.color, mark.opacity), "line": {"width": 0}}
    return {"type": "rect", "layer": "below", "y0": 0, "y1": 1, **place, **look}


def _text(mark: fig.Text, axes: tuple[str, str], is_literal: bool) -> Plain:
    in_x, in_y = mark.in_data
    color = fixed(mark.color) if is_literal and in_x and in_y else mark.color
    place: Plain = {
        "xref": axes[0] if in_x else f"{axes[0]} domain",
        "yref": axes[1] if in_y else f"{axes[1]} domain",
        "x": mark.x,
        "y": mark.y,
        "xanchor": mark.across,
        "yanchor": mark.up,
        "align": mark.across,
        "xshift": mark.shift[0],
        "yshift": mark.shift[1],
    }
    return _note(mark.text, mark.size, color, is_bold=mark.is_bold, **place)


def _line(mark: fig.Line) -> Plain:
    x, y = (np.asarray(values, dtype=float) for values in (mark.x, mark.y))
    x, y = thinned(x, y, MOST_POINTS)
    color = faded(mark.color, mark.opacity)
    curve: Plain = {
        "type": "scatter",
        "mode": "lines+markers" if mark.symbol else "lines",
        "x": packed(x),
        "y": packed(y),
        "line": {"color": color, "width": mark.width, "dash": DASHES[mark.dash]},
    }
    if mark.symbol:
        curve["marker"] = {"symbol": mark.symbol, "size": mark.size, "color": color}
    return curve


def _points(mark: fig.Points) -> Plain:
    is_thin = mark.symbol.endswith(("-thin", "-ns", "-ew"))
    color = faded(mark.color, mark.opacity)
    symbol = mark.symbol + ("-open" if mark.is_open or is_thin else "")
    width = 2.0 if mark.is_open or is_thin else 0.0
    marker: Plain = {"symbol": symbol, "size": mark.size, "color": color}
    marker["line"] = {"color": color, "width": width}
    if mark.values is not None and mark.scale is not None:
        low, high = mark.scale.ends()
        marker |= {"color": packed(mark.scale.place(mark.values)), "cmin": low, "cmax": high}
        marker |= {"colorscale": _colorscale(mark.scale), "line": {"width": 0}}
    return {
        "type": "scatter",
        "mode": "markers",
        "x": packed(mark.x),
        "y": packed(mark.y),
        "marker": marker,
    }


def _area(mark: fig.Area) -> Plain:
    curve: Plain = {
        "type": "scatter",
        "mode": "lines",
        "x": packed(mark.x),
        "y": packed(mark.y),
        "fill": "toself",
        "fillcolor": faded(mark.color, mark.opacity),
    }
    if mark.edge:
        return curve | {"line": {"width": mark.width, "color": mark.edge}, "hoveron": "points"}
    return curve | {"line": {"width": 0}, "hoverinfo": "skip"}


def _bars(mark: fig.Bars) -> Plain:
    at, size = packed(mark.at), packed(mark.size)
    base = np.broadcast_to(np.asarray(mark.base, dtype=float), np.shape(mark.size))
    colors = [faded(color, mark.opacity) for color in mark.colors or (mark.color,)]
    name = mark.name or mark.key
    return {
        "type": "bar",
        "orientation": "h" if mark.is_across else "v",
        "x": size if mark.is_across else at,
        "y": at if mark.is_across else size,
        "base": packed(base),
        "width": mark.thickness,
        "marker": {"color": colors if mark.colors else colors[0], "line": {"width": 0}},
        "customdata": packed(mark.size),
        "hovertemplate": (f"<b>{escaped(name)}</b><br>" if name else "")
        + "%{customdata:.4~g}<extra></extra>",
    }


def _cells(mark: fig.Cells) -> Plain:
    scale = mark.scale
    low, high = scale.ends()
    value = "z" if scale.kind == "linear" else "customdata"  # pictures.js adds the latter
    return {
        "type": "heatmap",
        **_steps("x", mark.x),
        **_steps("y", mark.y),
        "z": packed(scale.place(mark.values)),
        "zmin": low,
        "zmax": high,
        "zsmooth": False,
        "showscale": False,
        "hoverongaps": False,
        "opacity": mark.opacity,
        "colorscale": _colorscale(scale),
        "hovertemplate": f"%{{x:.5~g}}, %{{y:.5~g}}<br>%{{{value}:.4~g}}<extra></extra>",
    }


def _steps(side: str, middles: Any) -> Plain:
    middles = np.asarray(middles, dtype=float)
    step = float(middles[-1] - middles[0]) / (len(middles) - 1) if len(middles) > 1 else 1.0
    return {f"{side}0": float(middles[0]), f"d{side}": step}


_CURVES: dict[type[fig.Mark], Callable[[Any], Plain]] = {
    fig.Line: _line,
    fig.Points: _points,
    fig.Area: _area,
    fig.Bars: _bars,
    fig.Cells: _cells,
}
