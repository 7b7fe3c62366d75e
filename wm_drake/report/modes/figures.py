"""Figures of the modes of a machine."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wm_drake.model.scene import Outline
from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.simulation.outputs import point_positions
from wm_drake.studies.modes.sensitivity import Sensitivity
from wm_drake.studies.modes.shapes import Mode
from wm_drake.studies.modes.study import ORDERS, SLIDING, STUCK, MachineModes

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a6a00", "#56b4e9")
"""Colours of Okabe and Ito, one a mode; the yellow is darkened."""

VIEWS = (("front", 0, 2), ("side", 1, 2), ("top", 0, 1))
"""Views of the tub, with the coordinate across and the one upwards."""

SHOWN_MOTION = 0.18
"""Largest displacement of a drawn mode shape, as part of the tub's radius."""

SHOWN_NUMBERS = 8
"""Number of bars of a panel."""

TITLES = {SLIDING: "friction slides", STUCK: "friction sticks"}


def campbell_figure(result: MachineModes) -> Figure:
    """Draw the Campbell diagrams: natural frequencies over the speed, coloured by damping ratio."""
    figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    ratios = np.concatenate([d.damping_ratio.ravel() for d in result.diagrams.values()])
    norm = Normalize(0.0, max(0.05, float(np.nanmax(ratios))))
    top = 1.08 * max(float(np.nanmax(d.frequency_hz)) for d in result.diagrams.values())
    for axes, name in zip(panels, (SLIDING, STUCK), strict=True):
        points = _draw_campbell(axes, result, name, norm, top)
    panels[0].set_ylabel("natural frequency, Hz", fontsize=9.5)
    figure.colorbar(points, ax=panels, label="damping ratio", pad=0.015, fraction=0.035)
    order = "order of the drum speed"
    handles = [
        Line2D([], [], color=MARK, linestyle="--", linewidth=1.0, label=order),
        _key("o", MEASURED, "critical speed", ms=7, fillstyle="none"),
    ]
    if result.run_up is not None:
        handles.append(_key("v", OURS, "largest amplitude of a sensor in a run-up", ms=6))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _key(marker: str, colour: str, text: str, **style: Any) -> Line2D:
    """Return the entry of a marker in a legend."""
    return Line2D([], [], marker=marker, color=colour, linestyle="", label=text, **style)


def _draw_campbell(
    axes: Axes, result: MachineModes, name: str, norm: Normalize, top: float
) -> PathCollection:
    """Draw the diagram of one linearisation; return its points, for the scale of colours.

    Args:
        axes: Panel.
        result: The modes.
        name: Linearisation.
        norm: Damping ratios to colours.
        top: Highest frequency. [Hz]
    """
    diagram = result.diagrams[name]
    rpm = RPM_PER_RAD_S * diagram.speed
    for mode, column in enumerate(diagram.frequency_hz.T):
        axes.plot(rpm, column, color=QUIET, linewidth=0.8, zorder=1)
        points = axes.scatter(
            rpm,
            column,
            c=diagram.damping_ratio[:, mode],
            norm=norm,
            cmap="viridis_r",
            s=11,
            zorder=2,
        )
    for order in ORDERS:
        axes.plot(rpm, order * rpm / 60.0, "--", color=MARK, linewidth=1.0)
        _label_order(axes, order, rpm[-1], top)
    _mark_critical(axes, result, name)
    _mark_run_up(axes, result)
    axes.set_xlim(0.0, 1.16 * rpm[-1])
    axes.set_ylim(0.0, top)
    _label_modes(axes, result, name, float(rpm[-1]))
    axes.set_title(TITLES[name], loc="left", fontsize=10.5, fontweight="bold")
    axes.set_xlabel("drum speed, rpm", fontsize=9.5)
    axes.grid(color=GRID)
    style_axes(axes)
    return points


def _label_order(axes: Axes, order: float, last_rpm: float, top: float) -> None:
    rpm = min(0.93 * last_rpm, 0.93 * top * 60.0 / order)
    axes.annotate(
        f"{order:g}×",
        (rpm, order * rpm / 60.0),
        xytext=(-4, 5),
        textcoords="offset points",
        ha="right",
        fontsize=9.5,
        fontweight="bold",
    )


def _mark_critical(axes: Axes, result: MachineModes, name: str) -> None:
    for critical in result.critical[name]:
        rpm = RPM_PER_RAD_S * critical.speed
        hertz = critical.order * rpm / 60.0
        axes.plot(rpm, hertz, "o", color=MEASURED, fillstyle="none", markersize=7, zorder=4)
        if critical.order == 1.0:
            axes.annotate(
                number(rpm, 0),
                (rpm, hertz),
                xytext=(4, -12),
                textcoords="offset points",
                fontsize=8,
                color=MEASURED,
            )


def _mark_run_up(axes: Axes, result: MachineModes) -> None:
    if result.run_up is None:
        return
    rpm = RPM_PER_RAD_S * result.run_up.critical_speed.values.ravel()
    rpm = np.unique(np.round(rpm[np.isfinite(rpm)]))
    axes.plot(rpm, rpm / 60.0, "v", color=OURS, markersize=5, alpha=0.75, zorder=3)


def _label_modes(axes: Axes, result: MachineModes, name: str, last_rpm: float) -> None:
    """Write the names of the modes at the right end, apart from each other."""
    ends = result.diagrams[name].frequency_hz[-1]
    least = 0.042 * axes.get_ylim()[1]
    order = np.argsort(ends)
    places = ends[order].copy()
    for index in range(1, len(places)):
        places[index] = max(places[index], places[index - 1] + least)
    for place, mode in zip(places, order, strict=True):
        axes.text(
            1.015 * last_rpm,
            place,
            result.modes[name][mode].name,
            fontsize=8.5,
            va="center",
            clip_on=False,
        )


def amplitude_figure(result: MachineModes) -> Figure:
    """Draw frequency and damping ratio of each mode over its amplitude."""
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    upper, lower = figure.subplots(1, 2)
    for colour, mode in zip(COLOURS, result.over_amplitude, strict=False):
        millimetres = MM_PER_M * mode.amplitude
        upper.plot(millimetres, mode.frequency_hz, color=colour, linewidth=1.8, label=mode.name)
        lower.plot(millimetres, mode.damping_ratio, color=colour, linewidth=1.8)
    for axes, text in ((upper, "frequency, Hz"), (lower, "damping ratio")):
        axes.set_xscale("log")
        axes.axvline(MM_PER_M * result.amplitude, color=MARK, linestyle=":", linewidth=1.2)
        axes.set_xlabel("amplitude, mm", fontsize=9.5)
        axes.set_ylabel(text, fontsize=9.5)
        axes.set_ylim(bottom=0.0)
        axes.grid(color=GRID)
        style_axes(axes)
    figure.legend(loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return figure


def shapes_figure(modes: list[Mode], outlines: Mapping[str, Outline]) -> Figure:
    """Draw the tub in each mode, in three views: at rest, and at both ends of the motion."""
    figure = Figure(figsize=(WIDTH, 5.9), layout="constrained")
    panels = figure.subplots(3, len(modes), squeeze=False)
    lines = tub_lines(outlines)
    reach = max(float(np.abs(line).max()) for line in lines)
    for column, mode in enumerate(modes):
        ends = _ends_of_motion(mode, lines, reach)
        for row, (view, across, up) in enumerate(VIEWS):
            axes = panels[row, column]
            for pose, colour, width in zip(
                ends, (QUIET, OURS, MEASURED), (0.8, 1.2, 1.2), strict=True
            ):
                axes.plot(pose[:, across], pose[:, up], color=colour, linewidth=width)
            limit = 1.35 * reach
            axes.set_xlim(-limit, limit)
            axes.set_ylim(-limit, limit)
            axes.set_aspect("equal")
            axes.set_xticks([])
            axes.set_yticks([])
            axes.spines[:].set_color(GRID)
            if not column:
                axes.set_ylabel(f"{view}\n{'xyz'[up]} over {'xyz'[across]}", fontsize=9)
        panels[0, column].set_title(
            f"{mode.name}\n{number(mode.frequency_hz, 2)} Hz, ζ {number(mode.damping_ratio, 3)}",
            fontsize=9.5,
        )
    return figure


def tub_lines(outlines: Mapping[str, Outline]) -> list[FloatArray]:
    """Return lines (n, 3) in T that show the tub: circles and generators of its largest cylinder.

    Without a cylinder among the shapes they are those of one of 0.5 m diameter and 0.35 m length.
    """
    rounds = [outline for outline in outlines.values() if outline.is_round]
    largest = max(rounds, key=lambda outline: float(np.prod(outline.half)), default=None)
    if largest is None:
        axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
        largest = Outline(np.zeros(3), axes, np.array([0.25, 0.25, 0.175]), is_round=True)
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    ends = [circle * [1.0, 1.0, side] for side in (-1.0, 1.0)]
    sides = [np.stack([ends[0][k], ends[1][k]]) for k in range(0, 48, 6)]
    return [largest.centre + (line * largest.half) @ largest.axes for line in (*ends, *sides)]


def joined(points: FloatArray, lines: list[FloatArray]) -> FloatArray:
    """Return points of lines as one line with gaps, which is drawn faster than many lines.

    Args:
        points: Points of all lines, one line after the other. (n, k)
        lines: Lines, for the number of points of each.
    """
    ends = np.cumsum([len(line) for line in lines])[:-1]
    return np.insert(points, ends, np.nan, axis=0)


def _ends_of_motion(mode: Mode, lines: list[FloatArray], reach: float) -> list[FloatArray]:
    """Return the lines at rest and at both ends of the motion, enlarged to be seen."""
    points = np.concatenate(lines)
    poses = np.outer([1e-3, 0.0], mode.real_shape)
    moved = point_positions(poses, points)
    largest = float(np.abs(moved[0] - moved[1]).max())
    scale = 1e-3 * SHOWN_MOTION * reach / largest
    poses = np.outer([0.0, scale, -scale], mode.real_shape)
    return [joined(pose, lines) for pose in point_positions(poses, points)]


def energy_figure(result: MachineModes) -> Figure:
    """Draw which elements store the strain energy of each mode, and which dissipate energy."""
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    rows = ((SLIDING, panels[0]), (STUCK, panels[1]))
    elements = [name.replace("_", " ") for name in result.elements]
    shades = _shades(len(elements))
    for name, row in rows:
        modes = result.modes[name]
        for axes, kind in zip(row, ("strain_energy", "dissipation"), strict=True):
            left = np.zeros(len(modes))
            for index, element in enumerate(elements):
                shares = np.array([max(getattr(mode, kind)[index], 0.0) for mode in modes])
                axes.barh(
                    range(len(modes)),
                    100.0 * shares,
                    left=left,
                    color=shades[index],
                    label=element,
                    edgecolor="white",
                    linewidth=0.4,
                )
                left += 100.0 * shares
            axes.set_yticks(range(len(modes)), [mode.name for mode in modes], fontsize=9)
            axes.invert_yaxis()
            axes.set_xlim(0.0, 102.0)
            words = "strain energy" if kind == "strain_energy" else "dissipation"
            axes.set_title(f"{words}, {TITLES[name]}, %", loc="left", fontsize=9.5)
            style_axes(axes)
            axes.invert_yaxis() if axes is row[1] else None
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize=8.5)
    return figure


def _shades(count: int) -> list[tuple[float, float, float, float]]:
    import matplotlib as mpl

    return [tuple(c) for c in mpl.colormaps["tab20"](np.arange(count) % 20)]


def sensitivity_figure(result: MachineModes, name: str, quantity: str) -> Figure:
    """Draw the numbers that move each mode most, as sorted bars.

    Args:
        result: The modes.
        name: Linearisation.
        quantity: frequency or damping.
    """
    modes = result.modes[name]
    rows = -(-len(modes) // 2)
    figure = Figure(figsize=(WIDTH, 0.45 + 2.15 * rows), layout="constrained")
    panels = figure.subplots(rows, 2, squeeze=False).ravel()
    relative = [entry for entry in result.sensitivities[name] if not entry.per_unit]
    factor = 1.0 if quantity == "frequency" else 10.0
    for axes, index in zip(panels, range(len(modes)), strict=False):
        chosen = strongest(relative, quantity, index)
        values = [factor * float(getattr(entry, quantity)[index]) for entry in chosen]
        colours = [OURS if value >= 0.0 else MEASURED for value in values]
        axes.barh(range(len(chosen)), values, color=colours, height=0.7)
        axes.set_yticks(range(len(chosen)), [_short(entry.key) for entry in chosen], fontsize=8)
        axes.invert_yaxis()
        axes.axvline(0.0, color=MARK, linewidth=0.8)
        axes.grid(axis="x", color=GRID)
        axes.set_title(modes[index].name, loc="left", fontsize=9.5, fontweight="bold")
        style_axes(axes)
        axes.tick_params(axis="x", labelsize=8)
    for axes in panels[len(modes) :]:
        axes.set_axis_off()
    text = (
        "change of the frequency in % for 1 % more"
        if quantity == "frequency"
        else "change of the damping ratio in 0.001 for 1 % more"
    )
    figure.supxlabel(text, fontsize=9.5)
    return figure


def strongest(entries: list[Sensitivity], quantity: str, mode: int) -> list[Sensitivity]:
    """Return the numbers that a mode depends on most, strongest first."""
    ranked = sorted(entries, key=lambda entry: -abs(float(getattr(entry, quantity)[mode])))
    return ranked[:SHOWN_NUMBERS]


def _short(key: str) -> str:
    """Return a key path that fits beside a bar: without the group that its name follows."""
    parts = key.split(".")
    return ".".join(parts[1:] if parts[0].endswith("_types") else parts)
