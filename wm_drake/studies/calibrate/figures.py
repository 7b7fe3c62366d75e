"""Figures of a calibration."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.report import figure as fig
from wm_drake.report.formatting import number
from wm_drake.report.quantity import SPEED, quantity_of, shown, text_of
from wm_drake.studies.calibrate.study import Calibration
from wm_drake.studies.calibrate.targets import GASKET, case_title
from wm_drake.studies.modes.shapes import ANGLE_ARM

OTHER = "#8a8f98"
"""Colour of the errors of another model."""

BEST = "solution 1"

SMALLEST_SHOWN = 0.05
"""Difference that an axis of differences reaches at least."""

_SHAPE_ORDER = (3, 4, 5, 0, 1, 2)
_SHAPE_WEIGHTS = np.repeat([ANGLE_ARM, 1.0], 3)
"""Weights of the components of a mode shape, as in `natural_modes`."""


def errors_figure(differences: xr.DataArray) -> fig.Figure:
    """Return the differences from the experiment, one panel per case, one dot per sensor.

    Args:
        differences: As of `differences_of` in `wm_drake.studies.calibrate.results`.
    """
    quantity, sensors = quantity_of(differences), differences.sensor.values.tolist()
    largest = max(SMALLEST_SHOWN, float(abs(differences).max()))
    limit = 1.15 * float(quantity.values(largest))
    places = np.arange(len(sensors))
    at = places - 0.14
    x = fig.Axis(ticks=fig.named(sensors), range=(-0.5, len(sensors) - 0.5), has_grid=False)
    y = fig.Axis(label="difference from the experiment, %", range=(-limit, limit))
    panels = []
    cases = differences.stack(case=("load", "gasket")).dropna("case", how="all")
    for case in cases.transpose("case", ...):
        marks: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)]
        known = case.dropna("source", how="all")
        others = [source for source in known.source.values if not source.startswith("solution ")]
        if others:
            other = shown(known.sel(source=others[0]))
            marks.append(fig.Points(places + 0.14, other, symbol="diamond", color=OTHER))
        ours = shown(known.sel(source=BEST))
        marks.append(fig.segments((at, np.zeros(len(at))), (at, ours), width=2.8))
        marks.append(fig.Points(at, ours, size=8.0))
        title = case_title(case["load"].item(), case.gasket.item() == GASKET[True])
        panels.append(fig.Panel(title=title, marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, 3, share="both"), height=150.0)


def modes_figure(modes: Mapping[str, xr.Dataset]) -> fig.Figure:
    """Return mode shapes as coloured tables: one row per mode, one column per direction of motion.

    Angles are multiplied by 0.25 m. The frequency is at the left of each row.

    Args:
        modes: Modes of each state of the machine, by its title; they are drawn side by side.
    """
    scale = fig.Scale(low=-1.3, high=1.3, shades="RdBu")
    count = max(state.sizes["mode"] for state in modes.values())
    plain = fig.Axis(has_grid=False, has_line=False)
    x = replace(plain, ticks=fig.named(COORDINATES[k] for k in _SHAPE_ORDER), range=(-0.5, 5.5))
    panels = []
    for title, state in modes.items():
        shape = (state["shape"].values * _SHAPE_WEIGHTS)[:, _SHAPE_ORDER]
        marks: list[fig.Mark] = [fig.Cells(shape, range(6), range(len(shape)), scale=scale)]
        for (row, column), value in np.ndenumerate(shape):
            if abs(value) >= 0.1:
                color = "#ffffff" if abs(value) > 0.75 else fig.MARK
                marks.append(fig.Text(column, row, number(value), color=color))
        labels = [f"{text_of(f)}, {SPEED.text(2.0 * np.pi * f)}" for f in state.frequency]
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
        wide = solution.fit.remaining * parameter_map.deviation / reach
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
