"""Figures of the steady unbalance response."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.model.scene import Outline
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.simulation.outputs import point_positions
from wm_drake.studies.modes.figures import VIEWS, joined, tub_lines, view_axis, view_panel
from wm_drake.studies.response.study import SteadyCase, SteadyStudy

COLUMNS = 3
"""Number of panels in a row."""

SHOWN_MOTION = 0.2
"""Largest displacement of a drawn deflection shape, as part of the tub's radius."""


def response_figure(cases: list[SteadyCase]) -> fig.Figure:
    """Return the amplitudes of a load at the sensors over the speed, with the run-up beside them.

    Args:
        cases: The same load with and without gasket, or one of them.
    """
    x = fig.Axis(label="drum speed, rpm")
    y = fig.Axis(label="amplitude, mm", range=(0.0, _shown_amplitude(cases)))
    panels = []
    for sensor in map(str, cases[0].response.sensor.values):
        marks: list[fig.Mark] = []
        for case in cases:
            color = fig.OURS if case.gasket else fig.MEASURED
            marks += _run_up(case, sensor, color)
            amplitude = MM_PER_M * case.response.amplitude.sel(sensor=sensor).values
            marks += _branch(case, amplitude, color)
        panels.append(fig.Panel(title=sensor, marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="both"), height=160.0)


def _shown_amplitude(cases: list[SteadyCase]) -> float | None:
    """Return the upper end of the amplitudes: above what is reached, steady or in the run. [mm]

    Unstable motions may be much larger.
    """
    sizes = [case.largest()[0] for case in cases]
    sizes += [_run_up_size(case.run_up) for case in cases if case.run_up is not None]
    largest = max(float(np.nanmax(size, initial=0.0)) for size in sizes)
    return 1.25 * MM_PER_M * largest or None


def _branch(case: SteadyCase, values: FloatArray, color: str) -> list[fig.Mark]:
    """Return a quantity along the branch: lines where it is stable, dots where it is not.

    The line is pale where the tub touches the housing.
    """
    rpm = RPM_PER_RAD_S * case.response.speed.values
    key = f"steady, {'with' if case.gasket else 'without'} gasket"
    line = fig.Line(rpm, values, color=color)
    kinds = (
        (case.reachable, replace(line, width=2.4, key=key)),
        (case.stable & case.touches, replace(line, width=2.4, opacity=0.35, key="in contact")),
        (~case.stable, replace(line, width=2.0, dash="dotted", key="unstable")),
    )
    marks: list[fig.Mark] = []
    for index, (of_kind, style) in enumerate(kinds):
        shown = of_kind.copy()
        if index:  # reach to the points beside it, which are of another kind
            shown[:-1] |= of_kind[1:]
            shown[1:] |= of_kind[:-1]
        if of_kind.any():
            marks.append(replace(style, y=np.where(shown, values, np.nan)))
    return marks


def _run_up(case: SteadyCase, sensor: str, color: str) -> list[fig.Mark]:
    if case.run_up is None:
        return []
    run = case.run_up.sel(sensor=sensor)
    size = _run_up_size(run)
    rising = np.append(np.diff(run.speed.values) > 0.0, False)
    rpm = RPM_PER_RAD_S * run.speed.values[rising][::5]
    line = fig.Line(rpm, MM_PER_M * size[rising][::5], color=color, opacity=0.45, dash="long")
    return [replace(line, key="spin profile of the machine")]


def _run_up_size(run_up: xr.Dataset) -> FloatArray:
    """Return the larger one of both envelopes. [m]"""
    return np.maximum(np.abs(run_up.upper.values), np.abs(run_up.lower.values))


def forces_figure(cases: list[SteadyCase]) -> fig.Figure:
    """Return displacement of the box and forces of the gasket over the speed, one line a load."""
    quantities = (
        ("detergent_displacement", MM_PER_M, "detergent box, mm"),
        ("gasket_force", 1.0, "gasket force, N"),
        ("gasket_moment", 1.0, "gasket moment, N m"),
    )
    panels = []
    for name, factor, title in quantities:
        lines = [(case, factor * case.response[name].values.max(axis=1)) for case in cases]
        panels.append(_force_panel(title, lines, []))
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="x"), height=210.0)


def mounts_figure(cases: list[SteadyCase]) -> fig.Figure:
    """Return the force of each mount on the cabinet over the speed, one colour a load.

    The peak is a line, the RMS without the mean is dashed.
    """
    gasket = any(case.gasket for case in cases)
    mounts = [str(name) for name in cases[0].response.mount.values if gasket or name != "gasket"]
    panels = []
    for mount in mounts:
        of_mount = [(case, case.response.sel(mount=mount)) for case in cases]
        peaks = [(case, force.mount_force_peak.values) for case, force in of_mount]
        dynamic = [(case, force.mount_force_dynamic_rms.values) for case, force in of_mount]
        panel = _force_panel(mount, peaks, dynamic)
        panels.append(replace(panel, y=replace(panel.y, label="force, N")))
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="x"), height=160.0)


def _force_panel(
    title: str,
    peaks: list[tuple[SteadyCase, FloatArray]],
    dynamic: list[tuple[SteadyCase, FloatArray]],
) -> fig.Panel:
    """Return values over the speed of cases, one colour a load; those of `dynamic` are dashed.

    A line has gaps where no steady motion is reachable.
    """
    colors = colors_of_loads([case.load for case, _ in peaks])
    marks = []
    kinds: tuple[tuple[fig.Dash, list[tuple[SteadyCase, FloatArray]]], ...] = (
        ("", peaks),
        ("dashed", dynamic),
    )
    for dash, lines in kinds:
        for case, values in lines:
            rpm = RPM_PER_RAD_S * case.response.speed.values
            shown = np.where(case.reachable, values, np.nan)
            line = fig.Line(rpm, shown, color=colors[case.load], width=2.0, key=case.load)
            marks.append(replace(line, dash=dash))
    y = fig.Axis(range=(0.0, None))
    return fig.Panel(title=title, marks=tuple(marks), x=fig.Axis(label="drum speed, rpm"), y=y)


def colors_of_loads(loads: list[str]) -> dict[str, str]:
    """Return a colour for each load, in order of appearance."""
    names = dict.fromkeys(loads)
    return {name: fig.COLOURS[index % len(fig.COLOURS)] for index, name in enumerate(names)}


def peaks_of(case: SteadyCase, most: int = 3) -> list[int]:
    """Return the points of the largest reachable peaks, in order of speed."""
    size = case.response.amplitude.values.max(axis=1)
    inner = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    inner = inner[case.reachable[inner]]
    largest = inner[np.argsort(-size[inner])][:most]
    return sorted(int(index) for index in largest)


def deflection_figure(case: SteadyCase, outlines: Mapping[str, Outline]) -> fig.Figure | None:
    """Return the operating deflection shapes at the peaks of a load; None without a peak."""
    points = peaks_of(case)
    if not points:
        return None
    lines = tub_lines(outlines)
    panels = []
    for index in points:
        row = _deflection(case.response.first_harmonic.values[index], lines)
        rpm = RPM_PER_RAD_S * float(case.response.speed.values[index])
        largest = MM_PER_M * float(case.response.amplitude.values[index].max())
        title = f"{number(rpm, 0)} rpm, {number(largest, 1)} mm"
        panels += [replace(row[0], title=title), *row[1:]]
    return fig.Figure(panels=fig.in_grid(panels, len(VIEWS)), height=260.0)


def _deflection(harmonic: FloatArray, lines: list[FloatArray]) -> list[fig.Panel]:
    """Return the tub at rest, and its two ends at eight angles of the drum, in each view.

    Args:
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
    panels = []
    for view, across, up in VIEWS:
        marks: list[fig.Mark] = [
            fig.Line(still[:, across], still[:, up], color=fig.QUIET, width=1.0)
        ]
        for opacity, pose in zip(np.linspace(0.9, 0.25, len(turn)), shown, strict=True):
            line = fig.Line(pose[:, across], pose[:, up], opacity=float(opacity))
            marks.append(line)
        label = f"{view}: {'xyz'[up]} over {'xyz'[across]}"
        panels.append(replace(view_panel(tuple(marks), reach), x=view_axis(reach, label)))
    return panels


def sweep_figure(study: SteadyStudy) -> fig.Figure:
    """Return how sweeps shift and lower the peak of each load, at its largest sensor."""
    assert study.sweeps is not None
    colors = colors_of_loads([case.load for case in study.cases])
    rate = RPM_PER_RAD_S * study.sweeps.rate.values
    shifts: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)]
    heights: list[fig.Mark] = [fig.Rule(100.0, color=fig.MARK)]
    directions: tuple[tuple[str, fig.Dash, str], ...] = (
        ("up", "", "triangle-up"),
        ("down", "dashed", "triangle-down"),
    )
    for load, color in colors.items():
        case = next(case for case in study.cases if case.load == load)
        sizes, speeds = case.largest()
        if np.isnan(sizes).all():
            continue
        at = int(np.argmax(sizes))
        sensor, speed = str(case.response.sensor.values[at]), RPM_PER_RAD_S * float(speeds[at])
        chosen = study.sweeps.sel(load=load, gasket=case.gasket, sensor=sensor)
        for direction, dash, symbol in directions:
            one = chosen.sel(direction=direction)
            shift = RPM_PER_RAD_S * one.speed.values - speed
            height = 100.0 * one.amplitude.values / sizes[at]
            for marks, y in ((shifts, shift), (heights, height)):
                line = fig.Line(rate, y, color=color, dash=dash, symbol=symbol)
                marks.append(replace(line, key=f"{load}, {sensor}, {direction}"))
    ticks = fig.named((f"{value:g}" for value in np.round(rate, 3)), rate)
    x = fig.Axis(label="sweep rate, rpm/s", is_log=True, ticks=ticks)
    titles = ("speed of the peak less that of the steady peak, rpm", "peak in % of the steady peak")
    panels = [
        fig.Panel(subtitle=title, name=title, marks=tuple(marks), x=x)
        for title, marks in zip(titles, (shifts, heights), strict=True)
    ]
    return fig.Figure(panels=fig.in_grid(panels, 2), height=300.0)
