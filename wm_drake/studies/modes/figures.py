"""Figures of the modes of a machine."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from wm_drake.model.scene import Outline
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.simulation.outputs import point_positions
from wm_drake.studies.modes.sensitivity import Sensitivity
from wm_drake.studies.modes.shapes import UNDAMPED, Mode
from wm_drake.studies.modes.study import ORDERS, SLIDING, STUCK, MachineModes

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
    ratios = np.concatenate([d.damping_ratio.ravel() for d in result.diagrams.values()])
    scale = fig.Scale(low=0.0, high=max(0.05, float(np.nanmax(ratios))), shades="-viridis")
    top = 1.08 * max(float(np.nanmax(d.frequency_hz)) for d in result.diagrams.values())
    panels = [_campbell(result, name, scale, top) for name in (SLIDING, STUCK)]
    panels[-1] = replace(
        panels[-1], marks=tuple(_with_bar(mark, scale) for mark in panels[-1].marks)
    )
    return fig.Figure(panels=fig.in_grid(panels, 2, share="y"), height=430.0)


def _with_bar(mark: fig.Mark, scale: fig.Scale) -> fig.Mark:
    """Return a mark whose colours are explained by a colour bar beside the panel."""
    if not isinstance(mark, fig.Points) or mark.scale is None:
        return mark
    return replace(mark, scale=replace(scale, label="damping ratio"))


def _campbell(result: MachineModes, name: str, scale: fig.Scale, top: float) -> fig.Panel:
    """Return the diagram of one linearisation.

    Args:
        top: Highest frequency. [Hz]
    """
    diagram = result.diagrams[name]
    rpm = RPM_PER_RAD_S * diagram.speed
    last = float(rpm[-1])
    marks: list[fig.Mark] = []
    for mode, column in enumerate(diagram.frequency_hz.T):
        marks.append(fig.Line(rpm, column, color=fig.QUIET, width=1.1))
        for words, part in stretches([of_speed[mode] for of_speed in result.names[name]]):
            ratios = diagram.damping_ratio[part, mode]
            points = fig.Points(rpm[part], column[part], values=ratios, name=words)
            marks.append(replace(points, scale=scale, size=5.0))
    for order in ORDERS:
        key = "order of the drum speed"
        marks.append(fig.Line(rpm, order * rpm / 60.0, color=fig.MARK, dash="dashed", key=key))
        at = min(0.93 * last, 0.93 * top * 60.0 / order)
        text = fig.Text(at, order * at / 60.0, f"{order:g}×", is_bold=True, across="right")
        marks.append(replace(text, up="bottom", shift=(-5.0, 6.0)))
    marks += _critical_marks(result, name, top)
    if result.run_up is not None:
        speeds = RPM_PER_RAD_S * result.run_up.critical_speed.values.ravel()
        speeds = np.unique(np.round(speeds[np.isfinite(speeds)]))
        key = "largest amplitude of a sensor in a run-up"
        marks.append(
            fig.Points(speeds, speeds / 60.0, symbol="triangle-down", opacity=0.75, key=key)
        )
    marks += _mode_names(result, name, last, top)
    speeds = fig.round_numbers(0.0, last, 6)
    ticks = fig.named((f"{speed:g}" for speed in speeds), speeds)
    x = fig.Axis(label="drum speed, rpm", range=(-LEFT * last, (1.0 + RIGHT) * last), ticks=ticks)
    y = fig.Axis(label="natural frequency, Hz", range=(0.0, top))
    return fig.Panel(title=TITLES[name], marks=tuple(marks), x=x, y=y)


LEFT, RIGHT = 0.2, 0.36
"""Room for the names of modes at both ends of a diagram, as parts of its largest speed."""

NEAR_LABELS = 0.035
"""Distance of two critical speeds, as a part of the axis of frequencies, below which they share a
label."""


def _critical_marks(result: MachineModes, name: str, top: float) -> list[fig.Mark]:
    critical = result.critical[name]
    if not critical:
        return []
    rpm = np.array([RPM_PER_RAD_S * one.speed for one in critical])
    hertz = np.array([one.order for one in critical]) * rpm / 60.0
    key = "critical speed"
    marks: list[fig.Mark] = [
        fig.Points(rpm, hertz, color=fig.MEASURED, is_open=True, size=10.0, key=key)
    ]
    of_drum = sorted(float(x) for one, x in zip(critical, rpm, strict=True) if one.order == 1.0)
    groups: list[list[float]] = []
    for x in of_drum:
        if groups and x - groups[-1][-1] < 60.0 * NEAR_LABELS * top:
            groups[-1].append(x)
        else:
            groups.append([x])
    for group in groups:
        words = ", ".join(number(x, 0) for x in group)
        text = fig.Text(group[-1], group[-1] / 60.0, words, color=fig.MEASURED, size=11.0)
        marks.append(replace(text, across="left", up="top", shift=(6.0, -4.0)))
    return marks


def stretches(names: Sequence[str]) -> list[tuple[str, slice]]:
    """Return each name of a sequence with the places next to each other that have it."""
    changes = [at for at in range(1, len(names)) if names[at] != names[at - 1]]
    bounds = itertools.pairwise([0, *changes, len(names)])
    return [(names[begin], slice(begin, end)) for begin, end in bounds]


def _mode_names(result: MachineModes, name: str, last_rpm: float, top: float) -> list[fig.Mark]:
    """Return the names of the modes at standstill and at the right end, apart from each other."""
    hertz, names = result.diagrams[name].frequency_hz, result.names[name]
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
            fig.Text(x * last_rpm, float(place), names[end][mode], size=12.0, across=side)
            for place, mode in zip(places, order, strict=True)
        ]
    return marks


def amplitude_figure(result: MachineModes) -> fig.Figure:
    """Return frequency and damping ratio of each mode over its amplitude."""
    panels = []
    for label, quantity in (("frequency, Hz", "frequency_hz"), ("damping ratio", "damping_ratio")):
        marks: list[fig.Mark] = [
            fig.Line(
                MM_PER_M * mode.amplitude,
                _without_rounding(getattr(mode, quantity)),
                color=color,
                key=mode.name,
            )
            for color, mode in zip(fig.COLOURS, result.over_amplitude, strict=False)
        ]
        marks.append(fig.Rule(MM_PER_M * result.amplitude, "y", color=fig.MARK, dash="dotted"))
        x, y = (
            fig.Axis(label="amplitude, mm", is_log=True),
            fig.Axis(label=label, range=(0.0, None)),
        )
        panels.append(fig.Panel(name=label.split(",")[0], marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, 2), height=310.0)


def _without_rounding(values: FloatArray) -> FloatArray:
    """Return values with 0 in place of errors of rounding, which would set the scale of an axis."""
    return np.where(np.abs(values) > UNDAMPED, values, 0.0)


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
                hertz, ratio = number(mode.frequency_hz, 2), number(mode.damping_ratio, 3)
                damping = f"ζ {ratio}" if abs(mode.damping_ratio) > UNDAMPED else "undamped"
                panel = replace(panel, title=mode.name, subtitle=f"{hertz} Hz\n{damping}")
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
    elements = [name.replace("_", " ") for name in result.elements]
    panels = []
    for name in (SLIDING, STUCK):
        modes = result.modes[name]
        y = fig.Axis(ticks=fig.named(mode.name for mode in modes), has_grid=False)
        y = replace(y, range=(len(modes) - 0.5, -0.5))
        for kind, words in (("strain_energy", "strain energy"), ("dissipation", "dissipation")):
            left, marks = np.zeros(len(modes)), []
            for index, element in enumerate(elements):
                share = 100.0 * np.array([max(getattr(m, kind)[index], 0.0) for m in modes])
                bars = fig.Bars(range(len(modes)), share, base=left, is_across=True, key=element)
                marks.append(replace(bars, color=ELEMENT_COLOURS[index % len(ELEMENT_COLOURS)]))
                left = left + share
            title = f"{words}, {TITLES[name]}, %"
            panels.append(
                fig.Panel(title=title, marks=tuple(marks), x=fig.Axis(range=(0, 102)), y=y)
            )
    placed = fig.in_grid(panels, 2, share="y")
    return fig.Figure(panels=placed, height=30.0 * len(result.modes[SLIDING]) + 30.0)


def sensitivity_figure(result: MachineModes, name: str, quantity: str) -> fig.Figure:
    """Return the numbers that move each mode most, as sorted bars.

    Args:
        quantity: frequency or damping.
    """
    modes = result.modes[name]
    relative = [entry for entry in result.sensitivities[name] if not entry.per_unit]
    factor = 1.0 if quantity == "frequency" else 10.0
    panels = []
    for index, mode in enumerate(modes):
        chosen = strongest(relative, quantity, index)
        changes = np.array([getattr(entry, quantity)[index] for entry in chosen])
        values = [factor * float(change) for change in _without_rounding(changes)]
        colors = tuple(fig.OURS if value >= 0.0 else fig.MEASURED for value in values)
        bars = fig.Bars(range(len(chosen)), values, colors=colors, is_across=True)
        names = fig.named(_short(entry.key) for entry in chosen)
        y = fig.Axis(ticks=names, range=(len(chosen) - 0.5, -0.5), has_grid=False, size=11.0)
        marks = (bars, fig.Rule(0.0, "y", color=fig.MARK))
        panels.append(fig.Panel(title=mode.name, marks=marks, y=y))
    text = (
        "change of the frequency in % for 1 % more"
        if quantity == "frequency"
        else "change of the damping ratio in 0.001 for 1 % more"
    )
    return fig.Figure(panels=fig.in_grid(panels, 2), height=150.0, x_label=text)


def strongest(entries: list[Sensitivity], quantity: str, mode: int) -> list[Sensitivity]:
    """Return the numbers that a mode depends on most, strongest first."""
    ranked = sorted(entries, key=lambda entry: -abs(float(getattr(entry, quantity)[mode])))
    return ranked[:SHOWN_NUMBERS]


def _short(key: str) -> str:
    """Return a key path that fits beside a bar: without the group that its name follows."""
    parts = key.split(".")
    return ".".join(parts[1:] if parts[0].endswith("_types") else parts)
