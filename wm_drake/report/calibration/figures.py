"""Figures of a calibration."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import number
from wm_drake.studies.calibration.calibration import Calibration
from wm_drake.studies.description.modal import Modes

OTHER = "#8a8f98"
"""Colour of the errors of another model."""

SHAPE_NAMES = ("roll", "pitch", "yaw", "x", "y", "z")
_SHAPE_ORDER = (3, 4, 5, 0, 1, 2)
_SHAPE_WEIGHTS = np.array([0.25, 0.25, 0.25, 1.0, 1.0, 1.0])
"""Weights of the components of a mode shape: angles are multiplied by 0.25 m, as in `Modes`."""


def errors_figure(
    rows: Sequence[tuple[str, FloatArray, FloatArray | None]], sensors: Sequence[str]
) -> Figure:
    """Draw the percent differences from the experiment, one panel per case, one dot per sensor.

    Args:
        rows: For each case its name, the errors of the calibrated machine, and the errors of
            another model or None. Errors have the shape (sensor). [%]
        sensors: Names of the sensors.
    """
    figure = Figure(figsize=(WIDTH, 0.55 + 2.1 * -(-len(rows) // 3)), layout="constrained")
    panels = figure.subplots(-(-len(rows) // 3), 3, sharex=True, sharey=True, squeeze=False).ravel()
    shown = [values for _, *pair in rows for values in pair if values is not None]
    limit = 1.15 * max(5.0, float(np.nanmax(np.abs(shown))))
    places = np.arange(len(sensors))
    for axes, (name, ours, other) in zip(panels, rows, strict=False):
        axes.axhline(0.0, color=MARK, linewidth=0.9)
        if other is not None:
            axes.plot(places + 0.14, other, "D", color=OTHER, markersize=5)
        axes.vlines(places - 0.14, 0.0, ours, color=OURS, linewidth=2.0)
        axes.plot(places - 0.14, ours, "o", color=OURS, markersize=6)
        axes.set_title(name, fontsize=10.5, loc="left", fontweight="bold", parse_math=False)
        axes.set_xticks(places, sensors)
        axes.set_ylim(-limit, limit)
        axes.grid(axis="y", color=GRID)
        style_axes(axes)
    for axes in panels[len(rows) :]:
        axes.set_axis_off()
    figure.supylabel("difference from the experiment, %", fontsize=9.5)
    return figure


def modes_figure(modes: Sequence[tuple[str, Modes]]) -> Figure:
    """Draw mode shapes as coloured tables: one row per mode, one column per direction of motion.

    Angles are multiplied by 0.25 m. The frequency is at the left of each row.

    Args:
        modes: Title and modes of each state of the machine; the states are drawn side by side.
    """
    height = 0.9 + 0.42 * max(len(found.frequency_hz) for _, found in modes)
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    panels = figure.subplots(1, len(modes), squeeze=False).ravel()
    for axes, (title, found) in zip(panels, modes, strict=True):
        shape = (found.shape * _SHAPE_WEIGHTS)[:, _SHAPE_ORDER]
        axes.imshow(shape, cmap="RdBu", vmin=-1.3, vmax=1.3, aspect="auto")
        for (row, column), value in np.ndenumerate(shape):
            if abs(value) >= 0.1:
                colour = "white" if abs(value) > 0.75 else MARK
                axes.text(
                    column, row, number(value), ha="center", va="center", fontsize=9, color=colour
                )
        axes.set_xticks(range(6), [SHAPE_NAMES[index] for index in _SHAPE_ORDER])
        labels = [f"{number(f, 2)} Hz, {number(60.0 * f, 0)} rpm" for f in found.frequency_hz]
        axes.set_yticks(range(len(labels)), labels)
        axes.set_title(title, fontsize=10.5, loc="left", fontweight="bold", parse_math=False)
        axes.tick_params(length=0, labelsize=9)
        for side in axes.spines.values():
            side.set_visible(False)
    return figure


def quantities_figure(calibration: Calibration) -> Figure:
    """Draw each free quantity between its bounds: prior, and value and deviation of solutions."""
    parameter_map, solutions = calibration.parameter_map, calibration.solutions
    count = len(parameter_map.names)
    figure = Figure(figsize=(WIDTH, 0.8 + 0.235 * count), layout="constrained")
    axes = figure.subplots()
    reach = parameter_map.upper - parameter_map.lower
    low, high = (
        (parameter_map.expected + sign * parameter_map.deviation - parameter_map.lower) / reach
        for sign in (-1.0, 1.0)
    )
    places = np.arange(count)
    axes.barh(
        places,
        np.minimum(high, 1.0) - np.maximum(low, 0.0),
        left=np.maximum(low, 0.0),
        height=0.66,
        color=GRID,
    )
    for rank, solution in reversed(list(enumerate(solutions))):
        at = (solution.point - parameter_map.lower) / reach
        wide = solution.spread() * parameter_map.deviation / reach
        colour = OURS if rank == 0 else OTHER
        if rank == 0:
            axes.hlines(
                places,
                np.maximum(at - wide, 0.0),
                np.minimum(at + wide, 1.0),
                color=colour,
                linewidth=2.2,
            )
        axes.plot(
            at,
            places,
            "o" if rank == 0 else "|",
            color=colour,
            markersize=5.5 if rank == 0 else 8,
            linestyle="none",
        )
    axes.plot(
        (parameter_map.expected - parameter_map.lower) / reach,
        places,
        "|",
        color=MEASURED,
        markersize=9,
        linestyle="none",
    )
    axes.set_yticks(
        places,
        [name.replace("_", " ") for name in parameter_map.names],
        fontsize=8.5,
        parse_math=False,
    )
    axes.set_xticks([0.0, 0.5, 1.0], ["lower bound", "", "upper bound"], color=QUIET)
    axes.set(xlim=(-0.02, 1.02), ylim=(count - 0.3, -0.7))
    style_axes(axes)
    axes.tick_params(axis="y", length=0)
    return figure
