"""Figures of the modes of a machine."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import xarray as xr

from wm_drake.model.scene import Outline
from wm_drake.parameters.types import FloatArray
from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.quantity import SPEED, quantity_of, shown
from wm_drake.simulation.outputs import point_positions
from wm_drake.studies.modes.linearisation import SLIDING, STUCK
from wm_drake.studies.modes.quantities import (
    AMPLITUDE,
    DAMPING,
    FREQUENCY,
    without_rounding,
)
from wm_drake.studies.modes.sensitivity import RELATIVE
from wm_drake.studies.modes.shapes import Mode
from wm_drake.studies.modes.study import ORDERS, MachineModes

VIEWS = (("front", 0, 2), ("side", 1, 2), ("top", 0, 1))
"""Views of the tub, with the coordinate across and the one upwards."""

SHOWN_MOTION = 0.18
"""Largest displacement of a drawn mode shape, as part of the tub's radius."""

SHOWN_NUMBERS = 8
"""Number of bars of a panel."""

TITLES = {SLIDING: "friction slides", STUCK: "friction sticks"}

ELEMENT_COLOURS = (
    "#1f77b4", "#aec7e8",
    "#ff7f0e", "#ffbb78",
    "#2ca02c", "#98df8a",
    "#d62728", "#ff9896",
    "#9467bd", "#c5b0d5",
    "#8c564b", "#c49c94",
    "#e377c2", "#f7b6d2",
    "#7f7f7f", "#c7c7c7",
    "#bcbd22", "#dbdb8d",
    "#17becf", "#9edae5",
)  # fmt: skip
"""Colours of elements: ten hues, each dark and light."""


def campbell_figure(result: MachineModes) -> fig.Figure:
    """Return the Campbell diagrams: natural frequencies over the speed, coloured by damping."""
    diagrams = result.over_speed
    high = max(0.05, float(diagrams.damping_ratio.max()))
    scale = fig.Scale(low=0.0, high=high, shades="-viridis")
    top = 1.08 * float(diagrams.frequency.max())
    panels = [_campbell(result, name, scale, top) for name in (SLIDING, STUCK)]
    panels[-1] = replace(
        panels[-1], marks=tuple(_with_bar(mark, scale) for mark in panels[-1].marks)
    )
    return fig.Figure(panels=fig.in_grid(panels, 2, share="y"), height=430.0)


def _with_bar(mark: fig.Mark, scale: fig.Scale) -> fig.Mark:
    """Return a mark whose colours are explained by a colour bar beside the panel."""
    if not isinstance(mark, fig.Points) or mark.scale is None:
        return mark
    return replace(mark, scale=replace(scale, label=DAMPING.label))


def _campbell(result: MachineModes, name: str, scale: fig.Scale, top: float) -> fig.Panel:
    """Return the diagram of one linearisation.

    Args:
        top: Highest frequency. [Hz]
    """
    diagram = result.over_speed.sel(linearisation=name)
    speeds = shown(diagram.speed)
    last, fastest = float(speeds[-1]), float(diagram.speed[-1])
    marks: list[fig.Mark] = []
    for _, curve in diagram.dropna("curve", how="all", subset=["frequency"]).groupby("curve"):
        one = curve.squeeze("curve")
        marks.append(fig.Line(speeds, shown(one.frequency), color=fig.QUIET, width=1.1))
        for words, part in stretches(one.mode.values.tolist()):
            x, y = speeds[part], shown(one.frequency[part])
            points = fig.Points(x, y, values=shown(one.damping_ratio[part]), name=words)
            marks.append(replace(points, scale=scale, size=5.0))
    for order in ORDERS:
        key = "order of the drum speed"
        y = _hertz(order * diagram.speed.values)
        marks.append(fig.Line(speeds, y, color=fig.MARK, dash="dashed", key=key))
        at = min(0.93 * fastest, 0.93 * top * 2.0 * np.pi / order)
        place = float(SPEED.values(at)), float(_hertz(order * at))
        text = fig.Text(*place, f"{order:g}×", is_bold=True, across="right")
        marks.append(replace(text, up="bottom", shift=(-5.0, 6.0)))
    marks += _critical_marks(result, name, top)
    if result.run_up is not None:
        peaks = SPEED.values(result.run_up.critical_speed.values.ravel())
        peaks = np.unique(np.round(peaks[np.isfinite(peaks)]))
        key = "largest amplitude of a sensor in a run-up"
        y = _hertz(SPEED.unit.to_si(peaks))
        marks.append(fig.Points(peaks, y, symbol="triangle-down", opacity=0.75, key=key))
    marks += _mode_names(diagram, last, top)
    rounds = fig.round_numbers(0.0, last, 6)
    ticks = fig.named((f"{speed:g}" for speed in rounds), rounds)
    x_range = (-LEFT * last, (1.0 + RIGHT) * last)
    x_axis = fig.Axis(label=SPEED.label, range=x_range, ticks=ticks)
    y_axis = fig.Axis(label=FREQUENCY.label, range=(0.0, top))
    return fig.Panel(title=TITLES[name], marks=tuple(marks), x=x_axis, y=y_axis)


def _hertz(speed: FloatArray | float) -> FloatArray:
    """Return the turns a second of a speed. [rad/s]"""
    return np.asarray(speed) / (2.0 * np.pi)


LEFT, RIGHT = 0.2, 0.36
"""Room for the names of modes at both ends of a diagram, as parts of its largest speed."""

NEAR_LABELS = 0.035
"""Distance of two critical speeds, as a part of the axis of frequencies, below which they share a
label."""


def _critical_marks(result: MachineModes, name: str, top: float) -> list[fig.Mark]:
    critical = result.critical.isel(row=(result.critical.linearisation == name).values)
    if not critical.sizes["row"]:
        return []
    hertz = _hertz((critical.order * critical.speed).values)
    key = "critical speed"
    marks: list[fig.Mark] = [
        fig.Points(
            shown(critical.speed), hertz, color=fig.MEASURED, is_open=True, size=10.0, key=key
        )
    ]
    groups: list[list[float]] = []
    for speed in sorted(critical.speed.values[(critical.order == 1.0).values].tolist()):
        if groups and _hertz(speed - groups[-1][-1]) < NEAR_LABELS * top:
            groups[-1].append(speed)
        else:
            groups.append([speed])
    for group in groups:
        x, y = float(SPEED.values(group[-1])), float(_hertz(group[-1]))
        words = ", ".join(map(SPEED.number, group))
        text = fig.Text(x, y, words, color=fig.MEASURED, size=11.0)
        marks.append(replace(text, across="left", up="top", shift=(6.0, -4.0)))
    return marks


def stretches(names: Sequence[str]) -> list[tuple[str, slice]]:
    """Return each name of a sequence with the places next to each other that have it."""
    changes = [at for at in range(1, len(names)) if names[at] != names[at - 1]]
    bounds = itertools.pairwise([0, *changes, len(names)])
    return [(names[begin], slice(begin, end)) for begin, end in bounds]


def _mode_names(diagram: xr.Dataset, last: float, top: float) -> list[fig.Mark]:
    """Return the names of the modes at standstill and at the right end, apart from each other."""
    hertz, names = diagram.frequency.values, diagram.mode.values
    marks: list[fig.Mark] = []
    ends: tuple[tuple[int, float, Literal["left", "right"]], ...] = (
        (0, -0.015, "right"),
        (-1, 1.015, "left"),
    )
    for end, x, side in ends:
        known = np.flatnonzero(np.isfinite(hertz[end]))
        order = known[np.argsort(hertz[end][known])]
        places = hertz[end][order]
        for index in range(1, len(places)):
            places[index] = max(places[index], places[index - 1] + 0.042 * top)
        marks += [
            fig.Text(x * last, float(place), str(names[end][mode]), size=12.0, across=side)
            for place, mode in zip(places, order, strict=True)
        ]
    return marks


def amplitude_figure(result: MachineModes) -> fig.Figure:
    """Return frequency and damping ratio of each mode over its amplitude."""
    data = result.over_amplitude
    damping = data.damping_ratio.copy(data=without_rounding(data.damping_ratio.values))
    data = data.assign(damping_ratio=damping)
    at = fig.Rule(float(AMPLITUDE.values(result.amplitude)), "y", color=fig.MARK, dash="dotted")
    panels = []
    for name in ("frequency", "damping_ratio"):
        x, y = {"is_log": True}, {"range": (0.0, None)}
        curves = chart.panel(data, "amplitude", [name], x=x, y=y, by="mode", key=_mode_of)
        panels.append(replace(chart.between((), curves, at), name=quantity_of(data[name]).words))
    return fig.Figure(panels=fig.in_grid(panels, 2), height=310.0)


def _mode_of(part: xr.Dataset, _: str) -> str:
    return str(part.mode.values[0])


def shapes_figure(modes: list[Mode], outlines: Mapping[str, Outline]) -> fig.Figure:
    """Return the tub in each mode, in three views: at rest, and at both ends of the motion."""
    lines = tub_lines(outlines)
    reach = max(float(np.abs(line).max()) for line in lines)
    ends = [_ends_of_motion(mode, lines, reach) for mode in modes]
    panels = []
    for row, (view, across, up) in enumerate(VIEWS):
        for column, (mode, poses) in enumerate(zip(modes, ends, strict=True)):
            marks = [
                fig.Line(pose[:, across], pose[:, up], color=color)
                for pose, color in zip(poses, (fig.QUIET, fig.OURS, fig.MEASURED), strict=True)
            ]
            label = "" if column else f"{view}: {'xyz'[up]} over {'xyz'[across]}"
            panel = replace(view_panel(tuple(marks), reach), y=view_axis(reach, label))
            if not row:
                symbol = "ζ " if mode.is_damped else ""
                damping = f"{symbol}{DAMPING.text(mode.damping_ratio)}"
                words = f"{FREQUENCY.text(mode.frequency_hz)}\n{damping}"
                panel = replace(panel, title=mode.name, subtitle=words)
            panels.append(panel)
    return fig.Figure(panels=fig.in_grid(panels, len(modes)), height=900.0 / len(modes))


def view_axis(reach: float, label: str = "") -> fig.Axis:
    """Return an axis of a view of the tub, without ticks. `reach`: largest coordinate. [m]"""
    return fig.Axis(label=label, range=(-1.35 * reach, 1.35 * reach), ticks=(), has_grid=False)


def view_panel(marks: tuple[fig.Mark, ...], reach: float) -> fig.Panel:
    """Return a view of the tub."""
    return fig.Panel(marks=marks, x=view_axis(reach), y=view_axis(reach), is_square=True)


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


def energy_figure(result: MachineModes) -> fig.Figure:
    """Return which elements store the strain energy of each mode, and which dissipate energy."""
    data, panels = result.labelled(), []
    for name in (SLIDING, STUCK):
        modes = data.isel(row=(data.linearisation == name).values)
        count = modes.sizes["row"]
        y = fig.Axis(ticks=fig.named(modes.mode.values.tolist()), has_grid=False)
        y = replace(y, range=(count - 0.5, -0.5))
        for kind in ("strain_energy", "dissipation"):
            left, marks = np.zeros(count), []
            for index, element in enumerate(result.elements):
                share = np.maximum(shown(modes[kind].isel(element=index)), 0.0)
                key = element.replace("_", " ")
                bars = fig.Bars(range(count), share, base=left, is_across=True, key=key)
                marks.append(replace(bars, color=ELEMENT_COLOURS[index % len(ELEMENT_COLOURS)]))
                left = left + share
            quantity = quantity_of(modes[kind])
            title = quantity.named(f"{quantity.words}, {TITLES[name]}").label
            panels.append(
                fig.Panel(title=title, marks=tuple(marks), x=fig.Axis(range=(0, 102)), y=y)
            )
    placed = fig.in_grid(panels, 2, share="y")
    return fig.Figure(panels=placed, height=30.0 * len(result.modes[SLIDING]) + 30.0)


def sensitivity_figure(result: MachineModes, name: str, change: str) -> fig.Figure:
    """Return the numbers that move each mode most, as sorted bars.

    Args:
        change: Variable of the sensitivities.
    """
    data, panels = result.sensitivities, []
    for mode in result.modes[name]:
        of_mode = (data.linearisation == name) & (data.mode == mode.name) & (data.per == RELATIVE)
        chosen = strongest(data.isel(row=of_mode.values), change)
        values = without_rounding(shown(chosen[change]))
        colors = tuple(fig.OURS if value >= 0.0 else fig.MEASURED for value in values)
        bars = fig.Bars(range(len(values)), values, colors=colors, is_across=True)
        names = fig.named(_short(key) for key in chosen.key.values)
        y = fig.Axis(ticks=names, range=(len(values) - 0.5, -0.5), has_grid=False, size=11.0)
        marks = (bars, fig.Rule(0.0, "y", color=fig.MARK))
        panels.append(fig.Panel(title=mode.name, marks=marks, y=y))
    label = quantity_of(data[change]).label
    return fig.Figure(panels=fig.in_grid(panels, 2), height=150.0, x_label=label)


def strongest(numbers: xr.Dataset, change: str) -> xr.Dataset:
    """Return the rows with the largest changes, strongest first."""
    order = np.argsort(-np.abs(numbers[change].values), kind="stable")
    return numbers.isel(row=order[:SHOWN_NUMBERS])


def _short(key: str) -> str:
    """Return a key path that fits beside a bar: without the group that its name follows."""
    parts = key.split(".")
    return ".".join(parts[1:] if parts[0].endswith("_types") else parts)
