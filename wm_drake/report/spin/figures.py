"""Figures of a spin run: envelopes, gasket forces, orbits and gaps."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number, shape_name
from wm_drake.report.spin.cases import case_title, speed_rpm
from wm_drake.report.spin.panels import (
    COLUMNS,
    band_handle,
    draw_band,
    largest_handle,
    legend_below,
    mark_largest,
    revolution_band,
    set_symmetric_limits,
    time_panels,
)
from wm_drake.simulation.measures import axis_motion, envelopes, moment_of_largest_amplitude
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.records import Record
from wm_drake.studies.spin.study import CaseResult

BoolArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

DASHED: dict[str, Any] = {"color": MEASURED, "linewidth": 1.3, "linestyle": (0, (5, 2.5))}
"""Line style of measured amplitudes."""

ORBIT_REVOLUTIONS = 6.0
"""Number of drum revolutions that an orbit shows, with the largest amplitude in the middle."""

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
    figure, panels = time_panels(record, len(sensors), ["displacement, mm"] * rows)
    largest = np.abs([band.lower.values, band.upper.values]).max()
    set_symmetric_limits(panels, max([largest, *(measured_mm or {}).values()]))
    for axes, name in zip(panels, sensors, strict=True):
        lower, upper = band.lower.sel(sensor=name).values, band.upper.sel(sensor=name).values
        draw_band(axes, record.time.values, lower, upper)
        mark_largest(
            axes, record, name, np.where(np.abs(lower) > np.abs(upper), lower, upper), "mm"
        )
        if measured_mm is not None:
            for side in (-1.0, 1.0):
                axes.axhline(side * measured_mm[name], **DASHED)
    handles = [band_handle("wm_drake, lower to upper envelope"), largest_handle()]
    legend_below(
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
    figure, panels = time_panels(record, 2 * COLUMNS, ["force, N", "moment, N m"])
    rows = {
        "F": (record.bushing_force, "N", panels[:COLUMNS]),
        "M": (record.bushing_moment, "N m", panels[COLUMNS:]),
    }
    for letter, (variable, unit, row) in rows.items():
        gasket = variable.sel(bushing="gasket")
        set_symmetric_limits(row, float(np.abs(gasket).max()))
        for axes, axis in zip(row, map(str, record.axis.values), strict=True):
            values = gasket.sel(axis=axis).values
            draw_band(axes, *revolution_band(record, values))
            mark_largest(axes, record, f"{letter}{axis}", values, unit)
    legend_below(
        figure,
        [
            band_handle("wm_drake, smallest to largest value in each drum revolution"),
            largest_handle(),
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
    legend_below(figure, _orbit_handles(record.time.values[window], moment))
    return figure


def gaps_figure(results: Sequence[CaseResult]) -> Figure:
    """Draw the smallest gap between tub and housing, one line per case.

    The text at each line gives the two parts and the drum speed at which the gap occurs.

    Args:
        results: Cases, each with a smallest gap.
    """
    figure = Figure(figsize=(WIDTH, 0.75 + 0.5 * len(results)), layout="constrained")
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
        text = f"{number(distance)} mm at {speed} rpm\n{parts}"
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
    axes.set(xlim=(low - 0.02 * span, high + 1.1 * span), ylim=(len(results) - 0.4, -0.6))
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
