"""Figures of the steady unbalance response."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.model.scene import Outline
from wm_drake.parameters.types import FloatArray
from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.quantity import SPEED, quantity_of, shown
from wm_drake.simulation.outputs import point_positions
from wm_drake.studies.modes.figures import VIEWS, joined, tub_lines, view_axis, view_panel
from wm_drake.studies.response.quantities import AMPLITUDE, FORCE, HEIGHT, RATE, SHIFT
from wm_drake.studies.response.study import GASKET, largest_of, peaks_of, run_amplitude

COLUMNS = 3
"""Number of panels in a row."""

SHOWN_MOTION = 0.2
"""Largest displacement of a drawn deflection shape, as part of the tub's radius."""


def response_figure(cases: Sequence[xr.Dataset]) -> fig.Figure:
    """Return the amplitudes of a load at the sensors over the speed, with the run-up beside them.

    Args:
        cases: The same load with and without gasket, or one of them.
    """
    x = fig.Axis(label=SPEED.label)
    y = fig.Axis(label=AMPLITUDE.label, range=(0.0, _shown_amplitude(cases)))
    panels = []
    for sensor in cases[0].sensor.values.tolist():
        marks: list[fig.Mark] = []
        for case in cases:
            color = fig.OURS if case.gasket == GASKET[True] else fig.MEASURED
            marks += _run_up(case, sensor, color) + _branch(case, sensor, color)
        panels.append(fig.Panel(title=sensor, marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="both"), height=160.0)


def _shown_amplitude(cases: Sequence[xr.Dataset]) -> float | None:
    """Return the upper end of the amplitudes: above what is reached, steady or in the run.

    Unstable motions may be much larger.
    """
    peaks = map(peaks_of, cases)
    sizes = [(peak.amplitude.values, peak.run_amplitude.values) for peak in peaks]
    return 1.25 * float(AMPLITUDE.values(np.nanmax(sizes, initial=0.0))) or None


def _branch(case: xr.Dataset, sensor: str, color: str) -> list[fig.Mark]:
    """Return the amplitude along the branch: lines where it is stable, dots where it is not.

    The line is pale where the tub touches the housing.
    """
    values, stable = shown(case.amplitude.sel(sensor=sensor)), case.stable.values
    line = fig.Line(shown(case.speed), values, color=color)
    steady = f"steady, {words_of_gasket(case)}"
    kinds = (
        (case.reachable.values, replace(line, width=2.4, key=steady)),
        (
            stable & ~case.reachable.values,
            replace(line, width=2.4, opacity=0.35, key="in contact"),
        ),
        (~stable, replace(line, width=2.0, dash="dotted", key="unstable")),
    )
    marks: list[fig.Mark] = []
    for index, (of_kind, style) in enumerate(kinds):
        drawn = of_kind.copy()
        if index:  # reach to the points beside it, which are of another kind
            drawn[:-1] |= of_kind[1:]
            drawn[1:] |= of_kind[:-1]
        if of_kind.any():
            marks.append(replace(style, y=np.where(drawn, values, np.nan)))
    return marks


def _run_up(case: xr.Dataset, sensor: str, color: str) -> list[fig.Mark]:
    if "time" not in case.sizes:
        return []
    run = case.sel(sensor=sensor)
    rising = np.append(np.diff(run.run_speed.values) > 0.0, False)
    at, size = shown(run.run_speed)[rising][::5], AMPLITUDE.values(run_amplitude(run))[rising][::5]
    line = fig.Line(at, size, color=color, opacity=0.45, dash="long")
    return [replace(line, key="spin profile of the machine")]


def load_of(case: xr.Dataset) -> str:
    """Return the name of the load of a case; a dataset has a method of this name."""
    return str(case["load"].item())


def words_of_gasket(case: xr.Dataset) -> str:
    """Return whether a case has the gasket, in words."""
    return "with gasket" if case.gasket == GASKET[True] else "without gasket"


def forces_figure(cases: Sequence[xr.Dataset]) -> fig.Figure:
    """Return displacement of the box and forces of the gasket over the speed, one line a load."""
    panels = []
    for name in ("detergent_displacement", "gasket_force", "gasket_moment"):
        peaks = [case.assign({name: case[name].max("axis", keep_attrs=True)}) for case in cases]
        title = quantity_of(cases[0][name]).label
        panels.append(_force_panel(title, peaks, {name: {}}, ""))
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="x"), height=210.0)


def mounts_figure(cases: Sequence[xr.Dataset]) -> fig.Figure:
    """Return the force of each mount on the cabinet over the speed, one colour a load.

    The peak is a line, the RMS without the mean is dashed.
    """
    has_gasket = any(case.gasket == GASKET[True] for case in cases)
    mounts = cases[0].mount.values.tolist()
    drawn = {"mount_force_peak": {}, "mount_force_dynamic_rms": {"dash": "dashed"}}
    panels = [
        _force_panel(mount, [case.sel(mount=mount) for case in cases], drawn, FORCE.label)
        for mount in mounts
        if has_gasket or mount != "gasket"
    ]
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS, share="x"), height=160.0)


def _force_panel(
    title: str,
    cases: Sequence[xr.Dataset],
    drawn: Mapping[str, Mapping[str, Any]],
    label: str,
) -> fig.Panel:
    """Return variables over the speed of cases, one colour a load.

    A line has gaps where no steady motion is reachable.

    Args:
        drawn: Variables with the style of their lines.
        label: Of the vertical axis.
    """
    colors, marks = colors_of_loads(cases), list[fig.Mark]()
    for name, style in drawn.items():
        for case in cases:
            load, reached = load_of(case), case[[name]].where(case.reachable)
            look = {"color": colors[load], "width": 2.0, "key": load, **style}
            marks += chart.marks_of(reached, "speed", {name: look})
    y = fig.Axis(label=label, range=(0.0, None))
    return fig.Panel(title=title, marks=tuple(marks), x=fig.Axis(label=SPEED.label), y=y)


def colors_of_loads(cases: Sequence[xr.Dataset]) -> dict[str, str]:
    """Return a colour for each load, in order of appearance."""
    names = dict.fromkeys(load_of(case) for case in cases)
    return {name: fig.COLOURS[index % len(fig.COLOURS)] for index, name in enumerate(names)}


def reachable_peaks(case: xr.Dataset, most: int = 3) -> list[int]:
    """Return the points of the largest reachable peaks, in order of speed."""
    size = case.amplitude.values.max(axis=1)
    inner = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    inner = inner[case.reachable.values[inner]]
    largest = inner[np.argsort(-size[inner])][:most]
    return sorted(int(index) for index in largest)


def deflection_figure(case: xr.Dataset, outlines: Mapping[str, Outline]) -> fig.Figure | None:
    """Return the operating deflection shapes at the peaks of a load; None without a peak."""
    points = reachable_peaks(case)
    if not points:
        return None
    lines = tub_lines(outlines)
    panels = []
    for index in points:
        at = case.isel(point=index)
        row = _deflection(at.first_harmonic.values, lines)
        title = f"{SPEED.text(at.speed)}, {AMPLITUDE.text(at.amplitude.max())}"
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
    drawn = [joined(pose, lines[:2]) for pose in point_positions(scale * poses, ends)]
    still = joined(rest, lines)
    panels = []
    for view, across, up in VIEWS:
        marks: list[fig.Mark] = [
            fig.Line(still[:, across], still[:, up], color=fig.QUIET, width=1.0)
        ]
        for opacity, pose in zip(np.linspace(0.9, 0.25, len(turn)), drawn, strict=True):
            line = fig.Line(pose[:, across], pose[:, up], opacity=float(opacity))
            marks.append(line)
        label = f"{view}: {'xyz'[up]} over {'xyz'[across]}"
        panels.append(replace(view_panel(tuple(marks), reach), x=view_axis(reach, label)))
    return panels


def sweep_figure(cases: Sequence[xr.Dataset], sweeps: xr.Dataset) -> fig.Figure:
    """Return how sweeps shift and lower the peak of each load, at its largest sensor."""
    rate = shown(sweeps.rate)
    shifts: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)]
    heights: list[fig.Mark] = [fig.Rule(float(HEIGHT.values(1.0)), color=fig.MARK)]
    directions: tuple[tuple[str, fig.Dash, str], ...] = (
        ("up", "", "triangle-up"),
        ("down", "dashed", "triangle-down"),
    )
    for load, color in colors_of_loads(cases).items():
        case = next(case for case in cases if load_of(case) == load)
        peaks = largest_of(case)
        if peaks.amplitude.isnull().all():
            continue
        peak = peaks.isel(sensor=int(peaks.amplitude.argmax("sensor")))
        sensor = peak.sensor.item()
        chosen = sweeps.sel(load=load, gasket=case.gasket.item(), sensor=sensor)
        for direction, dash, symbol in directions:
            one = chosen.sel(direction=direction)
            shift = SHIFT.values(one.speed.values - peak.speed.item())
            height = HEIGHT.values(one.amplitude.values / peak.amplitude.item())
            for marks, y in ((shifts, shift), (heights, height)):
                line = fig.Line(rate, y, color=color, dash=dash, symbol=symbol)
                marks.append(replace(line, key=f"{load}, {sensor}, {direction}"))
    ticks = fig.named((f"{value:g}" for value in np.round(rate, 3)), rate)
    x = fig.Axis(label=RATE.label, is_log=True, ticks=ticks)
    panels = [
        fig.Panel(subtitle=title, name=title, marks=tuple(marks), x=x)
        for title, marks in ((SHIFT.label, shifts), (HEIGHT.label, heights))
    ]
    return fig.Figure(panels=fig.in_grid(panels, 2), height=300.0)
