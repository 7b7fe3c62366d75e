"""Where the panels of a figure are: ranges of axes, and room for texts around the panels.

Both pictures of a figure, that of a page and that of a file, use the same places.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig

CHARACTER = 0.56
"""Mean width of a character, as part of the size of the text."""

LINE = 1.25
"""Distance of lines of text, as part of their size."""

GAP = 14.0
"""Room between neighbouring panels. [px]"""

NARROW = 0.62
"""Part of its width that a panel has on the narrowest page, where texts still must fit."""

LABELLED = 0.75
"""Part of the width of a panel that the label of its horizontal axis has."""

LONGEST_TICK = 200.0
"""Largest length of a line of the names at ticks. [px]"""

BAR = 18.0
"""Room at the top for the buttons of a picture on a page. [px]"""

MARGIN = 0.05
"""Room between data and the end of an axis, as part of the data's range."""


@dataclass(frozen=True)
class Texts:
    """What stands around the axes of a panel.

    Attributes:
        above: Room between the axes and the title. [px]
        x_ticks, y_ticks: Texts of the named ticks, broken into lines.
        is_upright: Whether the texts of the horizontal axis are turned.
        x_label, y_label: Lines of the labels of both axes.
        scale: Scale of the colour bar at its right.
    """

    titles: tuple[str, ...]
    subtitles: tuple[str, ...]
    above: float
    x_ticks: tuple[str, ...]
    y_ticks: tuple[str, ...]
    is_upright: bool
    x_label: tuple[str, ...]
    y_label: tuple[str, ...]
    scale: fig.Scale | None


@dataclass(frozen=True)
class Place:
    """Place of a panel, from the left and from the top. [px]

    Attributes:
        panel: The panel; the ranges of its axes are numbers.
        left, right, top, bottom: Edges of its axes.
        texts: What stands around them.
    """

    panel: fig.Panel
    left: float
    right: float
    top: float
    bottom: float
    texts: Texts


@dataclass(frozen=True)
class Arrangement:
    """Places of all panels, and the size of the figure. [px]"""

    places: tuple[Place, ...]
    height: float
    width: float
    columns: tuple[tuple[float, float], ...]


def text_width(text: str, size: float) -> float:
    """Return about how wide the longest line of a text is. [px]"""
    return CHARACTER * size * max((len(line) for line in text.split("\n")), default=0)


def wrapped(text: str, size: float, room: float) -> tuple[str, ...]:
    """Return a text in lines that fit into a room [px], broken after blanks, dashes and dots."""
    lines = []
    for line in text.split("\n"):
        now = ""
        for word in re.split(r"(?<=[\s/–_-])|(?<=\.)(?=[a-z])", line):
            if now and text_width((now + word).rstrip(), size) > room:
                lines.append(now.rstrip())
                now = ""
            now += word
        lines.append(now.rstrip())
    return tuple(lines)


def x_count(width: float) -> int:
    """Return the number of round numbers that a horizontal axis has room for."""
    return max(3, round(width / 62.0))


def y_count(height: float) -> int:
    """Return the number of round numbers that a vertical axis has room for."""
    return max(3, round(height / 34.0))


def key_texts(figure: fig.Figure) -> tuple[str, ...]:
    """Return the entries of the legend."""
    marks = (mark for panel in figure.panels for mark in panel.marks)
    return figure.keys or tuple(dict.fromkeys(mark.key for mark in marks if mark.key))


def in_one_column(figure: fig.Figure) -> fig.Figure:
    """Return a figure with its panels below each other, each with the numbers of its axes.

    One with panels of several rows stays as it is: its panels belong side by side.
    """
    if any(panel.rows > 1 for panel in figure.panels):
        return figure
    ordered = sorted(figure.panels, key=lambda panel: (panel.row, panel.column))
    shown = []
    for place, panel in enumerate(ordered):
        x = next(p.x for p in reversed(ordered) if p.column == panel.column)
        y = next(p.y for p in ordered if p.row == panel.row)
        axes = {
            name: replace(axis, has_numbers=shared.has_numbers, label=axis.label or shared.label)
            if axis.scale and axis.scale == shared.scale
            else axis
            for name, axis, shared in (("x", panel.x, x), ("y", panel.y, y))
        }
        shown.append(replace(panel, row=place, column=0, x=axes["x"], y=axes["y"]))
    return replace(figure, panels=tuple(shown), widths=())


def arrange(figure: fig.Figure, width: float = fig.WIDTH) -> Arrangement:
    """Return the places of the panels of a figure of a width. [px]"""
    panels = _with_ranges(figure.panels)
    columns, rows = (1 + max(p.column for p in panels), max(p.row + p.rows for p in panels))
    ratios = np.array(figure.widths or (1.0,) * columns)
    outer = fig.LABEL * LINE + 8.0
    begin, end = 0.0, float(width)
    spans = np.full(columns, (end - begin) * 0.85) * ratios / ratios.sum()
    for _ in range(3):  # texts are broken by the width that other texts leave
        rooms = [_room(p, spans[p.column], figure.height * p.rows) for p in panels]
        left, right = np.zeros(columns), np.zeros(columns)
        for panel, room in zip(panels, rooms, strict=True):
            left[panel.column] = max(left[panel.column], room.left)
            right[panel.column] = max(right[panel.column], room.right)
        free = end - begin - left.sum() - right.sum() - GAP * (columns - 1)
        spans = max(free, 60.0 * columns) * ratios / ratios.sum()
    above, below = np.zeros(rows), np.zeros(rows)
    for panel, room in zip(panels, rooms, strict=True):
        above[panel.row] = max(above[panel.row], room.top)
        last = panel.row + panel.rows - 1
        below[last] = max(below[last], room.bottom)
    x_edges, at = [], begin
    for column in range(columns):
        at += left[column]
        x_edges.append((at, at + spans[column]))
        at += spans[column] + right[column] + GAP
    y_edges, at = [], BAR
    for row in range(rows):
        at += above[row]
        y_edges.append((at, at + figure.height))
        at += figure.height + below[row] + 0.5 * GAP
    places = tuple(
        Place(
            panel,
            *x_edges[panel.column],
            y_edges[panel.row][0],
            y_edges[panel.row + panel.rows - 1][1],
            room.texts,
        )
        for panel, room in zip(panels, rooms, strict=True)
    )
    height = at - 0.5 * GAP + (outer if figure.x_label else 0.0)
    return Arrangement(places, float(height), float(width), tuple(x_edges))


@dataclass(frozen=True)
class _Room:
    left: float
    right: float
    top: float
    bottom: float
    texts: Texts


def _room(panel: fig.Panel, width: float, height: float) -> _Room:
    """Return the room that the texts around a panel of a size need. [px]"""
    x_ticks, is_upright, x_height = _x_ticks(panel.x, width)
    y_ticks, y_width = _y_ticks(panel.y, height)
    y_label = wrapped(panel.y.label, fig.LABEL, max(60.0, height)) if panel.y.label else ()
    left = max(y_width + (len(y_label) * fig.LABEL * LINE + 6.0 if y_label else 0.0), 2.0)
    x_label = (
        wrapped(panel.x.label, fig.LABEL, max(80.0, width * LABELLED)) if panel.x.label else ()
    )
    outside = x_height + (len(x_label) * fig.LABEL * LINE + 6.0 if x_label else 0.0)
    if x_height and not is_upright:
        half = 0.5 * text_width(x_ticks[0] if x_ticks else "000", panel.x.size)
        left = max(left, half if not x_ticks else half - _first_place(panel.x, width))
    above, below = (outside, 4.0) if panel.x.is_far else (4.0, outside + 4.0)
    right = _right(panel, width)
    if panel.second is not None:
        right += _y_ticks(panel.second, height)[1] + fig.LABEL * LINE + 10.0
    scale = next((s for m in panel.marks if (s := getattr(m, "scale", None)) and s.label), None)
    if scale is not None:
        names = [text for _, text in scale.ticks or ((0.0, "0.001"),)]
        right += 34.0 + fig.LABEL * LINE + max(text_width(text, fig.TEXT) for text in names)
    if panel.top is not None:
        above += fig.TEXT * LINE + 8.0 + (fig.LABEL * LINE + 4.0 if panel.top.label else 0.0)
    for mark in panel.marks:  # texts above the panel
        if (
            isinstance(mark, fig.Text)
            and not mark.in_data[1]
            and mark.y >= 1.0
            and mark.shift[1] > 0
        ):
            above = max(above, mark.shift[1] + mark.size * LINE)
    most = max(70.0, NARROW * width + GAP)
    titles = wrapped(panel.title, fig.TITLE, most) if panel.title else ()
    subtitles = wrapped(panel.subtitle, fig.TEXT, most) if panel.subtitle else ()
    top = above + LINE * (len(titles) * fig.TITLE + len(subtitles) * fig.TEXT)
    top += 4.0 if titles or subtitles else 0.0
    texts = Texts(titles, subtitles, above, x_ticks, y_ticks, is_upright, x_label, y_label, scale)
    return _Room(left, right, top, below, texts)


def _first_place(axis: fig.Axis, width: float) -> float:
    low, high = _numbers(axis)
    assert axis.ticks
    return width * (axis.ticks[0][0] - low) / ((high - low) or 1.0)


def _right(panel: fig.Panel, width: float) -> float:
    """Return the room for what reaches over the right end of a panel: a tick, a text."""
    need = 4.0
    low, high = _numbers(panel.x)
    span = (high - low) or 1.0
    if panel.x.has_numbers and panel.x.ticks is None:
        need = max(need, 0.5 * text_width("000", panel.x.size))
    for at, text in panel.x.ticks or ():
        if panel.x.has_numbers:
            half = 0.5 * min(text_width(text, panel.x.size), 60.0)
            need = max(need, half - width * (high - at) / span)
    for mark in panel.marks:
        if isinstance(mark, fig.Text) and mark.in_data[0] and mark.across == "left":
            at = width * (mark.x - low) / span + mark.shift[0]
            if at > 0.6 * width:
                need = max(need, at + text_width(mark.text, mark.size) - width + 4.0)
    return min(need, 0.4 * width)


def _x_ticks(axis: fig.Axis, width: float) -> tuple[tuple[str, ...], bool, float]:
    """Return texts of named ticks, whether they are turned, and the height of all texts."""
    if not axis.has_numbers or axis.ticks == ():
        return (), False, 0.0
    if axis.ticks is None:
        return (), False, axis.size * LINE + 7.0
    low, high = _numbers(axis)
    places = np.sort([at for at, text in axis.ticks if text])
    steps = np.diff(places, append=places[0] + abs(high - low))
    cell = NARROW * width * float(np.abs(steps).min()) / (abs(high - low) or 1.0) - 4.0
    texts = [wrapped(text, axis.size, max(cell, 1.0)) for _, text in axis.ticks]
    if max(text_width("\n".join(lines), axis.size) for lines in texts) <= cell:
        height = max(map(len, texts)) * axis.size * LINE + 7.0
        return tuple("\n".join(lines) for lines in texts), False, height
    texts = [wrapped(text, axis.size, LONGEST_TICK) for _, text in axis.ticks]
    joined = tuple("\n".join(lines) for lines in texts)
    return joined, True, max(text_width(text, axis.size) for text in joined) + 10.0


def _y_ticks(axis: fig.Axis, height: float) -> tuple[tuple[str, ...], float]:
    """Return texts of named ticks of a vertical axis, and the width of all texts."""
    if not axis.has_numbers or axis.ticks == ():
        return (), 0.0
    low, high = _numbers(axis)
    if axis.ticks is None:
        if axis.is_log:
            return (), text_width("10−10", axis.size) + 8.0
        numbers = fig.round_numbers(min(low, high), max(low, high), y_count(height))
        step = numbers[1] - numbers[0] if len(numbers) > 1 else 1.0
        decimals = max(0, -int(np.floor(np.log10(abs(step) or 1.0) + 1e-9)))
        longest = max(len(f"{number:.{min(decimals, 8)}f}") for number in numbers[[0, -1]])
        return (), text_width("0" * longest, axis.size) + (13.0 if min(low, high) < 0.0 else 9.0)
    places = np.sort([at for at, _ in axis.ticks])
    steps = np.diff(places) if len(places) > 1 else np.array([abs(high - low)])
    cell = height * float(np.abs(steps).min()) / (abs(high - low) or 1.0)
    for room in (LONGEST_TICK, 1.4 * LONGEST_TICK, 2.0 * LONGEST_TICK):
        texts = tuple("\n".join(wrapped(text, axis.size, room)) for _, text in axis.ticks)
        if max(1 + text.count("\n") for text in texts) * axis.size * LINE <= cell:
            break
    return texts, max(text_width(text, axis.size) for text in texts) + 9.0


def _with_ranges(panels: Sequence[fig.Panel]) -> list[fig.Panel]:
    """Return panels whose axes have numbers as ranges, equal ones for axes of one scale."""
    ranges: dict[str, list[tuple[float, float]]] = {}
    shown: list[fig.Panel] = []
    for panel in panels:
        axes = {"x": panel.x, "y": panel.y, "second": panel.second}
        for name, axis in axes.items():
            if axis is None:
                continue
            marks = [m for m in panel.marks if name == "x" or m.is_second == (name == "second")]
            axes[name] = replace(axis, range=_range(marks, axis, "x" if name == "x" else "y"))
        shown.append(replace(panel, **axes))  # type: ignore[arg-type]
        for side, axis in (("x", axes["x"]), ("y", axes["y"])):
            if axis is not None and axis.scale:
                ranges.setdefault(side + axis.scale, []).append(_numbers(axis))
    for index, panel in enumerate(shown):
        for side in ("x", "y"):
            axis = getattr(panel, side)
            if axis.scale:
                every = np.array(ranges[side + axis.scale])
                is_turned = every[0, 0] > every[0, 1]
                ends = (every.min(), every.max())[:: -1 if is_turned else 1]
                changed = replace(axis, range=tuple(map(float, ends)))
                panel = replace(panel, **{side: changed})
        shown[index] = panel
    return shown


def _numbers(axis: fig.Axis) -> tuple[float, float]:
    low, high = axis.range
    assert low is not None
    assert high is not None
    return low, high


def _range(marks: Iterable[fig.Mark], axis: fig.Axis, side: str) -> tuple[float, float]:
    """Return the range of an axis: its ends, or those of the data with some room."""
    low, high = axis.range
    if low is not None and high is not None:
        return low, high
    extents = [_extent(mark, side) for mark in marks]
    values = np.concatenate([*extents, np.empty(0)])
    values = values[np.isfinite(values)]
    if axis.is_log:
        values = values[values > 0.0]
    if not values.size:
        values = np.array([1.0, 10.0] if axis.is_log else [0.0, 1.0])
    if any(isinstance(mark, fig.Cells) for mark in marks):
        first, last = float(values.min()), float(values.max())
    elif axis.is_log:
        logs = np.log10([values.min(), values.max()])
        room = MARGIN * float(logs[1] - logs[0]) or 0.3
        first, last = float(10.0 ** (logs[0] - room)), float(10.0 ** (logs[1] + room))
    else:
        first, last = float(values.min()), float(values.max())
        room = MARGIN * (last - first) or MARGIN * abs(last) or 1.0
        first, last = first - room, last + room
    return (first if low is None else low), (last if high is None else high)


def _extent(mark: fig.Mark, side: str) -> FloatArray:
    """Return the numbers of a mark along an axis."""
    if isinstance(mark, fig.Rule):
        return np.array([mark.at]) if (mark.along == "x") == (side == "y") else np.empty(0)
    if isinstance(mark, fig.Bars):
        at, base = np.asarray(mark.at, dtype=float), np.asarray(mark.base, dtype=float)
        if mark.is_across == (side == "y"):
            return np.concatenate([at - 0.5 * mark.thickness, at + 0.5 * mark.thickness])
        return np.concatenate([base.ravel(), (base + np.asarray(mark.size, dtype=float)).ravel()])
    if isinstance(mark, fig.Cells):
        at = np.asarray(getattr(mark, side), dtype=float)
        half = 0.5 * (at[1] - at[0]) if len(at) > 1 else 0.5
        return np.array([at[0] - half, at[-1] + half])
    if isinstance(mark, (fig.Line, fig.Points, fig.Area)):
        return np.asarray(getattr(mark, side), dtype=float)
    return np.empty(0)
