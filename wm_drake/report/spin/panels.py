"""Panels over time that the figures of a spin page share: axes, bands, marks and legends."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import RPM_PER_RAD_S, number
from wm_drake.simulation.records import Record

IndexArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.intp]]

COLUMNS = 3
"""Number of panels in a row, one for each of the axes x, y and z."""

LONGEST_LEGEND = 140
"""Largest number of characters of a legend in one line."""

FEWEST_REVOLUTIONS = 20
"""Smallest number of revolutions in a record for which extremes per revolution are drawn."""


def revolution_starts(record: Record) -> IndexArray:
    """Return the index of the first sample of each full drum revolution.

    If the drum makes too few revolutions, every sample counts as a revolution of its own.
    """
    angle = record.drum_angle.values
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))])
    starts = np.unique(np.floor(turned / (2.0 * np.pi)), return_index=True)[1]
    return starts[:-1] if len(starts) > FEWEST_REVOLUTIONS else np.arange(len(angle))


def simplified_indices(x: FloatArray, y: FloatArray, tolerance: float) -> IndexArray:
    """Return the indices of the points that are enough to draw a line (Douglas-Peucker method).

    Straight pieces between the kept points differ from the line by at most the tolerance.

    Args:
        x: Rising abscissae (n,).
        y: Ordinates (n,).
        tolerance: Largest difference, in the unit of y.
    """
    kept, pieces = {0, len(x) - 1}, [(0, len(x) - 1)]
    while pieces:
        first, last = pieces.pop()
        piece = slice(first, last + 1)
        error = np.abs(y[piece] - np.interp(x[piece], x[[first, last]], y[[first, last]]))
        worst = first + int(np.argmax(error))
        if first < worst < last and error[worst - first] > tolerance:
            kept.add(worst)
            pieces += [(first, worst), (worst, last)]
    return np.array(sorted(kept))


def time_panels(record: Record, count: int, labels: Sequence[str]) -> tuple[Figure, list[Axes]]:
    """Make panels over time, with a common scale and label per row and the drum speed at the top.

    Args:
        record: Record that gives the time range and the drum speed.
        count: Number of panels.
        labels: Label of the vertical axis of each row.
    """
    rows, end = len(labels), float(record.time[-1])
    height = 2.05 * rows + 1.4
    figure = Figure(figsize=(WIDTH, height))
    figure.subplots_adjust(
        left=0.065,
        right=0.985,
        top=1.0 - 0.55 / height,
        bottom=0.9 / height,
        wspace=0.1,
        hspace=0.12,
    )
    panels: list[Axes] = list(
        figure.subplots(rows, COLUMNS, sharex=True, sharey="row", squeeze=False).flat
    )
    ticks = np.array([tick for tick in MaxNLocator(7).tick_values(0.0, end) if 0.0 <= tick <= end])
    panels[0].set(xlim=(0.0, end), xticks=ticks)
    for index, axes in enumerate(panels):
        axes.set_visible(index < count)
        axes.grid(color=GRID)
        axes.axhline(0.0, color=QUIET, linewidth=0.6)
        style_axes(axes)
        if index < COLUMNS:
            _speed_axis(axes, record, ticks)
        if index + COLUMNS >= count:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("time, s", fontsize=9.5)
        if index % COLUMNS == 0:
            axes.set_ylabel(labels[index // COLUMNS], fontsize=9.5)
    return figure, panels[:count]


def _speed_axis(axes: Axes, record: Record, ticks: FloatArray) -> None:
    """Label the time ticks along the top with the drum speed, for any spin profile."""
    speeds = np.interp(ticks, record.time.values, record.drum_speed.values) * RPM_PER_RAD_S
    top = axes.secondary_xaxis("top")
    top.set_xticks(ticks, [number(speed, 0) for speed in speeds])
    top.tick_params(labelsize=9, colors=QUIET)
    top.set_xlabel("drum speed, rpm", fontsize=9.5, color=QUIET)
    top.spines["top"].set_color(QUIET)


def set_symmetric_limits(panels: Sequence[Axes], largest: float, lines: int = 1) -> None:
    """Set ordinates that are symmetric about zero, with room for lines of text at the top."""
    limit = (1.3 + 0.15 * lines) * largest or 1.0
    for axes in panels:
        axes.set_ylim(-limit, limit)


def draw_band(
    axes: Axes, time: FloatArray, lower: FloatArray, upper: FloatArray, color: str = OURS
) -> None:
    """Draw two lines over time and shade the area between them."""
    tolerance = 1e-3 * axes.get_ylim()[1]
    kept = [simplified_indices(time, line, tolerance) for line in (lower, upper)]
    both = np.union1d(*kept)
    axes.fill_between(
        time[both], lower[both], upper[both], facecolor=color, alpha=0.22, linewidth=0.0
    )
    for line, own in zip((lower, upper), kept, strict=True):
        axes.plot(time[own], line[own], color=color, linewidth=1.0)


def revolution_band(
    record: Record, values: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times and the smallest and the largest value of a signal in each drum revolution.

    The first and the last value reach to the ends of the record.

    Args:
        record: A record with at least one sample.
        values: (n,) the signal.
    """
    starts, time = revolution_starts(record), record.time.values
    middle = 0.5 * (time[starts] + np.append(time[starts[1:]], time[-1]))
    lower, upper = (
        np.concatenate([line[:1], line, line[-1:]])
        for line in (np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts))
    )
    return np.concatenate([time[:1], middle, time[-1:]]), lower, upper


def name_panel(axes: Axes, name: str) -> None:
    """Write the name of a panel at its top left."""
    place: dict[str, Any] = {"transform": axes.transAxes, "va": "top"}
    axes.text(0.02, 0.965, name, fontweight="bold", fontsize=10.5, parse_math=False, **place)


def mark_largest(
    axes: Axes,
    record: Record,
    name: str,
    values: FloatArray,
    unit: str,
    *,
    color: str = MARK,
    line: int = 0,
) -> None:
    """Mark the largest absolute value with a dot, and write it with its drum speed at the top.

    Args:
        axes: The panel.
        record: Record that gives time and drum speed.
        name: Name of the panel; empty if it is written already.
        values: (n,) the signal.
        unit: Unit of the signal.
        color: Colour of the dot and, except for the first colour of marks, of the text.
        line: Number of the line of text, counted from the top of the panel.
    """
    index = int(np.argmax(np.abs(values)))
    axes.plot(record.time.values[index], values[index], "o", color=color, markersize=4.5, zorder=4)
    speed = record.drum_speed.values[index] * RPM_PER_RAD_S
    text = f"{number(abs(values[index]))} {unit} at {number(speed, 0)} rpm"
    if name:
        name_panel(axes, name)
    axes.annotate(
        text,
        (0.985, 0.96),
        (0.0, -11.0 * line),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=9,
        color=color,
    )


def band_handle(label: str, color: str = OURS) -> Artist:
    """Return the sample of a band for a legend; matplotlib hides labels that begin with `_`."""
    label = f" {label}" if label.startswith("_") else label
    return Patch(facecolor=to_rgba(color, 0.22), edgecolor=color, label=label)


def largest_handle(color: str = MARK) -> Artist:
    """Return the sample of the dot at the largest absolute value for a legend."""
    return Line2D(
        [],
        [],
        color=color,
        marker="o",
        markersize=4.5,
        linestyle="none",
        label="largest absolute value",
    )


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put a legend in one line below the panels, in two lines if it is long."""
    words = sum(len(str(handle.get_label())) + 6 for handle in handles)
    legend = figure.legend(
        handles=handles,
        loc="lower center",
        ncols=len(handles) if words < LONGEST_LEGEND else -(-len(handles) // 2),
        frameon=False,
        fontsize=9.5,
        borderaxespad=0.2,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)
