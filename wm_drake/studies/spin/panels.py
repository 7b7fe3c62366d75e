"""Panels over time that the figures of a spin page share: axes, bands and marks."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import RPM_PER_RAD_S, number
from wm_drake.simulation.records import Record

IndexArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.intp]]

COLUMNS = 3
"""Number of panels in a row, one for each of the axes x, y and z."""

LARGEST = "largest absolute value"
"""Entry of the legend of the dots at largest values."""

IN_REVOLUTIONS = "wm_drake, smallest to largest value in each drum revolution"
"""Entry of the legend of bands of `revolution_band`."""

LONGEST_LINE = 28
"""Number of characters from which on a name and a text at the top of a panel take two lines."""

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
        slope = (y[last] - y[first]) / ((x[last] - x[first]) or 1.0)
        error = np.abs(y[piece] - (slope * (x[piece] - x[first]) + y[first]))
        worst = first + int(error.argmax())
        if first < worst < last and error[worst - first] > tolerance:
            kept.add(worst)
            pieces += [(first, worst), (worst, last)]
    return np.array(sorted(kept))


def time_figure(panels: Sequence[fig.Panel | None]) -> fig.Figure:
    """Return a figure of panels over time, three in a row."""
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="x and rows"), height=180.0)


def time_panel(
    record: Record, name: str, marks: Sequence[fig.Mark], label: str, limits: tuple[float, float]
) -> fig.Panel:
    """Return a panel over time, with the drum speed along the top."""
    end = float(record.time[-1])
    marks = _lowered(name, marks)
    at = {"in_data": (False, False), "across": "left", "up": "top", "is_bold": True}
    title = fig.Text(0.02, 0.975, name, size=fig.TITLE, **at)  # type: ignore[arg-type]
    return fig.Panel(
        name=name,
        marks=(fig.Rule(0.0, color=fig.QUIET, width=0.8), *marks, title),
        x=fig.Axis(label="time, s", range=(0.0, end)),
        y=fig.Axis(label=label, range=limits),
        top=speed_axis(record),
    )


def _lowered(name: str, marks: Sequence[fig.Mark]) -> list[fig.Mark]:
    """Return marks with the texts at the top right lower if the name reaches to them."""
    longest = max((len(mark.text) for mark in marks if isinstance(mark, fig.Text)), default=0)
    if not longest or len(name) + longest < LONGEST_LINE:
        return list(marks)
    down = -15.0
    return [
        replace(mark, shift=(mark.shift[0], mark.shift[1] + down))
        if isinstance(mark, fig.Text)
        else mark
        for mark in marks
    ]


def speed_axis(record: Record) -> fig.Axis:
    """Return an axis that gives the drum speed at round times, for any spin profile."""
    times = fig.round_numbers(0.0, float(record.time[-1]), 7)
    speeds = np.interp(times, record.time.values, record.drum_speed.values) * RPM_PER_RAD_S
    ticks = fig.named((number(speed, 0) for speed in speeds), times)
    return fig.Axis(label="drum speed, rpm", ticks=ticks)


def symmetric_limits(largest: float, lines: int = 1) -> tuple[float, float]:
    """Return limits that are symmetric about zero, with room for lines of text at the top."""
    limit = (1.3 + 0.15 * lines) * largest or 1.0
    return -limit, limit


def time_band(
    sides: tuple[FloatArray, FloatArray, FloatArray], limit: float, key: str, color: str = fig.OURS
) -> fig.Area:
    """Return the area between two lines over time, with as few points as are needed.

    Args:
        sides: Times (n,), lower and upper values (n,).
        limit: Upper end of the vertical axis, which says how fine the lines are seen.
    """
    time, *lines = sides
    kept = [simplified_indices(time, line, 1e-3 * limit) for line in lines]
    both = np.union1d(*kept)
    return fig.band(time[both], lines[0][both], lines[1][both], color=color, edge=color, key=key)


def revolution_band(
    record: Record, values: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times and the smallest and the largest value of a signal in each drum revolution.

    The first and the last value reach to the ends of the record.
    """
    starts, time = revolution_starts(record), record.time.values
    middle = 0.5 * (time[starts] + np.append(time[starts[1:]], time[-1]))
    lower, upper = (
        np.concatenate([line[:1], line, line[-1:]])
        for line in (np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts))
    )
    return np.concatenate([time[:1], middle, time[-1:]]), lower, upper


def largest_marks(
    record: Record, values: FloatArray, unit: str, color: str = fig.MARK, line: int = 0
) -> list[fig.Mark]:
    """Return a dot at the largest absolute value, and that value with its drum speed at the top.

    Args:
        line: Number of the line of text, counted from the top of the panel.
    """
    index = int(np.argmax(np.abs(values)))
    speed = record.drum_speed.values[index] * RPM_PER_RAD_S
    text = f"{number(abs(values[index]))} {unit} at {number(speed, 0)} rpm"
    at = {"in_data": (False, False), "across": "right", "up": "top"}
    dot = fig.Points(record.time.values[index : index + 1], values[index : index + 1], color=color)
    return [
        replace(dot, key=LARGEST, size=6.5),
        fig.Text(0.985, 0.965, text, color=color, shift=(0.0, -15.0 * line), **at),  # type: ignore[arg-type]
    ]
