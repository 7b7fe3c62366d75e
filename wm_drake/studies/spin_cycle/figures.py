"""Figures of a spin-cycle study: profile, heat map, bars per region."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters import SpinProfile
from wm_drake.report import figure as fig
from wm_drake.report.formatting import number
from wm_drake.report.quantity import SPEED, TIME, quantity_of, shown

WHITE_TEXT_FROM = 0.55
"""Fraction of the colour scale above which text on a cell is white."""


def profile_figure(profile: SpinProfile) -> fig.Figure:
    """Return the drum speed over time, with shaded and named regions."""
    speeds = SPEED.values(profile.speed)
    top = float(np.abs(speeds).max())
    marks: list[fig.Mark] = []
    for index, region in enumerate(profile.regions):
        marks.append(fig.Span(region.begin, region.end, opacity=0.16 if index % 2 else 0.07))
        marks.append(fig.Text(0.5 * (region.begin + region.end), 1.09 * top, region.name))
    marks.append(fig.Line(profile.time, speeds, width=2.4))
    x = fig.Axis(label=TIME.label, range=(0.0, profile.duration))
    y = fig.Axis(label=SPEED.label, range=(0.0, 1.18 * top))
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=190.0)


def heat_map_figure(values: xr.DataArray, notes: Sequence[Sequence[str]]) -> fig.Figure:
    """Return numbers on coloured cells, with one colour scale.

    Args:
        values: Two-dimensional, with labels of rows and columns.
        notes: (rows, columns) small text below each number, or "".
    """
    cells, quantity = shown(values), quantity_of(values)
    rows, columns = (list(map(str, values[dim].values)) for dim in values.dims)
    top = float(np.nanmax(cells)) or 1.0
    scale = fig.Scale(low=0.0, high=top, shades="Blues", label=quantity.label)
    marks: list[fig.Mark] = [fig.Cells(cells, range(len(columns)), range(len(rows)), scale=scale)]
    for row, column in np.ndindex(*cells.shape):
        value = float(cells[row, column])
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
    computed: xr.DataArray, integrated: xr.DataArray | None, measured: xr.DataArray | None
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
    drawn = [values for values in (computed, integrated, measured) if values is not None]
    top = 1.3 * max(float(shown(values.max(keep_attrs=True))) for values in drawn)  # for names
    x = fig.Axis(ticks=fig.named(regions), range=(-0.6, len(regions) - 0.4), has_grid=False)
    y = fig.Axis(label=quantity_of(computed).named("RMS").label, range=(0.0, top or 1.0))
    panels = []
    for sensor in sensors:
        for direction in directions:
            here = {"accelerometer": sensor, "axis": direction}
            marks: list[fig.Mark] = []
            if measured is not None:
                sizes = shown(measured.sel(here))
                at = places - shift
                marks.append(
                    fig.Bars(at, sizes, thickness=width, color=fig.MEASURED, key="measured")
                )
            sizes = shown(computed.sel(here))
            marks.append(fig.Bars(places + shift, sizes, thickness=width, color=fig.OURS, key=key))
            if integrated is not None:
                ends = shown(integrated.sel(here))
                points = fig.Points(
                    places + shift, ends, symbol="line-ew", color=fig.MARK, size=14.0
                )
                marks.append(replace(points, key="wm_drake, from acceleration"))
            title = f"{sensor} {direction}"
            text = fig.Text(0.02, 0.96, title, size=fig.TITLE, is_bold=True, in_data=(False, False))
            marks.append(replace(text, across="left", up="top"))
            panels.append(fig.Panel(name=title, marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, len(directions), share="both"), height=140.0)
