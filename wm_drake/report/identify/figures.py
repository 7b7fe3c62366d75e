"""Figures of a component identification: measured and fitted loops, progress of the search."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import MEASURED, OURS, WIDTH
from wm_drake.report.rig.figures import force_scale, legend_line, motion_scale, style_panel
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion
from wm_drake.studies.fitting import Fit

COLUMNS = 4
"""Largest number of panels in a row."""


def motion_text(measured: MeasuredMotion) -> str:
    """Return frequency and amplitude of a measured loop with their units; of another motion, range.

    The range goes from the least to the greatest displacement.
    """
    factor, _, unit = motion_scale(measured.loop.rotates)
    if not isinstance(measured, HarmonicMotion):
        ends = [float(factor * side(measured.position)) for side in (np.min, np.max)]
        negligible = 1e-9 * (ends[1] - ends[0])  # rounding of an end at zero
        low, high = (0.0 if abs(end) < negligible else end for end in ends)
        return f"as recorded, {low:.3g} to {high:.3g} {unit}"
    return f"{measured.motion.frequency:.3g} Hz, {factor * measured.motion.amplitude:.3g} {unit}"


def loops_figure(fit: Fit, motions: Sequence[MeasuredMotion], *, over: str) -> Figure:
    """Draw measured samples and the fitted loop without offset and drift, one panel per file.

    Args:
        fit: Fit to these motions.
        motions: Measured motions, at least one.
        over: Abscissa: displacement or velocity.
    """
    columns = min(COLUMNS, max(2, len(motions)))
    rows = -(-len(motions) // columns)
    figure = Figure(figsize=(WIDTH, 2.55 * rows + 0.45), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    factor, name, unit = motion_scale(motions[0].loop.rotates)
    head = f"{name}, {unit}" if over == "displacement" else f"velocity, {unit}/s"
    for index, axes in enumerate(grid.flat):
        axes.set_visible(index < len(motions))
        if index >= len(motions):
            continue
        measured = motions[index]
        offset = measured.baseline @ fit.baselines[index]
        computed = fit.computed[fit.problem.slices[index]] - offset
        _panel(axes, measured, measured.loop.force - offset, computed, over, factor)
        axes.set_title(
            motion_text(measured), fontsize=10, loc="left", fontweight="bold", parse_math=False
        )
        if index >= len(motions) - columns:
            axes.set_xlabel(head, fontsize=9.5)
        if index % columns == 0:
            axes.set_ylabel(", ".join(force_scale(measured.loop.rotates)), fontsize=9.5)
    handles = [
        legend_line(MEASURED, "measured", marker="o", markersize=3.0, linestyle="none"),
        legend_line(OURS, "fitted", linewidth=1.8),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False, fontsize=9.5)
    return figure


MOST_PANELS = 12
"""Largest number of tests in a figure of several laws."""

LAW_COLOURS = ("#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#d55e00")
"""Colours of laws, of Okabe and Ito."""


def measured_files(motions: Sequence[MeasuredMotion]) -> list[int]:
    """Return the indices of at most `MOST_PANELS` tests, evenly chosen."""
    places = np.linspace(0, len(motions) - 1, min(MOST_PANELS, len(motions)))
    return [round(place) for place in places]


def rival_loops_figure(
    laws: Sequence[str],
    fits: Sequence[Fit],
    motions: Sequence[MeasuredMotion],
    chosen: Sequence[int],
    *,
    best: int,
    over: str,
) -> Figure:
    """Draw measured samples and the loop of each law, one panel per test.

    The offset and drift that the best law finds are taken from the samples and from all laws, so
    that each law lies beside the samples as its error says.

    Args:
        laws: Names of the laws.
        fits: Fit or evaluation of each law on all motions.
        motions: Measured motions.
        chosen: Indices of the motions that are drawn.
        best: Index of the best law.
        over: Abscissa: displacement or velocity.
    """
    columns = min(COLUMNS, max(2, len(chosen)))
    rows = -(-len(chosen) // columns)
    figure = Figure(figsize=(WIDTH, 2.55 * rows + 0.45), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    factor, name, unit = motion_scale(motions[0].loop.rotates)
    head = f"{name}, {unit}" if over == "displacement" else f"velocity, {unit}/s"
    for place, axes in enumerate(grid.flat):
        axes.set_visible(place < len(chosen))
        if place >= len(chosen):
            continue
        index = chosen[place]
        measured = motions[index]
        x = factor * (measured.position if over == "displacement" else measured.rate)
        order = drawing_order(measured)
        shown = measured.baseline @ fits[best].baselines[index]
        axes.plot(
            x,
            measured.loop.force - shown,
            "o",
            color=MEASURED,
            markersize=2.0,
            alpha=0.35,
            rasterized=True,
        )
        for k, fit in enumerate(fits):
            computed = fit.computed[fit.problem.slices[index]] - shown
            axes.plot(x[order], computed[order], color=_law_colour(k), linewidth=1.3)
        style_panel(axes)
        axes.set_title(
            motion_text(measured), fontsize=10, loc="left", fontweight="bold", parse_math=False
        )
        if place >= len(chosen) - columns:
            axes.set_xlabel(head, fontsize=9.5)
        if place % columns == 0:
            axes.set_ylabel(", ".join(force_scale(measured.loop.rotates)), fontsize=9.5)
    handles = [
        legend_line(MEASURED, "measured", marker="o", markersize=3.0, linestyle="none"),
        *(legend_line(_law_colour(k), law, linewidth=1.8) for k, law in enumerate(laws)),
    ]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(handles),
        frameon=False,
        fontsize=9.5,
    )
    return figure


def _law_colour(index: int) -> str:
    return LAW_COLOURS[index % len(LAW_COLOURS)]


def drawing_order(measured: MeasuredMotion) -> np.ndarray:
    """Return the order of samples along a line: by phase and closed for a sine, else by time."""
    if not isinstance(measured, HarmonicMotion):
        return np.arange(len(measured.position))
    order = np.argsort(measured.phase)
    return np.append(order, order[0])


def history_figure(fit: Fit, unit: str) -> Figure:
    """Draw the smallest RMSE, with its unit, after each round of the search."""
    figure = Figure(figsize=(WIDTH, 2.3), layout="constrained")
    axes = figure.subplots()
    axes.semilogy(
        range(1, len(fit.history) + 1),
        np.maximum(fit.history, 1e-300),
        "o-",
        color=OURS,
        linewidth=1.4,
        markersize=3.5,
    )
    axes.set_xlabel("round of the search", fontsize=9.5)
    axes.set_ylabel(f"smallest RMSE, {unit}", fontsize=9.5)
    style_panel(axes)
    return figure


def _panel(
    axes: Axes,
    measured: MeasuredMotion,
    force: FloatArray,
    computed: FloatArray,
    over: str,
    factor: float,
) -> None:
    x = factor * (measured.position if over == "displacement" else measured.rate)
    order = drawing_order(measured)
    axes.plot(x, force, "o", color=MEASURED, markersize=2.0, alpha=0.45, rasterized=True)
    axes.plot(x[order], computed[order], color=OURS, linewidth=1.6)
    style_panel(axes)
