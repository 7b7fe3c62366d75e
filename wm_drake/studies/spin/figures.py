"""Figures of a spin run: envelopes, gasket forces, orbits and gaps."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters.types import BoolArray, FloatArray, IndexArray
from wm_drake.report import figure as fig
from wm_drake.report.quantity import SPEED, TIME, Quantity, shown
from wm_drake.simulation.displacements import (
    ORBIT_REVOLUTIONS,
    axis_motion,
    envelopes,
    have_one_orbit,
    moment_of_largest_amplitude,
    orbit_window,
)
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.records import Record, rest_pose_of
from wm_drake.studies.spin.data import DISPLACEMENT, FORCE, MOMENT, PLACE
from wm_drake.studies.spin.study import GAP


def envelopes_figure(record: Record, measured: xr.DataArray | None = None) -> fig.Figure:
    """Return the envelopes of the filtered displacement over time, one panel per sensor.

    The drum speed is given along the top.

    Args:
        record: A record that is long enough for the filter.
        measured: Measured amplitude A (sensor), drawn as dashed lines at +-A. [m]
    """
    band = envelopes(record)
    sizes = [abs(side).max() for side in (band.lower, band.upper)]
    largest = max([*sizes, *([] if measured is None else [measured.max()])])
    limits = symmetric_limits(float(DISPLACEMENT.values(largest)))
    panels = []
    for name in map(str, record.sensor.values):
        marks = envelope_marks(record, band.sel(sensor=name), limits[1])
        if measured is not None:
            marks[1:1] = experiment_rules(measured.sel(sensor=name))
        panels.append(time_panel(record, name, marks, DISPLACEMENT.label, limits))
    return time_figure(panels)


def envelope_marks(
    record: Record,
    band: xr.Dataset,
    limit: float,
    key: str = "wm_drake, lower to upper envelope",
    style: tuple[str, int] = ("", 0),
) -> list[fig.Mark]:
    """Return the area between the envelopes of a sensor, and its largest value.

    Args:
        band: Envelopes `lower` and `upper` (time). [m]
        limit: Upper end of the vertical axis, in the unit for reading.
        style: Colour, and line of text at the top of the panel; "" for the usual colours.
    """
    lower, upper = DISPLACEMENT.values(band.lower), DISPLACEMENT.values(band.upper)
    farther = np.where(np.abs(band.lower) > np.abs(band.upper), band.lower, band.upper)
    color, line = style
    return [
        time_band((record.time.values, lower, upper), limit, key, color or fig.OURS),
        *largest_marks(record, farther, DISPLACEMENT, color or fig.MARK, line),
    ]


def experiment_rules(amplitude: xr.DataArray, color: str = fig.MEASURED) -> list[fig.Mark]:
    """Return lines at both sides of zero at a measured amplitude."""
    key, size = "experiment, ± amplitude", float(shown(amplitude))
    return [
        fig.Rule(side, color=color, width=1.6, dash="dashed", key=key) for side in (-size, size)
    ]


def gasket_figure(record: Record) -> fig.Figure:
    """Return force (upper row) and moment (lower row) of the gasket on the housing over time.

    A band shows the smallest to the largest value in each drum revolution.
    """
    panels = []
    for letter, variable, quantity in (
        ("F", record.bushing_force, FORCE),
        ("M", record.bushing_moment, MOMENT),
    ):
        gasket = variable.sel(bushing="gasket")
        limits = symmetric_limits(float(quantity.values(np.abs(gasket).max())))
        for axis in map(str, record.axis.values):
            values = gasket.sel(axis=axis).values
            marks = revolution_marks(record, values, quantity, limits[1])
            panels.append(time_panel(record, f"{letter}{axis}", marks, quantity.label, limits))
    return time_figure(panels)


def orbits_figure(record: Record, y_front: float, y_rear: float) -> fig.Figure:
    """Return the paths of two points of the drum axis in the x-z plane, seen from the front.

    The paths cover the drum revolutions around the largest amplitude of all sensors. Points less
    than half a millimetre apart have one path.

    Args:
        record: A record with at least two samples.
        y_front: Position of the front point on the drum axis, < 0 in front of mid-depth. [m]
        y_rear: Position of the rear point on the drum axis. [m]
    """
    titles = _depths(y_front, y_rear)
    paths = [DISPLACEMENT.values(axis_path(record, y)) for y in (y_front, y_rear)[: len(titles)]]
    largest = moment_of_largest_amplitude(record)
    moments, angle = record.time.values, record.drum_angle.values
    windows = [orbit_window(moments, angle, largest, turns) for turns in (ORBIT_REVOLUTIONS, 1.0)]
    x_limit, z_limit = orbit_limits([path[windows[0]] for path in paths])
    x = fig.Axis(label=DISPLACEMENT.named("x, to the right").label, range=(-x_limit, x_limit))
    z = fig.Axis(label=DISPLACEMENT.named("z, up").label, range=(-z_limit, z_limit))
    speed = SPEED.text(record.drum_speed.values[largest])
    moment = f"largest amplitude: {TIME.text(moments[largest])}, {speed}"
    time = moments[windows[0]]
    keys = (f"{time[0]:.1f} s to {time[-1]:.1f} s", "revolution around it", moment)
    panels = [
        fig.Panel(title=title, marks=_orbit(path, windows, largest, keys), x=x, y=z, is_square=True)
        for path, title in zip(paths, titles, strict=True)
    ]
    keys_shown = (*keys[::-1], "rest position")
    return fig.Figure(
        panels=fig.in_grid(panels, 2), height=455.0 * z_limit / x_limit, keys=keys_shown
    )


def gaps_figure(gaps: xr.Dataset) -> fig.Figure:
    """Return the smallest gap between tub and housing, one line per load.

    The text at each line gives the two parts and the drum speed at which the gap occurs.

    Args:
        gaps: As of `gaps_of` in `wm_drake.studies.spin.data`.
    """
    distances = GAP.values(gaps.smallest_gap)
    low, high = min(0.0, *distances), max(0.0, *distances)
    span = (high - low) or 1.0
    marks: list[fig.Mark] = []
    for place, distance in enumerate(distances.tolist()):
        gap, color = gaps.isel(load=place), fig.MEASURED if distance <= 0.0 else fig.OURS
        marks.append(fig.Line([0.0, distance], [place, place], color=color, width=4.0))
        marks.append(fig.Points([distance], [place], color=color, size=10.0))
        text = (
            f"{GAP.text(gap.smallest_gap)} at {SPEED.text(gap.speed)}\n"
            f"{gap.moving_part.item()} to {gap.part_of_the_housing.item()}"
        )
        marks.append(fig.Text(max(distance, 0.0), place, text, across="left", shift=(14.0, 0.0)))
    marks.append(fig.Rule(0.0, "y", color=fig.MARK))
    x = fig.Axis(
        label=f"{GAP.label} (0: the parts touch)", range=(low - 0.02 * span, high + 1.1 * span)
    )
    y = fig.Axis(
        ticks=fig.named(gaps["load"].values.tolist()),
        range=(len(distances) - 0.4, -0.6),
        has_grid=False,
        has_line=False,
    )
    height = 50.0 * len(distances)
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=height)


def axis_path(record: Record, y: float) -> FloatArray:
    """Return the displacement from rest of the drum-axis point at depth y. (n, 3) [m]"""
    at_rest = point_positions(rest_pose_of(record)[None, :], np.array([[0.0, y, 0.0]]))[:, 0]
    return axis_motion(record, y) - at_rest


def orbit_limits(paths: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the half widths in x and z of a frame around all paths, in the unit of the paths.

    The frame is at most as high as it is wide, and its height is at least 0.4 of its width.
    """
    x_size, z_size = (
        1.1 * max(float(np.abs(path[:, column]).max()) for path in paths) for column in (0, 2)
    )
    x_limit = max(x_size, z_size) or 1.0
    return x_limit, max(z_size, 0.4 * x_limit)


def _depths(y_front: float, y_rear: float) -> list[str]:
    """Return a title for each orbit that is drawn."""
    if have_one_orbit(y_front, y_rear):
        return [f"y = {PLACE.text(y_front)}"]
    return [f"{where}, y = {PLACE.text(y)}" for where, y in (("front", y_front), ("rear", y_rear))]


def _orbit(
    path: FloatArray, windows: Sequence[BoolArray], largest: int, keys: tuple[str, str, str]
) -> tuple[fig.Mark, ...]:
    """Return the path in a long and a short window, the rest position and the largest amplitude."""
    x, _, z = path.T
    long, short = windows
    at = slice(largest, largest + 1)
    return (
        fig.Line(x[long], z[long], opacity=0.4, width=1.2, key=keys[0]),
        fig.Line(x[short], z[short], width=2.6, key=keys[1]),
        fig.Points(
            [0.0], [0.0], symbol="cross-thin", color=fig.QUIET, size=12.0, key="rest position"
        ),
        fig.Points(x[at], z[at], color=fig.MARK, key=keys[2]),
    )


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
        x=fig.Axis(label=TIME.label, range=(0.0, end)),
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
    speeds = np.interp(times, record.time.values, record.drum_speed.values)
    return fig.Axis(label=SPEED.label, ticks=fig.named(map(SPEED.number, speeds), times))


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


def revolution_marks(
    record: Record, values: FloatArray, quantity: Quantity, limit: float
) -> list[fig.Mark]:
    """Return a band of smallest and largest values in each revolution, and the largest value.

    Args:
        values: Signal (n,). [SI]
        limit: Upper end of the vertical axis, in the unit for reading.
    """
    time, lower, upper = revolution_band(record, values)
    sides = time, quantity.values(lower), quantity.values(upper)
    return [time_band(sides, limit, IN_REVOLUTIONS), *largest_marks(record, values, quantity)]


def largest_marks(
    record: Record, values: FloatArray, quantity: Quantity, color: str = fig.MARK, line: int = 0
) -> list[fig.Mark]:
    """Return a dot at the largest absolute value, and that value with its drum speed at the top.

    Args:
        values: Signal (n,). [SI]
        line: Number of the line of text, counted from the top of the panel.
    """
    index = int(np.argmax(np.abs(values)))
    size = Quantity("", quantity.unit, 1).text(abs(values[index]))
    text = f"{size} at {SPEED.text(record.drum_speed.values[index])}"
    at = {"in_data": (False, False), "across": "right", "up": "top"}
    y = quantity.values(values[index : index + 1])
    dot = fig.Points(record.time.values[index : index + 1], y, color=color)
    return [
        replace(dot, key=LARGEST, size=6.5),
        fig.Text(0.985, 0.965, text, color=color, shift=(0.0, -15.0 * line), **at),  # type: ignore[arg-type]
    ]
