"""Figures of a gasket: its curves, cuts through the deformed wall, the ring from the side."""

import math
from collections.abc import Iterator

import numpy as np

from wm_drake.parameters.gasket_drawing import Rubber, tension_stress
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, MPA_PER_PA
from wm_drake.solid.curves import Curve, Point
from wm_drake.solid.mesh import Ring, axes_at
from wm_drake.solid.touching import Faces
from wm_drake.studies.rig.units import units_of

TITLES = {
    "axial": "axial, along y",
    "radial": "radial, along x and z",
    "twist": "twist, about y",
    "tilt": "tilt, about x and z",
}
"""Titles of the curves by the names of the motions."""

AROUND = 25
"""Columns of nodes of the half ring that stands for a wedge in the view."""

YAW, ELEVATION = math.radians(35.0), math.radians(30.0)
"""Direction of the view: turned from the front to the side, and from above."""


def curves_figure(curves: dict[str, Curve]) -> fig.Figure:
    """Draw force over displacement and moment over angle, with the slope of the first 20 %."""
    panels = []
    for name, curve in curves.items():
        unit, table = units_of(curve.motion.rotates), curve.table
        finer = np.linspace(curve.values[0], curve.values[-1], 121)
        slope = fig.Line(
            unit.factor * finer,
            table.nominal_stiffness * finer,
            color=fig.QUIET,
            dash="dashed",
            key="slope of the first 20 %",
        )
        between = fig.Line(
            unit.factor * finer, table.values(finer), key="table of the machine file"
        )
        points = fig.Line(
            unit.factor * curve.values, curve.wrench(), width=0.0, symbol="circle", key="equilibria"
        )
        marks: tuple[fig.Mark, ...] = (fig.Rule(0.0, color=fig.QUIET), slope, between, points)
        x, y = fig.Axis(label=unit.label("displacement")), fig.Axis(label=unit.force_label)
        panels.append(fig.Panel(title=TITLES[name], marks=marks, x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, 2), height=230.0)


def rubber_figure(rubber: Rubber) -> fig.Figure | None:
    """Draw the tension test of a rubber and the fitted curve; None without a test."""
    if rubber.test is None:
        return None
    measured = np.array(rubber.test.stretch)
    stretch = np.linspace(min(1.0, measured.min()), measured.max(), 100)
    curve = MPA_PER_PA * tension_stress(stretch, rubber.constants)
    stress = MPA_PER_PA * np.array(rubber.test.stress)
    marks = (
        fig.Line(stretch, curve, color=fig.OURS, key="fit"),
        fig.Points(measured, stress, color=fig.MEASURED, key="test"),
    )
    panel = fig.Panel(marks=marks, x=fig.Axis(label="stretch"), y=fig.Axis(label="stress, MPa"))
    return fig.Figure(panels=(panel,), height=240.0, keys=("test", "fit"))


def sections_figure(curves: dict[str, Curve]) -> fig.Figure:
    """Draw cuts through the wall at rest and at both ends, one panel for each side of the axis."""
    panels = []
    for name, curve in curves.items():
        columns = dict.fromkeys((0, curve.ring.grid.shape[1] - 1))
        for column, side in zip(columns, ("x > 0", "x < 0"), strict=False):
            panel = fig.Panel(
                title=TITLES[name],
                subtitle=side if len(columns) > 1 else "all around",
                marks=tuple(_cuts(curve, column)),
                x=fig.Axis(label="across, mm"),
                y=fig.Axis(label="y, mm"),
                is_square=True,
            )
            panels.append(panel)
    return fig.Figure(panels=fig.in_grid(panels, 3), height=300.0)


def _cuts(curve: Curve, column: int) -> Iterator[fig.Mark]:
    """Yield the outlines of the wall in a cut: as drawn, and at both ends."""
    rest = curve.points[len(curve.points) // 2]
    for point, color, key in (
        (rest, fig.QUIET, "as drawn"),
        (curve.points[0], fig.MEASURED, "at the negative end"),
        (curve.points[-1], fig.OURS, "at the positive end"),
    ):
        outline = MM_PER_M * _outline(curve.ring, point, column)
        yield fig.Line(*outline.T, color=color, key=key, width=1.2)
        touching = Faces(curve.ring).touching(point.u).in_column(column)
        radius, y = MM_PER_M * touching.places.T
        side = -1.0 if column else 1.0
        if len(y):
            yield fig.Points(side * radius, y, color=color, symbol="square", size=4.0)


def rings_figure(curves: dict[str, Curve]) -> fig.Figure:
    """Draw half of the ring from the side at both ends of each curve, by lines of its mesh."""
    panels = []
    for name, curve in curves.items():
        unit = units_of(curve.motion.rotates)
        for point in (curve.points[0], curve.points[-1]):
            lines = np.concatenate(list(_mesh_lines(_surface(curve.ring, point.u))))
            mark = fig.Line(*(MM_PER_M * lines).T, color=fig.OURS, width=0.7)
            blank = fig.Axis(ticks=(), has_grid=False, has_line=False)
            title = f"{name}, {unit.text(point.value)}"
            panels.append(fig.Panel(title=title, marks=(mark,), x=blank, y=blank, is_square=True))
    return fig.Figure(panels=fig.in_grid(panels, 2), height=210.0)


def _outline(ring: Ring, point: Point, column: int) -> FloatArray:
    """Return the closed outline of the wall in a cut: x and y of its nodes. (n, 2) [m]"""
    places = (ring.positions + point.u)[ring.grid[:, column]][..., :2]
    return np.concatenate([places[:, 0], places[-1], places[::-1, 2], places[0][::-1]])


def _surface(ring: Ring, u: FloatArray) -> FloatArray:
    """Return the places of the outer nodes of half a ring. (along, around, 3) [m]"""
    places = (ring.positions + u)[ring.grid[:, :, 0]]
    if ring.grid.shape[1] > 1:
        return np.asarray(places)
    turns = [axes_at(angle) for angle in np.linspace(0.0, math.pi, AROUND)]
    return np.stack([places[:, 0] @ turn.T for turn in turns], axis=1)


def _mesh_lines(places: FloatArray) -> Iterator[FloatArray]:
    """Yield the lines of a mesh in the plane of the view, to and fro along its edges. (n, 2) [m]"""
    x, y, z = np.moveaxis(places, -1, 0)
    right = x * math.cos(YAW) + y * math.sin(YAW)
    away = -x * math.sin(YAW) + y * math.cos(YAW)
    seen = np.stack([right, z * math.cos(ELEVATION) + away * math.sin(ELEVATION)], axis=-1)
    along = seen[:: max(1, seen.shape[0] // 20)]
    for lines in (along, np.swapaxes(seen, 0, 1)):
        for number, line in enumerate(lines):
            yield line[:: -1 if number % 2 else 1]
        yield np.full((1, 2), np.nan)
