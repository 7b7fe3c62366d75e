"""Figures of a spin run: envelopes, gasket forces, orbits and gaps."""

from collections.abc import Mapping, Sequence
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
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number, shape_name
from wm_drake.report.spin.cases import case_title, speed_rpm
from wm_drake.simulation.measures import axis_motion, envelopes, moment_of_largest_amplitude
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.records import Record
from wm_drake.studies.spin.study import CaseResult

IndexArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.intp]]
BoolArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

DASHED: dict[str, Any] = {"color": MEASURED, "linewidth": 1.3, "linestyle": (0, (5, 2.5))}
"""Line style of measured amplitudes."""

COLUMNS = 3
"""Number of panels in a row, one for each of the axes x, y and z."""

ORBIT_REVOLUTIONS = 6.0
"""Number of drum revolutions that an orbit shows, with the largest amplitude in the middle."""

FEWEST_REVOLUTIONS = 20
"""Smallest number of revolutions in a record for which extremes per revolution are drawn."""

LONGEST_ORBIT = 8.0
"""Longest time that an orbit shows; it matters for a drum that hardly turns. [s]"""


def envelopes_figure(record: Record, measured_mm: Mapping[str, float] | None = None) -> Figure:
    """Draw the envelopes of the filtered displacement over time, one panel per sensor.

    The drum speed is given along the top.

    Args:
        record: A record that is long enough for the filter.
        measured_mm: Measured amplitude A by sensor, drawn as dashed lines at +-A. [mm]
    """
    band = envelopes(record) * MM_PER_M
    sensors = [str(name) for name in record.sensor.values]
    rows = -(-len(sensors) // COLUMNS)
    figure, panels = _panels(record, len(sensors), ["displacement, mm"] * rows)
    largest = np.abs([band.lower.values, band.upper.values]).max()
    _set_limits(panels, max([largest, *(measured_mm or {}).values()]))
    for axes, name in zip(panels, sensors, strict=True):
        lower, upper = band.lower.sel(sensor=name).values, band.upper.sel(sensor=name).values
        _band(axes, record.time.values, lower, upper)
        _mark_largest(
            axes, record, name, np.where(np.abs(lower) > np.abs(upper), lower, upper), "mm"
        )
        if measured_mm is not None:
            for side in (-1.0, 1.0):
                axes.axhline(side * measured_mm[name], **DASHED)
    handles = [_band_handle("wm_drake, lower to upper envelope"), _largest_handle()]
    _legend(
        figure,
        [*handles, Line2D([], [], label="experiment, ± amplitude", **DASHED)]
        if measured_mm
        else handles,
    )
    return figure


def gasket_figure(record: Record) -> Figure:
    """Draw force (upper row) and moment (lower row) of the gasket on the housing over time.

    A band shows the smallest to the largest value in each drum revolution.

    Args:
        record: A record of a run with gasket.
    """
    figure, panels = _panels(record, 2 * COLUMNS, ["force, N", "moment, N m"])
    starts = revolution_starts(record)
    time = record.time.values
    middle = 0.5 * (time[starts] + np.append(time[starts[1:]], time[-1]))
    rows = {
        "F": (record.bushing_force, "N", panels[:COLUMNS]),
        "M": (record.bushing_moment, "N m", panels[COLUMNS:]),
    }
    for letter, (variable, unit, row) in rows.items():
        gasket = variable.sel(bushing="gasket")
        _set_limits(row, float(np.abs(gasket).max()))
        for axes, axis in zip(row, map(str, record.axis.values), strict=True):
            values = gasket.sel(axis=axis).values
            lower, upper = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
            _band(axes, *_extended_to_ends(time, middle, lower, upper))
            _mark_largest(axes, record, f"{letter}{axis}", values, unit)
    _legend(
        figure,
        [
            _band_handle("wm_drake, smallest to largest value in each drum revolution"),
            _largest_handle(),
        ],
    )
    return figure


def orbits_figure(record: Record, y_front: float, y_rear: float) -> Figure:
    """Draw the paths of two points of the drum axis in the x-z plane, seen from the front.

    The paths cover the drum revolutions around the largest amplitude of all sensors.

    Args:
        record: A record with at least two samples.
        y_front: Position of the front point on the drum axis, < 0 in front of mid-depth. [m]
        y_rear: Position of the rear point on the drum axis. [m]
    """
    paths = [axis_path_mm(record, y) for y in (y_front, y_rear)]
    largest = moment_of_largest_amplitude(record)
    window = orbit_window(record, largest, ORBIT_REVOLUTIONS)
    x_limit, z_limit = orbit_limits([path[window] for path in paths])
    height = 4.6 * z_limit / x_limit + 1.3
    figure = Figure(figsize=(WIDTH, height))
    figure.subplots_adjust(
        left=0.07, right=0.985, top=1.0 - 0.35 / height, bottom=0.95 / height, wspace=0.14
    )
    for axes, path, title in zip(
        figure.subplots(1, 2), paths, _depths(y_front, y_rear), strict=True
    ):
        _orbit(axes, path, window, orbit_window(record, largest, 1.0), largest)
        axes.set(aspect="equal", xlim=(-x_limit, x_limit), ylim=(-z_limit, z_limit))
        axes.set_xlabel("x, to the right, mm", fontsize=9.5)
        axes.set_ylabel("z, up, mm", fontsize=9.5)
        axes.set_title(title, fontsize=10.5, loc="left", fontweight="bold")
    speed = record.drum_speed.values[largest] * RPM_PER_RAD_S
    moment = f"largest amplitude: {record.time.values[largest]:.2f} s, {number(speed, 0)} rpm"
    _legend(figure, _orbit_handles(record.time.values[window], moment))
    return figure


def gaps_figure(results: Sequence[CaseResult]) -> Figure:
    """Draw the smallest gap between tub and housing, one line per case.

    The text at each line gives the two parts and the drum speed at which the gap occurs.

    Args:
        results: Cases, each with a smallest gap.
    """
    figure = Figure(figsize=(WIDTH, 0.75 + 0.42 * len(results)), layout="constrained")
    axes = figure.subplots()
    gaps = [gap for gap in (result.measures.smallest_gap for result in results) if gap is not None]
    distances = [MM_PER_M * gap.distance for gap in gaps]
    low, high = min(0.0, *distances), max(0.0, *distances)
    span = (high - low) or 1.0
    for place, (result, gap, distance) in enumerate(zip(results, gaps, distances, strict=True)):
        colour = MEASURED if distance <= 0.0 else OURS
        axes.plot(
            [0.0, distance], [place, place], color=colour, linewidth=2.5, solid_capstyle="butt"
        )
        axes.plot(distance, place, "o", color=colour, markersize=8)
        speed = number(speed_rpm(result, gap.time), 0)
        parts = f"{shape_name(gap.moving)} to {shape_name(gap.fixed)}"
        text = f"{number(distance)} mm   {parts}, {speed} rpm"
        axes.text(
            max(distance, 0.0) + 0.025 * span,
            place,
            text,
            va="center",
            fontsize=9.5,
            parse_math=False,
        )
    axes.axvline(0.0, color=MARK, linewidth=1.0)
    axes.set_yticks(
        range(len(results)), [case_title(result) for result in results], parse_math=False
    )
    axes.set_xticks(
        [
            tick
            for tick in MaxNLocator(6).tick_values(low, high)
            if low - 0.1 * span <= tick <= high + 0.1 * span
        ]
    )
    axes.set(xlim=(low - 0.02 * span, high + 0.9 * span), ylim=(len(results) - 0.4, -0.6))
    axes.set_xlabel("smallest gap, mm (0: the parts touch)", fontsize=9.5, loc="left")
    axes.grid(axis="x", color=GRID)
    style_axes(axes)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    return figure


def axis_path_mm(record: Record, y: float) -> FloatArray:
    """Return the displacement from rest of the drum-axis point at depth y. (n, 3) [mm]"""
    at_rest = point_positions(
        np.asarray(record.attrs["rest_pose"])[None, :], np.array([[0.0, y, 0.0]])
    )[:, 0]
    return (axis_motion(record, y) - at_rest) * MM_PER_M


def orbit_window(record: Record, index: int, revolutions: float) -> BoolArray:
    """Return which samples (n,) an orbit shows.

    These are the samples within the given number of drum revolutions around the sample `index`, but
    not beyond the longest time of an orbit.
    """
    turned = np.abs(record.drum_angle.values - record.drum_angle.values[index])
    passed = np.abs(record.time.values - record.time.values[index])
    return np.asarray((turned <= np.pi * revolutions) & (passed <= 0.5 * LONGEST_ORBIT))


def orbit_limits(paths: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the half widths in x and z of a frame around all paths, in the unit of the paths.

    The frame is at most as high as it is wide, and its height is at least 0.4 of its width.
    """
    x_size, z_size = (
        1.1 * max(float(np.abs(path[:, column]).max()) for path in paths) for column in (0, 2)
    )
    x_limit = max(x_size, z_size) or 1.0
    return x_limit, max(z_size, 0.4 * x_limit)


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


def _depths(y_front: float, y_rear: float) -> list[str]:
    return [
        f"{where}, y = {number(y * MM_PER_M, 0)} mm"
        for where, y in (("front", y_front), ("rear", y_rear))
    ]


def _orbit(axes: Axes, path: FloatArray, window: BoolArray, turn: BoolArray, largest: int) -> None:
    axes.plot(path[window, 0], path[window, 2], color=OURS, alpha=0.4, linewidth=0.9)
    axes.plot(path[turn, 0], path[turn, 2], color=OURS, linewidth=2.0)
    axes.plot(0.0, 0.0, "+", color=QUIET, markersize=10)
    axes.plot(path[largest, 0], path[largest, 2], "o", color=MARK, markersize=5)
    axes.grid(color=GRID)
    style_axes(axes)


def _panels(record: Record, count: int, labels: Sequence[str]) -> tuple[Figure, list[Axes]]:
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


def _set_limits(panels: Sequence[Axes], largest: float) -> None:
    """Set ordinates that are symmetric about zero, with room for text at the top."""
    limit = 1.45 * largest or 1.0
    for axes in panels:
        axes.set_ylim(-limit, limit)


def _band(axes: Axes, time: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
    tolerance = 1e-3 * axes.get_ylim()[1]
    kept = [simplified_indices(time, line, tolerance) for line in (lower, upper)]
    both = np.union1d(*kept)
    axes.fill_between(
        time[both], lower[both], upper[both], facecolor=OURS, alpha=0.22, linewidth=0.0
    )
    for line, own in zip((lower, upper), kept, strict=True):
        axes.plot(time[own], line[own], color=OURS, linewidth=1.0)


def _extended_to_ends(time: FloatArray, middle: FloatArray, *lines: FloatArray) -> list[FloatArray]:
    """Extend lines over mid-revolution times to both ends of the record with their end values."""
    extended = [np.concatenate([line[:1], line, line[-1:]]) for line in lines]
    return [np.concatenate([time[:1], middle, time[-1:]]), *extended]


def _mark_largest(axes: Axes, record: Record, name: str, values: FloatArray, unit: str) -> None:
    """Mark the largest absolute value with a dot, and write it with its drum speed at the top."""
    index = int(np.argmax(np.abs(values)))
    axes.plot(record.time.values[index], values[index], "o", color=MARK, markersize=4.5, zorder=4)
    speed = record.drum_speed.values[index] * RPM_PER_RAD_S
    text = f"{number(abs(values[index]))} {unit} at {number(speed, 0)} rpm"
    place: dict[str, Any] = {"transform": axes.transAxes, "va": "top"}
    axes.text(0.02, 0.965, name, fontweight="bold", fontsize=10.5, parse_math=False, **place)
    axes.text(0.985, 0.96, text, ha="right", fontsize=9, **place)


def _band_handle(label: str) -> Artist:
    return Patch(facecolor=to_rgba(OURS, 0.22), edgecolor=OURS, label=label)


def _largest_handle() -> Artist:
    return Line2D(
        [],
        [],
        color=MARK,
        marker="o",
        markersize=4.5,
        linestyle="none",
        label="largest absolute value",
    )


def _orbit_handles(window: FloatArray, moment: str) -> list[Artist]:
    return [
        Line2D([], [], color=MARK, marker="o", markersize=5, linestyle="none", label=moment),
        Line2D([], [], color=OURS, linewidth=2.0, label="revolution around it"),
        Line2D(
            [],
            [],
            color=OURS,
            alpha=0.4,
            linewidth=0.9,
            label=f"{window[0]:.1f} s to {window[-1]:.1f} s",
        ),
        Line2D(
            [], [], color=QUIET, marker="+", markersize=10, linestyle="none", label="rest position"
        ),
    ]


def _legend(figure: Figure, handles: Sequence[Artist]) -> None:
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=len(handles),
        frameon=False,
        fontsize=9.5,
        borderaxespad=0.2,
    )
