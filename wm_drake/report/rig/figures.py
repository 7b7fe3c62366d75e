"""Figures of force loops over displacement, velocity and time, single or overlaid."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure

from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH
from wm_drake.report.formatting import MM_PER_M
from wm_drake.rigs import ForceLoop, RigRun
from wm_drake.rigs.run import slider_friction_curves

COLUMNS = 4
"""Largest number of panels in a row."""

DEG_PER_RAD = 180.0 / math.pi


def motion_scale(rotates: bool) -> tuple[float, str, str]:
    """Return the factor from SI to the unit for reading, the name, and this unit of a motion.

    Args:
        rotates: Whether the motion is an angle in deg, not a displacement in mm.
    """
    return (DEG_PER_RAD, "angle", "deg") if rotates else (MM_PER_M, "displacement", "mm")


def force_scale(rotates: bool) -> tuple[str, str]:
    """Return the name and unit of a force, or of a moment if the motion is a rotation."""
    return ("moment", "N m") if rotates else ("force", "N")


def frequency_text(loop: ForceLoop) -> str:
    """Return the frequency of a loop with its unit."""
    return f"{loop.motion.frequency:.3g} Hz"


def amplitude_text(loop: ForceLoop) -> str:
    """Return the amplitude of a loop with its unit."""
    factor, _, unit = motion_scale(loop.rotates)
    return f"{factor * loop.motion.amplitude:.3g} {unit}"


def overlaid_figure(
    loops: Sequence[ForceLoop],
    panel: Callable[[ForceLoop], str],
    line: Callable[[ForceLoop], str],
    *,
    over: str,
) -> Figure:
    """Draw loops in panels, several per panel, as [C] Figs. 6, 7, 14 and [A] Figs. 5, 8, 12 (B).

    Args:
        loops: At least one loop.
        panel: Function that returns the title of the panel in which a loop is drawn.
        line: Function that returns the legend text of a loop. It also selects the colour.
        over: Abscissa: displacement or velocity.
    """
    rising = sorted(loops, key=lambda loop: (loop.motion.frequency, loop.motion.amplitude))
    by_amplitude = sorted(loops, key=lambda loop: (loop.motion.amplitude, loop.motion.frequency))
    order = {
        text: index
        for index, text in enumerate(
            [*map(frequency_text, rising), *map(amplitude_text, by_amplitude)]
        )
    }
    panels, lines = (
        sorted({text(loop) for loop in loops}, key=order.__getitem__) for text in (panel, line)
    )
    columns = min(COLUMNS, max(2, len(panels)))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(WIDTH, 2.75 * rows + 0.45), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    rotates = loops[0].rotates
    factor, name, unit = motion_scale(rotates)
    head = (
        f"{name}, {unit}"
        if over == "displacement"
        else f"{'rate' if rotates else 'velocity'}, {unit}/s"
    )
    for index, axes in enumerate(grid.flat):
        axes.set_visible(index < len(panels))
        if index >= len(panels):
            continue
        for loop in (loop for loop in loops if panel(loop) == panels[index]):
            x = factor * (loop.displacement if over == "displacement" else loop.velocity)
            axes.plot(
                _closed(x),
                _closed(loop.force),
                color=_colour(lines.index(line(loop)), len(lines)),
                linewidth=1.4,
            )
        axes.set_title(panels[index], fontsize=10, loc="left", fontweight="bold", parse_math=False)
        axes.set_xlabel(head, fontsize=9.5)
        if index % columns == 0:
            axes.set_ylabel(", ".join(force_scale(rotates)), fontsize=9.5)
        style_panel(axes)
    handles = [legend_line(_colour(k, len(lines)), text) for k, text in enumerate(lines)]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=min(8, len(handles)),
        frameon=False,
        fontsize=9.5,
    )
    return figure


def time_figure(loop: ForceLoop) -> Figure:
    """Draw motion and force over one period and the loop, as [A] Figs. 5, 8, 12, [C] Figs. 4, 5."""
    factor, name, unit = motion_scale(loop.rotates)
    force = force_scale(loop.rotates)
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    time = np.append(loop.time, 1.0 / loop.motion.frequency)
    left.plot(
        time,
        factor * _closed(loop.displacement),
        color=QUIET,
        linewidth=1.4,
        linestyle=(0, (5, 2.5)),
    )
    left.set_xlabel("time, s", fontsize=9.5)
    left.set_ylabel(f"{name}, {unit} (dashed)", fontsize=9.5, color=QUIET)
    style_panel(left)
    other = left.twinx()
    other.plot(time, _closed(loop.force), color=OURS, linewidth=1.6)
    other.set_ylabel(", ".join(force), fontsize=9.5, color=OURS)
    other.tick_params(labelsize=9)
    _center_zero(left, other)
    speed = f"{'rate' if loop.rotates else 'velocity'}, {unit}/s"
    for axes, x, head in (
        (middle, loop.displacement, f"{name}, {unit}"),
        (right, loop.velocity, speed),
    ):
        axes.plot(factor * _closed(x), _closed(loop.force), color=OURS, linewidth=1.6)
        axes.set_xlabel(head, fontsize=9.5)
        axes.set_ylabel(", ".join(force), fontsize=9.5)
        style_panel(axes)
    return figure


def friction_law_figure(run: RigRun) -> Figure | None:
    """Draw friction over slider velocity at constant deformation rates, as [C] Fig. 12.

    The result is None for a law without MSTV friction.
    """
    rates_mm_s = (1.0, 5.0, 20.0, 60.0)
    w = np.concatenate([-np.geomspace(0.08, 1e-5, 200), np.geomspace(1e-5, 0.08, 200)])
    curves = slider_friction_curves(run.bench, [u / MM_PER_M for u in rates_mm_s], w)
    if curves is None:
        return None
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    axes, beside = figure.subplots(1, 2, width_ratios=(2, 1))
    beside.set_visible(False)
    for k, (u, curve) in enumerate(zip(rates_mm_s, curves, strict=True)):
        axes.plot(
            MM_PER_M * w,
            curve,
            color=_colour(k, len(rates_mm_s)),
            linewidth=1.4,
            label=f"{u:g} mm/s",
        )
    axes.set_xlabel("sliding velocity of the sponge on the tube, mm/s", fontsize=9.5)
    axes.set_ylabel("friction force on the sponge, N", fontsize=9.5)
    style_panel(axes)
    legend = {
        "loc": "upper left",
        "bbox_to_anchor": (1.02, 1.0),
        "frameon": False,
        "fontsize": 9,
        "title_fontsize": 9,
    }
    axes.legend(title="deformation rate of the sponge", **legend)
    return figure


def style_panel(axes: Axes) -> None:
    """Apply the style of a panel: grid and zero line, no frame at the top and the right."""
    axes.grid(color=GRID)
    axes.axhline(0.0, color=QUIET, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def legend_line(colour: Any, label: str, **style: Any) -> Any:
    """Return a line for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, label=label, **style)


def _center_zero(*panels: Axes) -> None:
    for axes in panels:
        limit = 1.08 * max(abs(side) for side in axes.get_ylim())
        axes.set_ylim(-limit, limit)


def _closed(values: Any) -> Any:
    return np.append(values, values[0])


def _colour(index: int, count: int) -> Any:
    """Return a colour of the scale from blue to yellow; for one or two lines a fixed colour."""
    if count <= 2:
        return (OURS, MEASURED)[index]
    palette: Colormap = colormaps["viridis"]
    return palette(0.88 * index / (count - 1))


__all__ = [
    "MARK",
    "amplitude_text",
    "force_scale",
    "frequency_text",
    "friction_law_figure",
    "legend_line",
    "motion_scale",
    "overlaid_figure",
    "style_panel",
    "time_figure",
]
