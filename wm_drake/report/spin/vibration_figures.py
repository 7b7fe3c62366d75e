"""Figures of the vibration of a spin run: spectra, order map, accelerations and mount forces."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, OURS, WIDTH, style_axes
from wm_drake.report.spin.panels import (
    COLUMNS,
    band_handle,
    draw_band,
    largest_handle,
    legend_below,
    mark_largest,
    revolution_band,
    set_symmetric_limits,
    speed_axis,
    time_panels,
    time_ticks,
)
from wm_drake.simulation.mount_forces import MountForce
from wm_drake.simulation.orders import PERIOD, frequency_map, order_map
from wm_drake.simulation.records import Record

DECADES = 3.0
"""Range of the amplitudes that a map shows, below the largest one, in powers of ten."""

ORDERS_SHOWN = (1, 2, 3)
"""Orders that are drawn as lines in a map of frequencies."""

LOWEST_LIMIT_HZ = 8.0
"""Smallest upper end of the frequencies that are shown. [Hz]"""


def spectra_figure(record: Record, signals: Sequence[tuple[str, str, FloatArray]]) -> Figure | None:
    """Draw spectrum, frequency map and order map of signals, one row per signal.

    The spectrum is the largest amplitude at each frequency over all windows of the map.

    Args:
        record: Record that gives time, drum angle and drum speed.
        signals: Name, unit and values (n,) of each.

    Returns:
        The figure; None if the record is too short for the windows of the maps.
    """
    time, angle = record.time.values, record.drum_angle.values
    columns = np.column_stack([values for _, _, values in signals])
    by_frequency, by_order = frequency_map(columns, time), order_map(columns, angle, time)
    if not by_frequency.sizes["time"] or not by_order.sizes["time"]:
        return None
    height = 2.45 * len(signals) + 0.75
    figure = Figure(figsize=(WIDTH, height))
    grid = figure.add_gridspec(
        len(signals),
        4,
        width_ratios=(1.0, 1.3, 1.3, 0.04),
        left=0.065,
        right=0.94,
        top=1.0 - 0.62 / height,
        bottom=0.5 / height,
        wspace=0.3,
        hspace=0.2,
    )
    for row, (name, unit, _) in enumerate(signals):
        frequencies, orders = by_frequency.isel(signal=row), by_order.isel(signal=row)
        spectrum, lines, map_of_orders, scale = (
            figure.add_subplot(grid[row, column]) for column in range(4)
        )
        largest = float(np.nanmax([frequencies.max(), orders.max()]))
        limits = LogNorm(largest * 10.0**-DECADES, largest) if largest else LogNorm(0.1, 1.0)
        highest = _highest_hz(record)
        _spectrum(spectrum, frequencies, highest, limits, f"{name}, {unit}")
        _map(lines, record, frequencies, "frequency", limits)
        lines.set_ylim(0.0, highest)
        _order_lines(lines, record)
        image = _map(map_of_orders, record, orders, "order", limits)
        bar = figure.colorbar(image, cax=scale)
        bar.set_label(f"amplitude, {unit}", fontsize=9)
        bar.ax.tick_params(labelsize=8.5)
        lines.set_ylabel("frequency, Hz", fontsize=9.5)
        map_of_orders.set_ylabel("order", fontsize=9.5)
        for axes in (lines, map_of_orders):
            if row == 0:
                speed_axis(axes, record, time_ticks(float(time[-1])))
        if row == len(signals) - 1:
            spectrum.set_xlabel("frequency, Hz", fontsize=9.5)
            for axes in (lines, map_of_orders):
                axes.set_xlabel("time, s", fontsize=9.5)
        else:
            for axes in (spectrum, lines, map_of_orders):
                axes.tick_params(labelbottom=False)
    return figure


def _highest_hz(record: Record) -> float:
    """Return the upper end of the frequencies that are shown: a little above the third order."""
    fastest = float(np.abs(record.drum_speed.values).max()) / (2.0 * np.pi)
    return max(LOWEST_LIMIT_HZ, (ORDERS_SHOWN[-1] + 0.5) * fastest)


def _spectrum(
    axes: Axes, frequencies: xr.DataArray, highest: float, limits: LogNorm, label: str
) -> None:
    largest = frequencies.max("time")
    axes.semilogy(largest.frequency, largest, color=OURS, linewidth=1.2)
    axes.set(xlim=(0.0, highest), ylim=(limits.vmin, 1.5 * (limits.vmax or 1.0)))
    axes.set_ylabel(label, fontsize=9.5)
    axes.grid(color=GRID)
    style_axes(axes)


def _map(
    axes: Axes, record: Record, values: xr.DataArray, dimension: str, limits: LogNorm
) -> AxesImage:
    """Draw amplitudes over time and frequency or order as an image, one column per window."""
    end, step = float(record.time[-1]), float(values[dimension][1] - values[dimension][0])
    first = float(values.time[0])
    times = np.arange(first, float(values.time[-1]) + 0.5 * PERIOD, PERIOD)
    # a time without a window stays empty
    even = values.reindex(time=times, method="nearest", tolerance=0.5 * PERIOD)
    extent = (
        first - 0.5 * PERIOD,
        float(times[-1]) + 0.5 * PERIOD,
        float(values[dimension][0]) - 0.5 * step,
        float(values[dimension][-1]) + 0.5 * step,
    )
    image = axes.imshow(
        np.maximum(even.transpose(dimension, "time").values, limits.vmin or 0.0),
        extent=extent,
        origin="lower",
        aspect="auto",
        norm=limits,
        cmap="viridis",
        interpolation="none",
    )
    axes.set(xlim=(0.0, end), xticks=time_ticks(end), ylim=(0.0, extent[3]))
    style_axes(axes)
    return image


def _order_lines(axes: Axes, record: Record) -> None:
    """Draw and name the frequencies of the first orders."""
    hertz = np.abs(record.drum_speed.values) / (2.0 * np.pi)
    time, top = record.time.values, axes.get_ylim()[1]
    every = slice(None, None, max(1, len(time) // 500))
    for order in ORDERS_SHOWN:
        axes.plot(time[every], order * hertz[every], color="white", linewidth=0.8, linestyle=":")
        last = min(order * float(hertz[-1]), 0.94 * top)
        axes.annotate(
            f"{order}×",
            (float(time[-1]), last),
            (-9.0, 4.0),
            textcoords="offset points",
            ha="right",
            fontsize=8.5,
            color="white",
        )


def accelerations_figure(record: Record, values: xr.DataArray) -> Figure:
    """Draw the accelerations (time, sensor) at the sensors over time, one panel per sensor.

    A band shows the smallest to the largest value in each drum revolution.
    """
    sensors = [str(name) for name in values.sensor.values]
    rows = -(-len(sensors) // COLUMNS)
    figure, panels = time_panels(record, len(sensors), ["acceleration, m/s²"] * rows)
    set_symmetric_limits(panels, float(abs(values).max()))
    for axes, name in zip(panels, sensors, strict=True):
        signal = values.sel(sensor=name).values
        draw_band(axes, *revolution_band(record, signal))
        mark_largest(axes, record, name, signal, "m/s²")
    _legend_of_bands(figure)
    return figure


def mounts_figure(record: Record, forces: Sequence[MountForce]) -> Figure:
    """Draw the forces of the mounts over time, a row of panels for each kind of mount.

    A band shows the smallest to the largest size of the force in each drum revolution.
    """
    rows = _rows(forces)
    places = [COLUMNS * row + column for row, of in enumerate(rows) for column in range(len(of))]
    count = places[-1] + 1
    figure, panels = time_panels(
        record, count, ["force, N"] * len(rows), set(range(count)) - set(places)
    )
    for row, of_row in enumerate(rows):
        signals = [np.asarray(np.linalg.norm(force.force, axis=1)) for force in of_row]
        own = panels[COLUMNS * row : COLUMNS * row + len(of_row)]
        low = min(0.0, *(float(signal.min()) for signal in signals))
        high = max(0.0, *(float(signal.max()) for signal in signals))
        span = (high - low) or 1.0
        for axes, force, signal in zip(own, of_row, signals, strict=True):
            axes.set_ylim(low - 0.08 * span, high + 0.28 * span)
            draw_band(axes, *revolution_band(record, signal))
            mark_largest(axes, record, force.name.replace("_", " "), signal, "N")
    _legend_of_bands(figure)
    return figure


def _rows(forces: Sequence[MountForce]) -> list[list[MountForce]]:
    """Return the forces in rows; each kind of mount begins a new one."""
    kinds: dict[str, list[MountForce]] = {}
    for force in forces:
        kinds.setdefault(force.name.split(".")[0], []).append(force)
    return [
        of_kind[begin : begin + COLUMNS]
        for of_kind in kinds.values()
        for begin in range(0, len(of_kind), COLUMNS)
    ]


def _legend_of_bands(figure: Figure) -> None:
    legend_below(
        figure,
        [
            band_handle("wm_drake, smallest to largest value in each drum revolution"),
            largest_handle(),
        ],
    )
