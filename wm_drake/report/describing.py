"""Description of a figure that a browser can draw: panels, curves, texts, legends.

A figure is built once, with matplotlib. This module reads its artists without drawing them, which
saves the time of drawing, and `pictures.js` draws the description in the page. Text stays text:
nothing in a description is markup. Artists are untyped here: matplotlib's hints are unions of all
forms in which a colour can be given.
"""

import base64
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib import colors
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import (
    Collection,
    LineCollection,
    PathCollection,
    PolyCollection,
    QuadMesh,
)
from matplotlib.container import BarContainer
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, ScalarFormatter

from wm_drake.parameters.types import FloatArray

Description: TypeAlias = dict[str, Any]
"""Plain data: texts, numbers, lists, and arrays (see `as_text`)."""

MOST_POINTS = 3000
"""Largest number of points of a curve; a longer curve keeps the extremes of short intervals."""

SHADES = 17
"""Number of colours that a colour scale is sampled at."""


class NotDescribableError(Exception):
    """A figure has an artist that has no description; it is shown as a static picture."""


def describe(figure: Figure, most_points: int | None = MOST_POINTS) -> Description:
    """Return the description of a figure.

    Args:
        figure: Figure with plain axes in grids.
        most_points: Largest number of points of a curve; None to keep all.

    Raises:
        NotDescribableError: the figure has three-dimensional or polar axes, or an artist without a
            description.
    """
    panels = [axes for axes in figure.axes if axes.get_visible() and not _color_bar(axes)]
    if any(axes.name != "rectilinear" for axes in panels):
        raise NotDescribableError("axes are not rectilinear")
    panels = [axes for axes in panels if axes.axison or axes.has_data()]
    size = figure.get_size_inches()
    return {
        "width": float(size[0]),
        "height": float(size[1]),
        "panels": [_thinned_panel(_panel(axes, panels), most_points) for axes in panels],
        "scales": [_scale(axes, panels) for axes in figure.axes if _color_bar(axes)],
        "legends": [_legend(legend) for legend in [*figure.legends, *_own_legends(panels)]],
        "title": figure.get_suptitle(),
        "across": figure.get_supxlabel(),
        "up": figure.get_supylabel(),
        "notes": [_figure_note(text) for text in figure.texts if _is_note(figure, text)],
    }


def _thinned_panel(panel: Description, most: int | None) -> Description:
    """Thin the lines of a panel in place."""
    for part in panel["parts"]:
        if most is not None and part["kind"] == "line":
            part["x"], part["y"] = thinned(part["x"], part["y"], most)
    return panel


def _own_legends(panels: Sequence[Axes]) -> list[Legend]:
    return [legend for axes in panels if (legend := axes.get_legend()) is not None]


def _color_bar(axes: Axes) -> Any:
    return getattr(axes, "_colorbar", None)


def _is_note(figure: Any, text: Text) -> bool:
    """Return whether a text of a figure is neither empty nor its title or the label of an axis."""
    known = (figure._suptitle, figure._supxlabel, figure._supylabel)
    return bool(text.get_text().strip()) and not any(text is one for one in known)


def _figure_note(text: Text) -> Description:
    x, y = text.get_position()
    return _words(text) | {"x": float(x), "y": float(y)}


def _panel(axes: Axes, panels: Sequence[Axes]) -> Description:
    """Return the description of axes: place in the grid, both axes, and what they show."""
    place: Any = axes.get_subplotspec()
    if place is None:
        raise NotDescribableError("axes are not in a grid")
    grid = place.get_gridspec()
    first = next(i for i, other in enumerate(panels) if other.get_subplotspec() == place)
    is_twin = panels[first] is not axes
    return {
        "rows": [place.rowspan.start, place.rowspan.stop],
        "columns": [place.colspan.start, place.colspan.stop],
        "widths": [float(r) for r in grid.get_width_ratios()],
        "heights": [float(r) for r in grid.get_height_ratios()],
        "twin": first if is_twin else None,
        "name": _name(axes),
        "titles": [
            _words(text) | {"side": side}
            for side, text in (
                ("left", axes._left_title),  # type: ignore[attr-defined]
                ("center", axes.title),
                ("right", axes._right_title),  # type: ignore[attr-defined]
            )
            if text.get_text()
        ],
        "x": _axis(axes.xaxis, axes, panels),
        "y": _axis(axes.yaxis, axes, panels),
        "top": _top(axes),
        "is_square": axes.get_aspect() == 1.0,
        "parts": [part for artist in _ordered(axes) for part in _parts(artist)],
    }


def _name(axes: Axes) -> str:
    """Return the name of a panel for a button: its title, the bold text in it, or its label."""
    for side in ("left", "center"):
        if title := axes.get_title(loc=side):
            return str(title)
    bold = [t.get_text() for t in axes.texts if t.get_fontweight() == "bold"]
    return bold[0] if bold else axes.get_ylabel() or axes.get_xlabel()


def _axis(axis: Any, axes: Axes, panels: Sequence[Axes]) -> Description:
    """Return range, ticks and label of an axis, and the number of the panel it is shared with."""
    is_x = axis is axes.xaxis
    low, high = axes.get_xlim() if is_x else axes.get_ylim()
    shared = axes.get_shared_x_axes() if is_x else axes.get_shared_y_axes()
    siblings = [i for i, other in enumerate(panels) if shared.joined(axes, other)]
    shown = axis.get_tick_params(which="major")
    sides = ("bottom", "top") if is_x else ("left", "right")
    near, far = sides
    is_far = bool(shown.get(f"label{far}")) or axis.get_ticks_position() == far
    return {
        "range": [float(low), float(high)],
        "is_log": axis.get_scale() == "log",
        "ticks": _ticks(axis),
        "is_labelled": bool(shown.get(f"label{near}") or shown.get(f"label{far}")),
        "tick_size": float(_points(shown.get("labelsize", 9.0))),
        "is_far": is_far,
        "label": axis.get_label_text(),
        "label_size": float(axis.label.get_fontsize()),
        "color": _hex(axis.label.get_color()),
        "has_grid": bool(shown.get("gridOn")),
        "has_line": axes.axison and axes.spines[far if is_far else near].get_visible(),
        "has_frame": axes.axison and all(spine.get_visible() for spine in axes.spines.values()),
        "shared": min(siblings, default=panels.index(axes)),
    }


def _points(size: Any) -> float:
    return float(size) if isinstance(size, (int, float)) else 10.0


def _ticks(axis: Any) -> list[tuple[float, str]] | None:
    """Return places and texts of ticks that are words; [] without ticks, None for plain numbers."""
    locator: Any = axis.get_major_locator()
    formatter = axis.get_major_formatter()
    if isinstance(locator, NullLocator):
        return []
    if not isinstance(locator, FixedLocator):
        return None
    places = np.asarray(locator.tick_values(0.0, 0.0), dtype=np.float64)
    if not places.size:
        return []
    if isinstance(formatter, (ScalarFormatter, NullFormatter)):
        return None
    texts = formatter.format_ticks(places)
    if all(_is_number(text, place) for text, place in zip(texts, places, strict=True)):
        return None
    plain = [text.replace(r"\$", "$") for text in texts]  # see `name_ticks`
    return [(float(place), text) for place, text in zip(places, plain, strict=True)]


def _is_number(text: str, place: float) -> bool:
    try:
        return float(text.replace("−", "-")) == place
    except ValueError:
        return False


def _top(axes: Axes) -> Description | None:
    """Return ticks and label of a second axis along the top."""
    for child in axes.child_axes:
        axis = child.xaxis
        ticks = _ticks(axis)
        if ticks:
            return {
                "ticks": ticks,
                "label": axis.get_label_text(),
                "label_size": float(axis.label.get_fontsize()),
                "tick_size": _points(axis.get_tick_params().get("labelsize", 9.0)),
            }
    return None


def _ordered(axes: Axes) -> list[Artist]:
    """Return the artists of axes in the order of drawing; bars of one container are one artist."""
    bars = [container for container in axes.containers if isinstance(container, BarContainer)]
    of_bars = {id(patch) for container in bars for patch in container.patches}
    rest = [
        *axes.images,
        *axes.collections,
        *(patch for patch in axes.patches if id(patch) not in of_bars),
        *axes.lines,
        *axes.texts,
    ]
    shown: list[tuple[float, Any]] = [
        (artist.get_zorder(), artist) for artist in rest if artist.get_visible()
    ]
    shown += [(container.patches[0].get_zorder(), container) for container in bars if container]
    return [artist for _, artist in sorted(shown, key=lambda pair: pair[0])]


def _parts(artist: Any) -> Iterator[Description]:
    """Return the descriptions of an artist."""
    describers: tuple[tuple[type, Callable[[Any], Iterator[Description]]], ...] = (
        (BarContainer, _bars),
        (Line2D, _line),
        (AxesImage, _image),
        (QuadMesh, _mesh),
        (ContourSet, _contours),
        (PathCollection, _scatter),
        (LineCollection, _segments),
        (PolyCollection, _areas),
        (Rectangle, _rectangle),
        (Patch, _patch),
        (Text, _text),
    )
    for kind, describer in describers:
        if isinstance(artist, kind):
            yield from describer(artist)
            return
    raise NotDescribableError(f"{type(artist).__name__} has no description")


def _line(line: Any) -> Iterator[Description]:
    x, y = (np.asarray(v, dtype=float) for v in line.get_data(orig=False))
    if not len(x):
        return
    along = _along(line)
    style = _line_style(line)
    if along is not None:  # a line across the whole panel
        value = float(y[0]) if along == "x" else float(x[0])
        yield {"kind": "rule", "along": along, "at": value} | style
        return
    yield {"kind": "line", "x": as_array(x), "y": as_array(y)} | style


def _hex(color: Any) -> str:
    return colors.to_hex(color)


def _in_data(artist: Artist) -> tuple[bool, bool]:
    """Return for x and y whether an artist is in data coordinates."""
    axes = artist.axes
    assert axes is not None
    in_x, in_y = artist.get_transform().contains_branch_seperately(axes.transData)
    return bool(in_x), bool(in_y)


def _along(artist: Artist) -> str | None:
    """Return the direction in which an artist extends over the whole panel, if any."""
    in_x, in_y = _in_data(artist)
    if in_x and in_y:
        return None
    if in_x or in_y:
        return "y" if in_x else "x"
    raise NotDescribableError("an artist is not in data coordinates")


def _line_style(line: Any) -> Description:
    dash, mark = _dash(line), line.get_marker()
    has_mark = mark not in (None, "", "None", " ", "none")
    color = line.get_color()
    keys = []
    if dash:
        keys.append(f"line {_hex(color)} {dash}")
    if has_mark:
        keys.append(f"mark {_hex(line.get_markeredgecolor())}")
    filled = line.get_markerfacecolor()
    is_open = isinstance(filled, str) and filled == "none"
    return {
        "color": _color(color, line),
        "width": float(line.get_linewidth()),
        "dash": dash,
        "mark": str(mark) if has_mark else None,
        "mark_color": _color(line.get_markeredgecolor() if is_open else filled, line),
        "mark_size": float(line.get_markersize()),
        "is_open": is_open,
        "label": _label(line),
        "keys": keys,
    }


def _dash(line: Any) -> str:
    """Return the pattern of a line: solid, lengths of dashes and gaps in points, or "" without."""
    if line.get_linestyle() in ("None", "none", " ", ""):
        return ""
    lengths = line._unscaled_dash_pattern[1]
    if lengths is None:
        return "solid"
    width = max(float(line.get_linewidth()), 0.8)
    return ",".join(f"{float(length) * width:.3g}" for length in lengths)


def _label(artist: Any) -> str | None:
    label = str(artist.get_label() or "")
    return None if not label or label.startswith("_") else label


def _color(color: Any, artist: Artist) -> Description:
    """Return a colour as text, with its opacity."""
    alpha = artist.get_alpha()
    red, green, blue, own = colors.to_rgba(color)
    opacity = own if alpha is None or not isinstance(alpha, (int, float)) else float(alpha)
    return {"hex": _hex((red, green, blue)), "alpha": round(float(opacity), 3)}


def _image(image: Any) -> Iterator[Description]:
    values: FloatArray = np.ma.filled(np.ma.asarray(image.get_array(), dtype=float), np.nan)
    if values.ndim != 2:
        raise NotDescribableError("an image has no colour scale")
    left, right, bottom, top = image.get_extent()
    rows, columns = values.shape
    yield {
        "kind": "cells",
        "x": as_array(_middles(left, right, columns)),
        "y": as_array(
            _middles(bottom, top, rows) if image.origin == "lower" else _middles(top, bottom, rows)
        ),
        "values": as_array(values.ravel()),
    } | _colored(image)


def _middles(begin: float, end: float, count: int) -> FloatArray:
    step = (end - begin) / count
    return np.asarray(begin + step * (np.arange(count) + 0.5))


def _mesh(mesh: Any) -> Iterator[Description]:
    corners = mesh.get_coordinates()
    values: FloatArray = np.ma.filled(np.ma.asarray(mesh.get_array(), dtype=float), np.nan)
    x, y = corners[0, :, 0], corners[:, 0, 1]
    if values.ndim == 1:
        values = values.reshape(len(y) - 1, len(x) - 1)
    yield {
        "kind": "cells",
        "x": as_array(np.asarray(x)),
        "y": as_array(np.asarray(y)),
        "values": as_array(values.ravel()),
    } | _colored(mesh)


def _colored(mappable: Any) -> Description:
    """Return colour scale and its norm of what has values for colours."""
    norm = mappable.norm
    low, high = float(norm.vmin), float(norm.vmax)
    kinds = {"LogNorm": "log", "PowerNorm": "power", "Normalize": "linear"}
    kind = kinds.get(type(norm).__name__)
    if kind is None:
        kind = "linear"
    shades = mappable.cmap(np.linspace(0.0, 1.0, SHADES))
    return {
        "norm": {"kind": kind, "low": low, "high": high, "gamma": getattr(norm, "gamma", 1.0)},
        "shades": [_hex(shade) for shade in shades],
        "alpha": 1.0 if mappable.get_alpha() is None else float(mappable.get_alpha()),
    }


def _contours(contours: Any) -> Iterator[Description]:
    faces = contours.get_facecolor()
    for path, face in zip(contours.get_paths(), faces, strict=False):
        if len(path.vertices):
            yield _area([path], _hex(face), float(face[3]))


def _scatter(points: Any) -> Iterator[Description]:
    x, y = np.ma.filled(np.ma.asarray(points.get_offsets(), dtype=float), np.nan).T
    sizes = np.sqrt(points.get_sizes())
    part: Description = {
        "kind": "points",
        "x": as_array(x),
        "y": as_array(y),
        "mark_size": float(sizes[0]) if len(sizes) else 6.0,
        "label": _label(points),
    }
    values = points.get_array()
    if values is not None:
        yield (
            part
            | {"values": as_array(np.asarray(values, dtype=float)), "keys": []}
            | _colored(points)
        )
        return
    faces = points.get_facecolor()
    color = faces[0] if len(faces) else points.get_edgecolor()[0]
    own = [_hex(face) for face in faces] if len(faces) == len(x) > 1 else None
    yield part | {
        "color": _color(color, points),
        "own_colors": own,
        "keys": [f"mark {_hex(color)}"],
    }


def _segments(lines: Any) -> Iterator[Description]:
    """Return lines, one part per colour."""
    shades = lines.get_color()
    paths = [path.vertices for path in lines.get_paths()]
    if _in_data(lines) != (True, True):
        raise NotDescribableError("lines are not in data coordinates")
    hues = [_hex(shades[i % len(shades)]) for i in range(len(paths))]
    for hue in dict.fromkeys(hues):
        own = [np.asarray(p) for p, h in zip(paths, hues, strict=True) if h == hue]
        vertices = _with_gaps(own)
        yield {
            "kind": "line",
            "x": as_array(vertices[:, 0]),
            "y": as_array(vertices[:, 1]),
            "color": _color(hue, lines),
            "width": float(lines.get_linewidth()[0]),
            "dash": "solid",
            "mark": None,
            "label": _label(lines),
            "keys": [f"line {hue} solid"],
        }


def _with_gaps(pieces: Sequence[FloatArray]) -> FloatArray:
    """Return pieces (n, 2) of a line, with NaN between them, as one array."""
    gap = np.full((1, 2), np.nan)
    parts = list(itertools.chain.from_iterable((piece, gap) for piece in pieces))[:-1]
    return np.concatenate(parts) if parts else np.empty((0, 2))


def _areas(areas: Any) -> Iterator[Description]:
    faces, paths = areas.get_facecolor(), areas.get_paths()
    if not len(faces):
        return
    if _in_data(areas) != (True, True):
        raise NotDescribableError("an area is not in data coordinates")
    shades = [faces[i % len(faces)] for i in range(len(paths))]
    for shade in dict.fromkeys(map(tuple, shades)):
        own = [p for p, s in zip(paths, shades, strict=True) if tuple(s) == shade]
        part = _area(own, _hex(shade), float(shade[3])) | {"label": _label(areas)}
        width, edges = float(areas.get_linewidth()[0]), areas.get_edgecolor()
        if width and len(edges):
            part["edge"] = {"color": _color(edges[0], areas), "width": width}
            part["keys"] = [*part["keys"], f"line {_hex(edges[0])} solid"]
        yield part


def _area(paths: Sequence[Any], color: str, alpha: float) -> Description:
    pieces: list[FloatArray] = [
        np.asarray(piece)[:, :2]
        for path in paths
        for piece in path.to_polygons(closed_only=False)
        if len(piece)
    ]
    vertices = _with_gaps([np.asarray(piece) for piece in pieces])
    return {
        "kind": "area",
        "x": as_array(vertices[:, 0]),
        "y": as_array(vertices[:, 1]),
        "color": {"hex": color, "alpha": round(alpha, 3)},
        "edge": None,
        "label": None,
        "keys": [f"area {color}"],
    }


def _rectangle(patch: Any) -> Iterator[Description]:
    in_x, in_y = _in_data(patch)
    if in_x and in_y:
        yield from _patch(patch)
        return
    along = "y" if in_x else "x"
    begin, length = (
        (patch.get_x(), patch.get_width()) if in_x else (patch.get_y(), patch.get_height())
    )
    yield {
        "kind": "span",
        "along": along,
        "range": [float(begin), float(begin + length)],
        "color": _color(patch.get_facecolor(), patch),
        "keys": [f"area {_hex(patch.get_facecolor())}"],
    }


def _patch(patch: Any) -> Iterator[Description]:
    path = patch.get_patch_transform().transform_path(patch.get_path())
    face = patch.get_facecolor()
    hue = _hex(face)
    part = _area([path], hue, float(face[3]) if patch.get_fill() else 0.0)
    if patch.get_linewidth() and patch.get_edgecolor()[3]:
        edge = patch.get_edgecolor()
        part["edge"] = {"color": _color(edge, patch), "width": float(patch.get_linewidth())}
        part["keys"] = [*part["keys"], f"line {_hex(edge)} solid"]
    yield part | {"label": _label(patch)}


def _bars(container: Any) -> Iterator[Description]:
    patches = container.patches
    is_across = container.orientation == "horizontal"
    places = [p.get_y() + 0.5 * p.get_height() for p in patches]
    wide = [p.get_height() for p in patches]
    begins, sizes = [p.get_x() for p in patches], [p.get_width() for p in patches]
    if not is_across:
        places = [p.get_x() + 0.5 * p.get_width() for p in patches]
        wide = [p.get_width() for p in patches]
        begins, sizes = [p.get_y() for p in patches], [p.get_height() for p in patches]
    hues = [_hex(p.get_facecolor()) for p in patches]
    yield {
        "kind": "bars",
        "is_across": is_across,
        "places": as_array(np.array(places, dtype=float)),
        "wide": as_array(np.array(wide, dtype=float)),
        "begins": as_array(np.array(begins, dtype=float)),
        "sizes": as_array(np.array(sizes, dtype=float)),
        "colors": hues,
        "alpha": float(patches[0].get_facecolor()[3]),
        "label": _label(container),
        "keys": [f"area {hue}" for hue in dict.fromkeys(hues)],
    }
    if container.errorbar is not None:
        return  # its lines are among the collections of the axes


def _words(text: Any) -> Description:
    """Return the words of a text and how they are written."""
    return {
        "text": text.get_text(),
        "size": float(text.get_fontsize()),
        "color": _color(text.get_color(), text),
        "is_bold": text.get_fontweight() in ("bold", "semibold", 700, 600),
        "across": text.get_horizontalalignment(),
        "up": text.get_verticalalignment(),
        "angle": float(text.get_rotation()),
    }


def _text(text: Any) -> Iterator[Description]:
    if not text.get_text().strip():
        return
    shift, arrow = (0.0, 0.0), None
    if isinstance(text, Annotation):
        place, inside = text.xy, _inside_of(text.xycoords, text)
        words, coords = text.xyann, text.anncoords
        if coords == "offset points":
            shift = (float(words[0]), float(words[1]))
        elif tuple(words) != tuple(place):
            arrow = [float(place[0]), float(place[1])]
            place, inside = words, _inside_of(coords, text)
        if text.arrowprops is None and arrow is not None:
            arrow = None
    else:
        place, inside = text.get_position(), _inside_of(text.get_transform(), text)
    yield _words(text) | {
        "kind": "text",
        "x": float(place[0]),
        "y": float(place[1]),
        "in_data": inside,
        "shift": shift,
        "arrow": arrow,
        "is_clipped": bool(text.get_clip_on()) if isinstance(text, Annotation) else True,
    }


def _inside_of(coords: Any, text: Text) -> list[bool]:
    """Return for x and y whether a place is in data coordinates, or in parts of the panel."""
    names = {"data": True, "axes fraction": False}
    if isinstance(coords, str):
        coords = (coords, coords)
    if isinstance(coords, tuple):
        if not all(name in names for name in coords):
            raise NotDescribableError(f"a text is placed by {coords}")
        return [names[name] for name in coords]
    axes = text.axes
    assert axes is not None
    inside = coords.contains_branch_seperately(axes.transData)
    if not any(inside) and not coords.contains_branch(axes.transAxes):
        raise NotDescribableError("a text is placed in the figure")
    return [bool(part) for part in inside]


def _scale(axes: Axes, panels: Sequence[Axes]) -> Description:
    """Return the colour bar of some axes: scale, ticks, label, and the panel it belongs to."""
    bar = _color_bar(axes)
    owner = getattr(bar.mappable, "axes", None)
    parents = getattr(axes, "_colorbar_info", {}).get("parents", [])
    of_all = len(parents) > 1
    return _colored(bar.mappable) | {
        "panel": panels.index(owner) if owner in panels else 0,
        "is_common": of_all,
        "ticks": _ticks(axes.yaxis),
        "label": axes.get_ylabel(),
    }


def _legend(legend: Legend) -> Description:
    """Return the entries of a legend: text, sample, and which curves each stands for."""
    entries = []
    handles: list[Any] = list(legend.legend_handles)
    for handle, text in zip(handles, legend.get_texts(), strict=True):
        sample: Description = {"label": text.get_text().strip(), "own": text.get_text()}
        if isinstance(handle, Line2D):
            sample |= {"line": _line_style(handle), "keys": _line_style(handle)["keys"]}
        elif isinstance(handle, Patch):
            face, edge = map(colors.to_rgba, (handle.get_facecolor(), handle.get_edgecolor()))
            sample["area"] = {
                "color": _color(face, handle),
                "edge": _color(edge, handle) if edge[3] else None,
            }
            sample["keys"] = [
                f"area {_hex(face)}",
                *([f"line {_hex(edge)} solid"] if edge[3] else []),
            ]
        elif isinstance(handle, Collection):
            faces = handle.get_facecolor()
            hue = faces[0] if len(faces) else handle.get_edgecolor()[0]
            sample["area"] = {"color": _color(hue, handle), "edge": None}
            sample["keys"] = [f"area {_hex(hue)}", f"mark {_hex(hue)}"]
        else:
            sample["keys"] = []
        entries.append(sample)
    return {"title": legend.get_title().get_text(), "entries": entries}


def thinned(x: FloatArray, y: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Return at most about `most` points of a curve, among them the extremes of each interval.

    Args:
        x: (n,) abscissae.
        y: (n,) ordinates.
        most: Number of points from which on a curve is thinned.
    """
    if len(x) <= most:
        return x, y
    length = -(-len(x) // (most // 2))
    ends = np.arange(0, len(x), length)
    kept = {0, len(x) - 1}
    for begin in ends:
        piece = y[begin : begin + length]
        if np.isnan(piece).all():
            kept.add(int(begin))
            continue
        kept |= {int(begin + np.nanargmin(piece)), int(begin + np.nanargmax(piece))}
    indices = np.array(sorted(kept))
    return x[indices], y[indices]


def as_array(values: FloatArray) -> FloatArray:
    """Return numbers as an array of a description."""
    return np.asarray(values, dtype=float)


def as_plain(value: Any) -> Any:
    """Return a description with arrays as Base64 text of their 32-bit numbers, for JSON."""
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value, dtype="<f4").tobytes()
        return {"f4": base64.b64encode(data).decode()}
    if isinstance(value, Mapping):
        if value.get("kind") == "cells":
            value = {**value, "values": None, "levels": _levels(value["values"], value["norm"])}
        return {key: as_plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [as_plain(item) for item in value]
    return value


def _levels(values: FloatArray, norm: Mapping[str, Any]) -> str:
    """Return values as steps of their colour scale from 0 to 65534, as Base64 text; 65535: none."""
    low, high = norm["low"], norm["high"]
    if norm["kind"] == "log":
        with np.errstate(divide="ignore", invalid="ignore"):
            place = np.log(values / low) / (np.log(high / low) or 1.0)
    else:
        place = (values - low) / ((high - low) or 1.0)
    place = np.clip(place, 0.0, 1.0)
    if norm["kind"] == "power":
        place = place ** norm["gamma"]
    steps = np.where(np.isnan(values), 65535, np.round(65534.0 * np.nan_to_num(place)))
    return base64.b64encode(steps.astype("<u2").tobytes()).decode()
