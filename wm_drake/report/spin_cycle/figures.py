"""Figures of a spin-cycle study: profile, heat map, bars per region."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number

WHITE_TEXT_FROM = 0.55
"""Fraction of the colour scale above which text on a cell is white."""


def profile_figure(profile: SpinProfile) -> Figure:
    """Draw the drum speed over time, with shaded and named regions."""
    figure = Figure(figsize=(WIDTH, 2.4), layout="constrained")
    axes = figure.subplots()
    top = RPM_PER_RAD_S * max(profile.speed)
    for index, region in enumerate(profile.regions):
        axes.axvspan(
            region.begin,
            region.end,
            facecolor=OURS,
            alpha=0.16 if index % 2 else 0.07,
            linewidth=0.0,
        )
        axes.text(
            0.5 * (region.begin + region.end),
            1.06 * top,
            region.name,
            ha="center",
            fontsize=9.5,
            parse_math=False,
        )
    axes.plot(profile.time, RPM_PER_RAD_S * np.array(profile.speed), color=OURS, linewidth=1.8)
    axes.set(xlim=(0.0, profile.duration), ylim=(0.0, 1.18 * top))
    axes.set_xlabel("time, s", fontsize=9.5)
    axes.set_ylabel("drum speed, rpm", fontsize=9.5)
    axes.grid(color=GRID)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def heat_map_figure(
    values: FloatArray, rows: Sequence[str], columns: Sequence[str], notes: Sequence[Sequence[str]]
) -> Figure:
    """Draw a table of numbers on coloured cells, with one colour scale.

    Args:
        values: (rows, columns) RMS displacement. [m]
        rows, columns: Names of the rows and columns.
        notes: (rows, columns) small text below each number, or "".
    """
    shown = MM_PER_M * values
    figure = Figure(figsize=(WIDTH, 0.55 * len(rows) + 1.2), layout="constrained")
    axes = figure.subplots()
    top = float(np.nanmax(shown)) or 1.0
    image = axes.imshow(shown, cmap="Blues", vmin=0.0, vmax=top, aspect="auto")
    for row, column in np.ndindex(*shown.shape):
        value = float(shown[row, column])
        ink = "white" if value > WHITE_TEXT_FROM * top else MARK
        note = notes[row][column]
        axes.text(
            column,
            row - (0.14 if note else 0.0),
            number(value, 2),
            ha="center",
            va="center",
            fontsize=9.5,
            color=ink,
        )
        axes.text(
            column,
            row + 0.26,
            note,
            ha="center",
            va="center",
            fontsize=7.5,
            color=ink,
            parse_math=False,
        )
    axes.set_xticks(range(len(columns)), columns, fontsize=9.5, parse_math=False)
    axes.set_yticks(range(len(rows)), rows, fontsize=9.5, parse_math=False)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    bar = figure.colorbar(image, ax=axes, pad=0.01, aspect=30)
    bar.set_label("RMS displacement, mm", fontsize=9.5)
    bar.ax.tick_params(labelsize=9)
    return figure


def bars_figure(
    computed: xr.DataArray,
    integrated: xr.DataArray | None,
    measured: xr.DataArray | None,
    name: str = "measured",
) -> Figure:
    """Draw the RMS displacement per region, as [A] Figs. 24 to 26.

    There is one panel for each sensor (rows) and axis (columns). All displacements are those of one
    case and have the shape (region, accelerometer, axis). [m]

    Args:
        computed: Displacements computed directly.
        integrated: Displacements from integrated acceleration, or None to omit them.
        measured: Measured displacements, or None if there are none.
        name: Name of the measurement in the legend.
    """
    sensors, axes_names = (
        list(map(str, computed[dim].values)) for dim in ("accelerometer", "axis")
    )
    regions = list(map(str, computed.region.values))
    height = 1.75 * len(sensors) + 0.9
    figure = Figure(figsize=(WIDTH, height))
    figure.subplots_adjust(
        left=0.065,
        right=0.99,
        top=1.0 - 0.12 / height,
        bottom=0.72 / height,
        wspace=0.1,
        hspace=0.16,
    )
    panels = figure.subplots(len(sensors), len(axes_names), sharex=True, sharey=True, squeeze=False)
    places, width = np.arange(len(regions)), 0.72 if measured is None else 0.36
    for row, sensor in enumerate(sensors):
        for column, axis in enumerate(axes_names):
            panel = panels[row, column]
            here = {"accelerometer": sensor, "axis": axis}
            shift = 0.0 if measured is None else 0.5 * width
            panel.bar(places + shift, MM_PER_M * computed.sel(here).values, width, color=OURS)
            if integrated is not None:
                ends = MM_PER_M * integrated.sel(here).values
                panel.plot(
                    places + shift, ends, "_", color=MARK, markersize=11, markeredgewidth=1.6
                )
            if measured is not None:
                panel.bar(
                    places - shift, MM_PER_M * measured.sel(here).values, width, color=MEASURED
                )
            panel.text(
                0.02,
                0.94,
                f"{sensor} {axis}",
                transform=panel.transAxes,
                va="top",
                fontsize=10,
                fontweight="bold",
            )
            panel.grid(axis="y", color=GRID)
            panel.set_axisbelow(True)
            panel.set_xticks(places, regions, parse_math=False)
            panel.tick_params(labelsize=9)
            for side in ("top", "right"):
                panel.spines[side].set_visible(False)
            panel.spines["left"].set_color(QUIET)
        panels[row, 0].set_ylabel("RMS, mm", fontsize=9.5)
    # room for the names of the panels
    panels[0, 0].set_ylim(0.0, 1.25 * panels[0, 0].get_ylim()[1])
    handles: list[Artist] = [
        Patch(color=OURS, label="wm_drake" if integrated is None else "wm_drake, displacement")
    ]
    if integrated is not None:
        line = Line2D(
            [],
            [],
            color=MARK,
            marker="_",
            markersize=11,
            linestyle="none",
            label="wm_drake, from acceleration",
        )
        handles.append(line)
    if measured is not None:
        handles.insert(0, Patch(color=MEASURED, label=name))
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=len(handles),
        frameon=False,
        fontsize=9.5,
        borderaxespad=0.2,
    )
    return figure
