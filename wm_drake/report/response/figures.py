"""Figures of the steady unbalance response."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wm_drake.model.scene import Outline
from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.report.modes.figures import COLOURS, VIEWS, joined, tub_lines
from wm_drake.simulation.outputs import point_positions
from wm_drake.studies.steady.study import SteadyCase, SteadyStudy

COLUMNS = 3
"""Number of panels in a row."""

SHOWN_MOTION = 0.2
"""Largest displacement of a drawn deflection shape, as part of the tub's radius."""


def response_figure(cases: list[SteadyCase]) -> Figure:
    """Draw the amplitudes of a load at the sensors over the speed, with the run-up beside them.

    Args:
        cases: The same load with and without gasket, or one of them.
    """
    sensors = [str(name) for name in cases[0].response.sensor.values]
    rows = -(-len(sensors) // COLUMNS)
    figure = Figure(figsize=(WIDTH, 2.35 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False, sharex=True, sharey=True).ravel()
    for axes, sensor in zip(panels, sensors, strict=False):
        for case in cases:
            colour = OURS if case.gasket else MEASURED
            _draw_run_up(axes, case, sensor, colour)
            amplitude = MM_PER_M * case.response.amplitude.sel(sensor=sensor).values
            _draw_branch(axes, case, amplitude, colour)
        axes.set_title(sensor, fontsize=10, loc="left", fontweight="bold", parse_math=False)
        axes.grid(color=GRID)
        style_axes(axes)
    _finish(panels, len(sensors), rows, "drum speed, rpm", "amplitude, mm")
    panels[0].set_ylim(bottom=0.0)
    _legend(figure, cases)
    return figure


def _draw_branch(axes: Axes, case: SteadyCase, values: FloatArray, colour: str) -> None:
    """Draw a quantity along the branch: a line where it is stable, dashes where it is not."""
    rpm = RPM_PER_RAD_S * case.response.speed.values
    stable = case.response.stable.values.astype(bool)
    for kept, style, width in ((stable, "-", 1.8), (~stable, (0, (2, 1.5)), 1.4)):
        shown = kept.copy()
        shown[:-1] |= kept[1:] if style != "-" else False
        shown[1:] |= kept[:-1] if style != "-" else False
        line = np.where(shown, values, np.nan)
        axes.plot(rpm, line, linestyle=style, color=colour, linewidth=width)


def _draw_run_up(axes: Axes, case: SteadyCase, sensor: str, colour: str) -> None:
    if case.run_up is None:
        return
    run = case.run_up.sel(sensor=sensor)
    size = np.maximum(np.abs(run.upper.values), np.abs(run.lower.values))
    rising = np.append(np.diff(run.speed.values) > 0.0, False)
    axes.plot(
        RPM_PER_RAD_S * run.speed.values[rising][::5],
        MM_PER_M * size[rising][::5],
        color=colour,
        alpha=0.45,
        linewidth=1.0,
        linestyle=(0, (6, 1.5)),
    )


def _legend(figure: Figure, cases: list[SteadyCase]) -> None:
    handles = [
        Line2D(
            [],
            [],
            color=OURS if case.gasket else MEASURED,
            linewidth=1.8,
            label=f"steady, {'with' if case.gasket else 'without'} gasket",
        )
        for case in cases
    ]
    if any(not case.response.stable.values.all() for case in cases):
        handles.append(
            Line2D([], [], color=QUIET, linestyle=(0, (2, 1.5)), linewidth=1.4, label="unstable")
        )
    if any(case.run_up is not None for case in cases):
        handles.append(
            Line2D(
                [],
                [],
                color=QUIET,
                linestyle=(0, (6, 1.5)),
                linewidth=1.0,
                label="spin profile of the machine",
            )
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)


def _finish(panels: FloatArray, used: int, rows: int, across: str, up: str) -> None:
    for axes in panels[used:]:
        axes.set_axis_off()
    for axes in panels[max(0, used - COLUMNS) : used]:
        axes.set_xlabel(across, fontsize=9)
        axes.tick_params(labelbottom=True)
    for axes in panels[::COLUMNS][:rows]:
        axes.set_ylabel(up, fontsize=9)


def forces_figure(cases: list[SteadyCase]) -> Figure:
    """Draw displacement of the box and forces of the gasket over the speed, one line a load."""
    figure = Figure(figsize=(WIDTH, 3.1), layout="constrained")
    panels = figure.subplots(1, COLUMNS, sharex=True)
    quantities = (
        ("detergent_displacement", MM_PER_M, "detergent box, mm"),
        ("gasket_force", 1.0, "gasket force, N"),
        ("gasket_moment", 1.0, "gasket moment, N m"),
    )
    for axes, (name, factor, title) in zip(panels, quantities, strict=True):
        lines = [(case, factor * case.response[name].values.max(axis=1), "-") for case in cases]
        _force_panel(axes, title, lines)
    _finish(panels, len(quantities), 0, "drum speed, rpm", "")
    _load_legend(figure, panels[0])
    return figure


def mounts_figure(cases: list[SteadyCase]) -> Figure:
    """Draw the force of each mount on the cabinet over the speed, one colour a load.

    The peak is a line, the RMS without the mean is dashed.
    """
    gasket = any(case.gasket for case in cases)
    mounts = [str(name) for name in cases[0].response.mount.values if gasket or name != "gasket"]
    rows = -(-len(mounts) // COLUMNS)
    figure = Figure(figsize=(WIDTH, 2.35 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False, sharex=True).ravel()
    for axes, mount in zip(panels, mounts, strict=False):
        of_mount = [(case, case.response.sel(mount=mount)) for case in cases]
        lines = [(case, force.mount_force_peak.values, "-") for case, force in of_mount]
        lines += [(case, force.mount_force_dynamic_rms.values, "--") for case, force in of_mount]
        _force_panel(axes, mount, lines)
    _finish(panels, len(mounts), rows, "drum speed, rpm", "force, N")
    _load_legend(figure, panels[0])
    return figure


def _force_panel(axes: Axes, title: str, lines: list[tuple[SteadyCase, FloatArray, str]]) -> None:
    """Draw values over the speed of cases, one colour a load.

    Args:
        axes: Panel.
        title: Title of the panel.
        lines: Case, values, and line style; only solid lines are named in a legend.
    """
    loads = list(dict.fromkeys(case.load for case, _, _ in lines))
    colours = dict(zip(loads, _cycle(len(loads)), strict=True))
    for case, values, style in lines:
        axes.plot(
            RPM_PER_RAD_S * case.response.speed.values,
            values,
            color=colours[case.load],
            linewidth=1.5 if style == "-" else 1.2,
            linestyle=style,
            label=case.load if style == "-" else "_",
        )
    axes.set_title(title, fontsize=9.5, loc="left", parse_math=False)
    axes.set_ylim(bottom=0.0)
    axes.grid(color=GRID)
    style_axes(axes)


def _load_legend(figure: Figure, axes: Axes) -> None:
    figure.legend(
        *axes.get_legend_handles_labels(),
        loc="outside lower center",
        ncols=6,
        frameon=False,
        fontsize=9,
    )


def _cycle(count: int) -> list[str]:
    return [COLOURS[index % len(COLOURS)] for index in range(count)]


def peaks_of(case: SteadyCase, most: int = 3) -> list[int]:
    """Return the points of the largest peaks of the largest amplitude, in order of speed."""
    size = case.response.amplitude.values.max(axis=1)
    inner = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    largest = inner[np.argsort(-size[inner])][:most]
    return sorted(int(index) for index in largest)


def deflection_figure(case: SteadyCase, outlines: Mapping[str, Outline]) -> Figure | None:
    """Draw the operating deflection shapes at the peaks of a load; None without a peak."""
    points = peaks_of(case)
    if not points:
        return None
    figure = Figure(figsize=(WIDTH, 0.5 + 3.0 * len(points)), layout="constrained")
    panels = figure.subplots(len(points), len(VIEWS), squeeze=False)
    lines = tub_lines(outlines)
    for row, index in zip(panels, points, strict=True):
        _draw_deflection(row, case.response.first_harmonic.values[index], lines)
        rpm = RPM_PER_RAD_S * float(case.response.speed.values[index])
        largest = MM_PER_M * float(case.response.amplitude.values[index].max())
        row[0].set_title(
            f"{number(rpm, 0)} rpm, {number(largest, 1)} mm",
            loc="left",
            fontsize=10,
            fontweight="bold",
        )
    return figure


def _draw_deflection(panels: FloatArray, harmonic: FloatArray, lines: list[FloatArray]) -> None:
    """Draw the tub at rest, and its two ends at eight angles of the drum, in each view.

    Args:
        panels: One for each view.
        harmonic: First harmonic of the pose of the tub. (6, 2)
        lines: Lines that show the tub; the first two are its ends.
    """
    reach = max(float(np.abs(line).max()) for line in lines)
    rest, ends = np.concatenate(lines), np.concatenate(lines[:2])
    turn = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    poses = np.outer(np.cos(turn), harmonic[:, 0]) + np.outer(np.sin(turn), harmonic[:, 1])
    moved = point_positions(poses, rest) - rest
    scale = SHOWN_MOTION * reach / float(np.abs(moved).max())
    shown = [joined(pose, lines[:2]) for pose in point_positions(scale * poses, ends)]
    still = joined(rest, lines)
    for axes, (view, across, up) in zip(panels, VIEWS, strict=True):
        axes.plot(still[:, across], still[:, up], color=QUIET, linewidth=0.7)
        for shade, pose in zip(np.linspace(0.9, 0.25, len(turn)), shown, strict=True):
            axes.plot(pose[:, across], pose[:, up], color=OURS, alpha=shade, linewidth=1.0)
        axes.set_xlim(-1.35 * reach, 1.35 * reach)
        axes.set_ylim(-1.35 * reach, 1.35 * reach)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_color(GRID)
        axes.set_xlabel(f"{view}: {'xyz'[up]} over {'xyz'[across]}", fontsize=8.5)


def sweep_figure(study: SteadyStudy) -> Figure:
    """Draw how sweeps shift and lower the peak of each load, at its largest sensor."""
    assert study.sweeps is not None
    figure = Figure(figsize=(WIDTH, 4.3), layout="constrained")
    left, right = figure.subplots(1, 2)
    loads = list(dict.fromkeys(case.load for case in study.cases))
    for colour, load in zip(_cycle(len(loads)), loads, strict=True):
        case = next(case for case in study.cases if case.load == load)
        peak = case.response.amplitude.max("point")
        sensor = str(peak.sensor.values[int(np.argmax(peak.values))])
        values = case.response.amplitude.sel(sensor=sensor).values
        speed = RPM_PER_RAD_S * float(case.response.speed.values[int(np.argmax(values))])
        chosen = study.sweeps.sel(load=load, gasket=case.gasket, sensor=sensor)
        rate = RPM_PER_RAD_S * study.sweeps.rate.values
        for direction, style, mark in (("up", "-", "^"), ("down", (0, (5, 2)), "v")):
            one = chosen.sel(direction=direction)
            left.plot(
                rate,
                RPM_PER_RAD_S * one.speed.values - speed,
                linestyle=style,
                marker=mark,
                color=colour,
                markersize=5,
            )
            right.plot(
                rate,
                100.0 * one.amplitude.values / values.max(),
                linestyle=style,
                marker=mark,
                color=colour,
                markersize=5,
                label=f"{load}, {sensor}, {direction}",
            )
    for axes, title in (
        (left, "speed of the peak less that of the steady peak, rpm"),
        (right, "peak in % of the steady peak"),
    ):
        axes.set_xscale("log")
        axes.set_xticks(rate, [f"{value:g}" for value in np.round(rate, 3)])
        axes.minorticks_off()
        axes.set_xlabel("sweep rate, rpm/s", fontsize=9.5)
        axes.set_title(title, loc="left", fontsize=9.5)
        axes.grid(color=GRID)
        style_axes(axes)
    left.axhline(0.0, color=MARK, linewidth=0.8)
    right.axhline(100.0, color=MARK, linewidth=0.8)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8.5)
    return figure
