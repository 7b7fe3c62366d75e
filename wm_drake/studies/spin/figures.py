"""Figures of a spin run: envelopes, gasket forces, orbits and gaps."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number, shape_name
from wm_drake.simulation.displacements import axis_motion, envelopes, moment_of_largest_amplitude
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.records import Record
from wm_drake.studies.spin.panels import (
    IN_REVOLUTIONS,
    largest_marks,
    revolution_band,
    symmetric_limits,
    time_band,
    time_figure,
    time_panel,
)
from wm_drake.studies.spin.study import CaseResult

BoolArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

ORBIT_REVOLUTIONS = 6.0
"""Number of drum revolutions that an orbit shows, with the largest amplitude in the middle."""

SAME_PLANE = 0.5e-3
"""Distance below which the planes of two sensors have one orbit. [m]"""

LONGEST_ORBIT = 8.0
"""Longest time that an orbit shows; it matters for a drum that hardly turns. [s]"""


def envelopes_figure(record: Record, measured_mm: Mapping[str, float] | None = None) -> fig.Figure:
    """Return the envelopes of the filtered displacement over time, one panel per sensor.

    The drum speed is given along the top.

    Args:
        record: A record that is long enough for the filter.
        measured_mm: Measured amplitude A by sensor, drawn as dashed lines at +-A. [mm]
    """
    band = envelopes(record) * MM_PER_M
    largest = np.abs([band.lower.values, band.upper.values]).max()
    limits = symmetric_limits(max([largest, *(measured_mm or {}).values()]))
    panels = []
    for name in map(str, record.sensor.values):
        lower, upper = band.lower.sel(sensor=name).values, band.upper.sel(sensor=name).values
        sides = record.time.values, lower, upper
        marks: list[fig.Mark] = [time_band(sides, limits[1], "wm_drake, lower to upper envelope")]
        if measured_mm is not None:
            marks += experiment_rules(measured_mm[name])
        farther = np.where(np.abs(lower) > np.abs(upper), lower, upper)
        marks += largest_marks(record, farther, "mm")
        panels.append(time_panel(record, name, marks, "displacement, mm", limits))
    return time_figure(panels)


def experiment_rules(amplitude_mm: float, color: str = fig.MEASURED) -> list[fig.Mark]:
    """Return lines at both sides of zero at a measured amplitude. [mm]"""
    key = "experiment, ± amplitude"
    at = (-amplitude_mm, amplitude_mm)
    return [fig.Rule(side, color=color, width=1.6, dash="dashed", key=key) for side in at]


def gasket_figure(record: Record) -> fig.Figure:
    """Return force (upper row) and moment (lower row) of the gasket on the housing over time.

    A band shows the smallest to the largest value in each drum revolution.
    """
    panels = []
    for letter, variable, label in (
        ("F", record.bushing_force, "force, N"),
        ("M", record.bushing_moment, "moment, N m"),
    ):
        gasket = variable.sel(bushing="gasket")
        limits = symmetric_limits(float(np.abs(gasket).max()))
        for axis in map(str, record.axis.values):
            values = gasket.sel(axis=axis).values
            sides = revolution_band(record, values)
            shown = time_band(sides, limits[1], IN_REVOLUTIONS)
            marks = [shown, *largest_marks(record, values, label.split(", ")[1])]
            panels.append(time_panel(record, f"{letter}{axis}", marks, label, limits))
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
    paths = [axis_path_mm(record, y) for y in (y_front, y_rear)[: len(titles)]]
    largest = moment_of_largest_amplitude(record)
    moments, angle = record.time.values, record.drum_angle.values
    windows = [orbit_window(moments, angle, largest, turns) for turns in (ORBIT_REVOLUTIONS, 1.0)]
    x_limit, z_limit = orbit_limits([path[windows[0]] for path in paths])
    x = fig.Axis(label="x, to the right, mm", range=(-x_limit, x_limit))
    z = fig.Axis(label="z, up, mm", range=(-z_limit, z_limit))
    speed = record.drum_speed.values[largest] * RPM_PER_RAD_S
    moment = f"largest amplitude: {moments[largest]:.2f} s, {number(speed, 0)} rpm"
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


def gaps_figure(results: Sequence[CaseResult]) -> fig.Figure:
    """Return the smallest gap between tub and housing, one line per case.

    The text at each line gives the two parts and the drum speed at which the gap occurs.
    """
    gaps = [gap for gap in (result.measures.smallest_gap for result in results) if gap is not None]
    distances = [MM_PER_M * gap.distance for gap in gaps]
    low, high = min(0.0, *distances), max(0.0, *distances)
    span = (high - low) or 1.0
    marks: list[fig.Mark] = []
    for place, (result, gap, distance) in enumerate(zip(results, gaps, distances, strict=True)):
        color = fig.MEASURED if distance <= 0.0 else fig.OURS
        marks.append(fig.Line([0.0, distance], [place, place], color=color, width=4.0))
        marks.append(fig.Points([distance], [place], color=color, size=10.0))
        speed = number(result.speed_rpm(gap.time), 0)
        parts = f"{shape_name(gap.moving)} to {shape_name(gap.fixed)}"
        text = f"{number(distance)} mm at {speed} rpm\n{parts}"
        marks.append(fig.Text(max(distance, 0.0), place, text, across="left", shift=(14.0, 0.0)))
    marks.append(fig.Rule(0.0, "y", color=fig.MARK))
    x = fig.Axis(
        label="smallest gap, mm (0: the parts touch)", range=(low - 0.02 * span, high + 1.1 * span)
    )
    y = fig.Axis(
        ticks=fig.named(result.title for result in results),
        range=(len(results) - 0.4, -0.6),
        has_grid=False,
        has_line=False,
    )
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=50.0 * len(results))


def axis_path_mm(record: Record, y: float) -> FloatArray:
    """Return the displacement from rest of the drum-axis point at depth y. (n, 3) [mm]"""
    at_rest = point_positions(
        np.asarray(record.attrs["rest_pose"])[None, :], np.array([[0.0, y, 0.0]])
    )[:, 0]
    return (axis_motion(record, y) - at_rest) * MM_PER_M


def orbit_window(
    time: FloatArray, drum_angle: FloatArray, index: int, revolutions: float
) -> BoolArray:
    """Return which samples (n,) an orbit shows.

    These are the samples within the given number of drum revolutions around the sample `index`, but
    not beyond the longest time of an orbit.
    """
    turned, passed = np.abs(drum_angle - drum_angle[index]), np.abs(time - time[index])
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


def have_one_orbit(y_front: float, y_rear: float) -> bool:
    """Return whether two positions on the drum axis are so close that one orbit shows both. [m]"""
    return abs(y_rear - y_front) < SAME_PLANE


def _depths(y_front: float, y_rear: float) -> list[str]:
    """Return a title for each orbit that is drawn."""
    if have_one_orbit(y_front, y_rear):
        return [f"y = {number(y_front * MM_PER_M, 0)} mm"]
    return [
        f"{where}, y = {number(y * MM_PER_M, 0)} mm"
        for where, y in (("front", y_front), ("rear", y_rear))
    ]


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
