"""Vibration of a load of a spin page: mount forces, accelerations, spectra, order map."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.figure import Axis, Cells, Figure, Line, Mark, Panel, Scale, Text, in_grid
from wm_drake.report.quantity import TIME, Quantity
from wm_drake.simulation.mount_forces import MountForce, mount_forces
from wm_drake.simulation.orders import PERIOD, REVOLUTIONS, WINDOW, frequency_map, order_map
from wm_drake.simulation.records import Record
from wm_drake.simulation.vibration import sensor_accelerations
from wm_drake.studies.answer import Plot
from wm_drake.studies.spin import figures
from wm_drake.studies.spin.data import ACCELERATION, DISPLACEMENT, FORCE
from wm_drake.studies.spin.study import CaseResult, SpinRuns

DECADES = 3.0
"""Range of the amplitudes that a map shows, below the largest one, in powers of ten."""

ORDERS_SHOWN = (1, 2, 3)
"""Orders that are drawn as lines in a map of frequencies."""

LOWEST_LIMIT = 8.0
"""Smallest upper end of the frequencies that are shown. [Hz]"""

FREQUENCY, ORDER = Quantity("frequency", Unit("Hz", "Hz")), Quantity("order")

ON_MAP = "#fefefe"
"""Colour of lines and texts on a map, in light and in dark."""


def vibration_plots(runs: SpinRuns, case: CaseResult) -> list[Plot]:
    """Return mount forces, accelerations and spectra of a case, as far as it has them."""
    accelerations = sensor_accelerations(case.record, runs.sensors_of(case))
    plots = (
        _mounts_plot(case),
        _accelerations_plot(case, accelerations),
        _spectra_plot(case, accelerations),
    )
    return [plot for plot in plots if plot]


def _mounts_plot(case: CaseResult) -> Plot | None:
    # rings of balls act on the drum, not on the cabinet
    forces = [f for f in mount_forces(case.record) if f.name != "gasket" and f.peak > 0.0]
    if not forces:
        return None
    caption = (
        "Forces of springs, dampers and bushings on the cabinet over time. The shaded area extends "
        "from the smallest to the largest size within each drum revolution. Each row has its own "
        "scale."
    )
    largest = max(forces, key=lambda force: force.peak)
    alternative = (
        f"Mount forces over time, load {case.title}. Largest: {largest.name} "
        f"{FORCE.text(largest.peak)}."
    )
    return Plot(mounts_figure(case.record, forces), alternative, caption)


def _accelerations_plot(case: CaseResult, accelerations: xr.DataArray) -> Plot:
    caption = (
        "Acceleration of the tub at each sensor, along its axis, over time; without gravity and "
        "unfiltered. The shaded area extends from the smallest to the largest value within each "
        "drum revolution."
    )
    alternative = (
        f"Accelerations at the sensors over time, load {case.title}. Largest: "
        f"{ACCELERATION.text(abs(accelerations).max())}."
    )
    return Plot(accelerations_figure(case.record, accelerations), alternative, caption)


def _spectra_plot(case: CaseResult, accelerations: xr.DataArray) -> Plot | None:
    amplitude = case.measures.amplitude.fillna(0.0)
    sensor = str(amplitude.sensor.values[int(np.argmax(amplitude.values))])
    signals = [
        (quantity.named(f"{sensor} {quantity.words}"), of_sensors.sel(sensor=sensor).values)
        for quantity, of_sensors in (
            (DISPLACEMENT, case.record.displacement),
            (ACCELERATION, accelerations),
        )
    ]
    figure = spectra_figure(case.record, signals)
    if figure is None:
        return None
    caption = (
        f"Frequencies and orders at the sensor with the largest amplitude, {sensor}: displacement "
        "(upper row) and acceleration (lower row). Left: spectrum, the largest amplitude at each "
        f"frequency over all windows of {WINDOW:g} s. Middle: amplitude over time and frequency; "
        "dotted: 1, 2 and 3 times the drum frequency. Right: amplitude over time and order, in "
        f"windows of {REVOLUTIONS} drum revolutions; order 1 is the unbalance itself, other orders "
        "come from the nonlinear forces of friction and gasket."
    )
    alternative = (
        f"Spectrum, frequency map and order map of displacement and acceleration at sensor "
        f"{sensor}, load {case.title}."
    )
    return Plot(figure, alternative, caption)


def spectra_figure(record: Record, signals: Sequence[tuple[Quantity, FloatArray]]) -> Figure | None:
    """Return spectrum, frequency map and order map of signals, one row per signal.

    The spectrum is the largest amplitude at each frequency over all windows of the map.

    Args:
        signals: Quantity and values (n,) of each. [SI]

    Returns:
        The figure; None if the record is too short for the windows of the maps.
    """
    time, angle = record.time.values, record.drum_angle.values
    columns = np.column_stack([quantity.values(values) for quantity, values in signals])
    by_frequency, by_order = frequency_map(columns, time), order_map(columns, angle, time)
    if not by_frequency.sizes["time"] or not by_order.sizes["time"]:
        return None
    fastest = float(np.abs(record.drum_speed.values).max()) / (2.0 * np.pi)
    highest = max(LOWEST_LIMIT, (ORDERS_SHOWN[-1] + 0.5) * fastest)  # a little above the third
    panels = []
    for row, (quantity, _) in enumerate(signals):
        frequencies, orders = by_frequency.isel(signal=row), by_order.isel(signal=row)
        largest = float(np.nanmax([frequencies.max(), orders.max()])) or 1.0
        low, label = largest * 10.0**-DECADES, quantity.named("amplitude").label
        scale = Scale(low=low, high=largest, kind="log", label=label)
        panels += [
            _spectrum(frequencies, highest, scale, quantity.label),
            _map(record, frequencies, FREQUENCY, replace(scale, label=""), highest),
            _map(record, orders, ORDER, scale),
        ]
    placed = in_grid(panels, 3)
    placed = tuple(_in_rows(panel, len(signals)) for panel in placed)
    return Figure(panels=placed, height=190.0, widths=(1.0, 1.3, 1.3))


def _in_rows(panel: Panel, rows: int) -> Panel:
    """Return a panel with the texts of the x axis in the last row, of the top axis in the first."""
    x = replace(panel.x, scale="time" if panel.column else "frequency")
    if panel.row < rows - 1:
        x = replace(x, has_numbers=False, label="")
    return replace(panel, x=x, top=None if panel.row else panel.top)


def _spectrum(frequencies: xr.DataArray, highest: float, scale: Scale, label: str) -> Panel:
    largest = frequencies.max("time")
    line = Line(largest.frequency.values, largest.values)
    x = Axis(label=FREQUENCY.label, range=(0.0, highest))
    y = Axis(label=label, range=(scale.low, 1.5 * scale.high), is_log=True)
    return Panel(name=label, marks=(line,), x=x, y=y)


def _map(
    record: Record, values: xr.DataArray, along: Quantity, scale: Scale, highest: float = 0.0
) -> Panel:
    """Return amplitudes over time and frequency or order as cells, one column per window.

    Args:
        values: Amplitudes over time and the dimension of the words of `along`.
        highest: Upper end of the frequencies; 0 for the largest order. [Hz]
    """
    times = np.arange(float(values.time[0]), float(values.time[-1]) + 0.5 * PERIOD, PERIOD)
    # a time without a window stays empty
    even = values.reindex(time=times, method="nearest", tolerance=0.5 * PERIOD)
    up = values[along.words].values
    shown = up <= (highest or up[-1]) + (up[1] - up[0])
    cells = even.transpose(along.words, "time").values[shown]
    marks: list[Mark] = [Cells(cells, times, up[shown], scale=scale)]
    top = highest or float(up[-1] + 0.5 * (up[1] - up[0]))
    if highest:
        marks += _order_lines(record, top)
    return Panel(
        marks=tuple(marks),
        x=Axis(label=TIME.label, range=(0.0, float(record.time[-1])), has_grid=False),
        y=Axis(label=along.label, range=(0.0, top), has_grid=False),
        top=figures.speed_axis(record),
    )


def _order_lines(record: Record, top: float) -> list[Mark]:
    """Return the frequencies of the first orders, with their names. `top`: highest one. [Hz]"""
    hertz = np.abs(record.drum_speed.values) / (2.0 * np.pi)
    time = record.time.values
    every = slice(None, None, max(1, len(time) // 500))
    marks: list[Mark] = []
    for order in ORDERS_SHOWN:
        line = order * hertz[every]
        marks.append(Line(time[every], line, color=ON_MAP, width=1.2, dash="dotted"))
        last = min(order * float(hertz[-1]), 0.94 * top)
        at = Text(float(time[-1]), last, f"{order}×", color=ON_MAP, across="right", up="bottom")
        marks.append(replace(at, shift=(-12.0, 2.0)))
    return marks


def accelerations_figure(record: Record, values: xr.DataArray) -> Figure:
    """Return the accelerations (time, sensor) at the sensors over time, one panel per sensor.

    A band shows the smallest to the largest value in each drum revolution.
    """
    limits = figures.symmetric_limits(float(ACCELERATION.values(abs(values).max())))
    panels = []
    for name in map(str, values.sensor.values):
        signal = values.sel(sensor=name).values
        marks = figures.revolution_marks(record, signal, ACCELERATION, limits[1])
        panels.append(figures.time_panel(record, name, marks, ACCELERATION.label, limits))
    return figures.time_figure(panels)


def mounts_figure(record: Record, forces: Sequence[MountForce]) -> Figure:
    """Return the forces of the mounts over time, a row of panels for each kind of mount.

    A band shows the smallest to the largest size of the force in each drum revolution.
    """
    panels: list[Panel | None] = []
    for of_row in _rows(forces):
        signals = [np.asarray(np.linalg.norm(force.force, axis=1)) for force in of_row]
        low = min(0.0, *(float(signal.min()) for signal in signals))
        high = max(0.0, *(float(signal.max()) for signal in signals))
        span = (high - low) or 1.0
        limits = low - 0.08 * span, high + 0.28 * span
        for force, signal in zip(of_row, signals, strict=True):
            marks = figures.revolution_marks(record, signal, FORCE, limits[1])
            name = force.name.replace("_", " ")
            panels.append(figures.time_panel(record, name, marks, FORCE.label, limits))
        panels += [None] * (figures.COLUMNS - len(of_row))
    return figures.time_figure(panels)


def _rows(forces: Sequence[MountForce]) -> list[list[MountForce]]:
    """Return the forces in rows; each kind of mount begins a new one."""
    kinds: dict[str, list[MountForce]] = {}
    for force in forces:
        kinds.setdefault(force.name.split(".")[0], []).append(force)
    return [
        of_kind[begin : begin + figures.COLUMNS]
        for of_kind in kinds.values()
        for begin in range(0, len(of_kind), figures.COLUMNS)
    ]
