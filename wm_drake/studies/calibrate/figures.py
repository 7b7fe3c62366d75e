"""Figures of a calibration."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import number
from wm_drake.studies.calibrate.study import Calibration
from wm_drake.studies.modes.shapes import ANGLE_ARM

OTHER = "#8a8f98"
"""Colour of the errors of another model."""

_SHAPE_ORDER = (3, 4, 5, 0, 1, 2)
_SHAPE_WEIGHTS = np.repeat([ANGLE_ARM, 1.0], 3)
"""Weights of the components of a mode shape, as in `natural_modes`."""


def errors_figure(
    rows: Sequence[tuple[str, FloatArray, FloatArray | None]], sensors: Sequence[str]
) -> fig.Figure:
    """Return the percent differences from the experiment, one panel per case, one dot per sensor.

    Args:
        rows: For each case its name, the errors of the calibrated machine, and the errors of
            another model or None. Errors have the shape (sensor). [%]
        sensors: Names of the sensors.
    """
    shown = [values for _, *pair in rows for values in pair if values is not None]
    limit = 1.15 * max(5.0, float(np.nanmax(np.abs(shown))))
    places = np.arange(len(sensors))
    at = places - 0.14
    x = fig.Axis(ticks=fig.named(sensors), range=(-0.5, len(sensors) - 0.5), has_grid=False)
    y = fig.Axis(label="difference from the experiment, %", range=(-limit, limit))
    panels = []
    for name, ours, other in rows:
        marks: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)]
        if other is not None:
            marks.append(fig.Points(places + 0.14, other, symbol="diamond", color=OTHER))
        marks.append(fig.segments((at, np.zeros(len(at))), (at, ours), width=2.8))
        marks.append(fig.Points(at, ours, size=8.0))
        panels.append(fig.Panel(title=name, marks=tuple(marks), x=x, y=y))
    placed = fig.in_grid(panels, 3, share="both")
    return fig.Figure(panels=placed, height=150.0)


def modes_figure(modes: Sequence[tuple[str, xr.Dataset]]) -> fig.Figure:
    """Return mode shapes as coloured tables: one row per mode, one column per direction of motion.

    Angles are multiplied by 0.25 m. The frequency is at the left of each row.

    Args:
        modes: Title and modes of each state of the machine; the states are drawn side by side.
    """
    scale = fig.Scale(low=-1.3, high=1.3, shades="RdBu")
    count = max(state.sizes["mode"] for _, state in modes)
    plain = fig.Axis(has_grid=False, has_line=False)
    x = replace(plain, ticks=fig.named(COORDINATES[k] for k in _SHAPE_ORDER), range=(-0.5, 5.5))
    panels = []
    for title, state in modes:
        shape = (state["shape"].values * _SHAPE_WEIGHTS)[:, _SHAPE_ORDER]
        marks: list[fig.Mark] = [fig.Cells(shape, range(6), range(len(shape)), scale=scale)]
        for (row, column), value in np.ndenumerate(shape):
            if abs(value) >= 0.1:
                color = "#ffffff" if abs(value) > 0.75 else fig.MARK
                marks.append(fig.Text(column, row, number(value), color=color))
        labels = [f"{number(f, 2)} Hz, {number(60.0 * f, 0)} rpm" for f in state.frequency.values]
        y = replace(plain, ticks=fig.named(labels), range=(count - 0.5, -0.5))
        panels.append(fig.Panel(title=title, marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, len(panels)), height=42.0 * count)


def quantities_figure(calibration: Calibration) -> fig.Figure:
    """Return each free quantity between its bounds: prior, and value and deviation of solutions."""
    parameter_map, solutions = calibration.parameter_map, calibration.solutions
    count = len(parameter_map.names)
    reach = parameter_map.upper - parameter_map.lower
    low, high = (
        (parameter_map.expected + sign * parameter_map.deviation - parameter_map.lower) / reach
        for sign in (-1.0, 1.0)
    )
    places, begin = np.arange(count), np.maximum(low, 0.0)
    prior = fig.Bars(
        places, np.minimum(high, 1.0) - begin, base=begin, is_across=True, color=fig.GRID
    )
    marks: list[fig.Mark] = [prior]
    for rank, solution in reversed(list(enumerate(solutions))):
        at = (solution.point - parameter_map.lower) / reach
        if rank:
            marks.append(fig.Points(at, places, symbol="line-ns", color=OTHER, size=11.0))
            continue
        wide = solution.posterior.spread() * parameter_map.deviation / reach
        ends = (np.maximum(at - wide, 0.0), places), (np.minimum(at + wide, 1.0), places)
        marks += [fig.segments(*ends, width=3.0), fig.Points(at, places, size=7.5)]
    expected = (parameter_map.expected - parameter_map.lower) / reach
    marks.append(fig.Points(expected, places, symbol="line-ns", color=fig.MEASURED, size=12.0))
    ticks = ((0.0, "lower bound"), (0.5, ""), (1.0, "upper bound"))
    names = fig.named(name.replace("_", " ") for name in parameter_map.names)
    panel = fig.Panel(
        marks=tuple(marks),
        x=fig.Axis(ticks=ticks, range=(-0.02, 1.02), has_grid=False),
        y=fig.Axis(ticks=names, range=(count - 0.3, -0.7), has_grid=False),
    )
    return fig.Figure(panels=(panel,), height=24.0 * count + 20.0)
