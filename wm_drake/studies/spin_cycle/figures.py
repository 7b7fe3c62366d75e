"""Figures of a spin-cycle study: profile, heat map, bars per region."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number

WHITE_TEXT_FROM = 0.55
"""Fraction of the colour scale above which text on a cell is white."""


def profile_figure(profile: SpinProfile) -> fig.Figure:
    """Return the drum speed over time, with shaded and named regions."""
    top = RPM_PER_RAD_S * profile.highest_speed
    marks: list[fig.Mark] = []
    for index, region in enumerate(profile.regions):
        marks.append(fig.Span(region.begin, region.end, opacity=0.16 if index % 2 else 0.07))
        marks.append(fig.Text(0.5 * (region.begin + region.end), 1.09 * top, region.name))
    marks.append(fig.Line(profile.time, RPM_PER_RAD_S * np.array(profile.speed), width=2.4))
    x = fig.Axis(label="time, s", range=(0.0, profile.duration))
    y = fig.Axis(label="drum speed, rpm", range=(0.0, 1.18 * top))
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=190.0)


def heat_map_figure(
    values: FloatArray, rows: Sequence[str], columns: Sequence[str], notes: Sequence[Sequence[str]]
) -> fig.Figure:
    """Return a table of numbers on coloured cells, with one colour scale.

    Args:
        values: (rows, columns) RMS displacement. [m]
        rows, columns: Names of the rows and columns.
        notes: (rows, columns) small text below each number, or "".
    """
    shown = MM_PER_M * values
    top = float(np.nanmax(shown)) or 1.0
    scale = fig.Scale(low=0.0, high=top, shades="Blues", label="RMS displacement, mm")
    marks: list[fig.Mark] = [fig.Cells(shown, range(len(columns)), range(len(rows)), scale=scale)]
    for row, column in np.ndindex(*shown.shape):
        value = float(shown[row, column])
        ink = "#ffffff" if value > WHITE_TEXT_FROM * top else fig.MARK
        note = notes[row][column]
        up = 0.14 if note else 0.0
        marks.append(fig.Text(column, row - up, number(value, 2), color=ink))
        if note:
            marks.append(fig.Text(column, row + 0.26, note, size=10.0, color=ink))
    plain = fig.Axis(has_grid=False, has_line=False)
    x = replace(plain, ticks=fig.named(columns), range=(-0.5, len(columns) - 0.5), is_far=True)
    y = replace(plain, ticks=fig.named(rows), range=(len(rows) - 0.5, -0.5))
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=55.0 * len(rows))


def bars_figure(
    computed: xr.DataArray,
    integrated: xr.DataArray | None,
    measured: xr.DataArray | None,
    name: str = "measured",
) -> fig.Figure:
    """Return the RMS displacement per region, as [A] Figs. 24 to 26.

    There is one panel for each sensor (rows) and axis (columns). All displacements are those of one
    case and have the shape (region, accelerometer, axis). [m]
    """
    sensors, directions = (
        list(map(str, computed[dim].values)) for dim in ("accelerometer", "axis")
    )
    regions = list(map(str, computed.region.values))
    places, width = np.arange(len(regions)), 0.72 if measured is None else 0.36
    shift = 0.0 if measured is None else 0.5 * width
    key = "wm_drake" if integrated is None else "wm_drake, displacement"
    shown = [values for values in (computed, integrated, measured) if values is not None]
    top = 1.3 * MM_PER_M * max(float(values.max()) for values in shown)  # room for the names
    x = fig.Axis(ticks=fig.named(regions), range=(-0.6, len(regions) - 0.4), has_grid=False)
    y = fig.Axis(label="RMS, mm", range=(0.0, top or 1.0))
    panels = []
    for sensor in sensors:
        for direction in directions:
            here = {"accelerometer": sensor, "axis": direction}
            marks: list[fig.Mark] = []
            if measured is not None:
                sizes = MM_PER_M * measured.sel(here).values
                marks.append(
                    fig.Bars(places - shift, sizes, thickness=width, color=fig.MEASURED, key=name)
                )
            sizes = MM_PER_M * computed.sel(here).values
            marks.append(fig.Bars(places + shift, sizes, thickness=width, color=fig.OURS, key=key))
            if integrated is not None:
                ends = MM_PER_M * integrated.sel(here).values
                points = fig.Points(
                    places + shift, ends, symbol="line-ew", color=fig.MARK, size=14.0
                )
                marks.append(replace(points, key="wm_drake, from acceleration"))
            title = f"{sensor} {direction}"
            at = fig.Text(0.02, 0.96, title, size=fig.TITLE, is_bold=True, in_data=(False, False))
            marks.append(replace(at, across="left", up="top"))
            panels.append(fig.Panel(name=title, marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, len(directions), share="both"), height=140.0)
