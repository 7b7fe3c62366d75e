"""Show the curves of a gasket: tables, page, and what a machine file gets."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import MachineParameters, machine_yaml
from wm_drake.parameters.files import machine_tree, yaml_text
from wm_drake.parameters.gasket_drawing import GasketDrawing, Rubber, tension_stress
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, MPA_PER_PA, number, percent, plain, significant
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, line
from wm_drake.report.terminal import Printed
from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST, Curve, CurvePoint, Mesh, RimMotion
from wm_drake.solid.mesh import Ring, axes_at
from wm_drake.solid.touching import Faces
from wm_drake.studies.gasket_curves.study import Checked, coupling
from wm_drake.studies.rig.units import units_of
from wm_drake.studies.study import Facts, Result

METHOD = (
    "Finite elements of the rubber in large deformation, nearly incompressible. The rim at the "
    "housing is clamped, that at the tub moves as a rigid body about its centre on the axis. The "
    "axial and twist curves are those of a thin wedge, the radial and tilt curves those of half a "
    "ring. The force is that on the moved rim in its direction of motion; moments are about its "
    "moved centre. Folds that touch hold each other off without friction, unless the drawing has "
    "contact: false. There is no pressure of water, no set of the rubber, and no beads or ribs "
    "that the drawing does not have. Damping: loss modulus by modulus, times stiffness by "
    "2 π f, at the frequency below."
)

AXES: dict[str, tuple[RimMotion, str]] = {
    "x": (RADIAL, ""),
    "y": (AXIAL, ""),
    "z": (RADIAL, ""),
    "about_x": (TILT, "rotational_"),
    "about_y": (TWIST, "rotational_"),
    "about_z": (TILT, "rotational_"),
}
"""Motion of each axis of a bushing, and the beginning of its keys in a machine file."""

LARGEST_WORK_ERROR = 0.01
"""Difference of work and strain energy above which a curve has too few points."""


@dataclass(frozen=True)
class GasketCurvesResult(Result):
    """Curves of a gasket.

    Attributes:
        name: Name or file of the drawing.
        curves: Its curves by the names of the motions.
        frequency: Frequency of the loss factor. [Hz]
        machine: The machine with this gasket.
    """

    name: str
    drawing: GasketDrawing
    mesh: Mesh
    curves: dict[str, Checked]
    frequency: float
    machine: MachineParameters

    @property
    def by_motion(self) -> dict[str, Curve]:
        """The curves without their checks."""
        return {name: checked.curve for name, checked in self.curves.items()}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the curves, what follows from them, and their checks."""
        return {
            "curves": curves_table(self),
            "values": values_table(self),
            "checks": checks_table(self),
        }

    def as_json(self) -> dict[str, Any]:
        """Return the tables and the coupling for JSON."""
        rubber = self.drawing.rubber
        shown = {
            "gasket": self.name,
            "elements": [self.mesh.meridian, self.mesh.around],
            "shear_modulus_Pa": 2.0 * rubber.constants[0],
            "storage_modulus": rubber.modulus(self.frequency).real,
            "loss_modulus": rubber.modulus(self.frequency).imag,
            "frequency_hz": self.frequency,
            "values": values_table(self).to_dict("records"),
            "coupling_x_about_z_N": coupling(self.by_motion),
            "curves": curves_table(self).to_dict("records"),
            "checks": checks_table(self).replace({np.nan: None}).to_dict("records"),
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Return stiffness and damping."""
        return [values_shown(self).terminal(f"Gasket {self.name}"), summary(self)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        drawn, sections, rings = _pictures(self.by_motion)
        links = (
            ("gasket.yaml", "section gasket of a machine file"),
            ("machine.yaml", "machine with this gasket"),
        )
        made = [
            ("Drawing", f"{self.name}: {self.drawing.about}"),
            ("Rubber", _rubber_text(self)),
            ("Frequency of the damping", f"{significant(self.frequency)} Hz"),
            (
                "Mesh",
                f"{self.mesh.meridian} by {self.mesh.around} elements of half the ring, "
                f"{3 * self.mesh.meridian} of the wedge; 27 nodes each",
            ),
            *facts.rows(),
        ]
        return SectionedPage(
            f"Curves of gasket {self.name}",
            summary(self),
            [
                Section("curves", "Curves", (drawn,)),
                Section("cuts", "Cuts through the wall", (sections,)),
                Section("rings", "Deformed ring", (rings,)),
                *_rubber_section(self),
                Section("values", "Stiffness and damping", tables=(values_shown(self),)),
                Section("checks", "Checks", tables=(_checks_shown(self),)),
                Section("files", "Files", links=links),
            ],
            made,
            warnings=(*facts.warnings, *self.warnings(), *self.failures()),
            about="From the drawing and the rubber to the numbers of a machine file.",
            method=METHOD,
        ).html()

    def write(self, folder: Path) -> None:
        """Write the tables, the section `gasket` of a machine file, and the machine with it."""
        super().write(folder)
        section = yaml_text({"gasket": machine_tree(self.machine)["gasket"]})
        (folder / "gasket.yaml").write_text(section, encoding="utf-8")
        (folder / "machine.yaml").write_text(machine_yaml(self.machine), encoding="utf-8")

    def warnings(self) -> Sequence[str]:
        """Return where the curves are less than what a real gasket does."""
        contact = self.drawing.contact
        return [text for one in self.curves.values() for text in _warnings_of(one, contact)]

    def failures(self) -> Sequence[str]:
        """Return where a curve ends early; what was computed is kept."""
        stopped = (checked.curve.stopped for checked in self.curves.values())
        return [f"{text}; the curve ends there, and its other points are kept" for text in stopped
                if text]  # fmt: skip


def _warnings_of(checked: Checked, has_contact: bool) -> Iterable[str]:
    name, rotates = checked.curve.motion.name, checked.curve.motion.rotates
    unit = Unit("rad", "deg") if rotates else Unit("m", "mm")

    def listed(values: FloatArray) -> str:
        shown = [f"{unit.from_si(value):.3g}" for value in values if np.isfinite(value)]
        return f"{' and '.join(shown)} {unit.shown}"

    if np.isfinite(checked.touches_at).any() and not has_contact:
        yield (
            f"{name}: folds overlap from {listed(checked.touches_at)} on; the drawing has no "
            "contact between folds, so the real gasket is stiffer there"
        )
    if np.isfinite(checked.wrinkles_at).any():
        yield (
            f"{name}: the wall wrinkles from {listed(checked.wrinkles_at)} on; wrinkles need "
            "a fine mesh around (--around)"
        )
    if checked.curve.falls:
        yield f"{name}: the force falls; the table of the machine file stays level there"
    if checked.curve.work_error() > LARGEST_WORK_ERROR:
        yield (
            f"{name}: the work of the rim differs from the strain energy by "
            f"{100.0 * checked.curve.work_error():.2g} %; use more --points"
        )


def curves_table(result: GasketCurvesResult) -> pd.DataFrame:
    """Return each point: force on the moved rim along its motion, along the others, energy, work.

    The motions are those of x (radial), y (axial), about y (twist) and about z (tilt).
    """
    frames = []
    for name, checked in result.curves.items():
        curve = checked.curve
        unit = units_of(curve.motion.rotates)
        frame = pd.DataFrame(
            {
                "curve": name,
                "value": unit.factor * curve.values,
                "unit": unit.unit,
                "force_x_N": curve.wrench(RADIAL.component),
                "force_y_N": curve.wrench(AXIAL.component),
                "moment_y_Nm": curve.wrench(TWIST.component),
                "moment_z_Nm": curve.wrench(TILT.component),
                "energy_J": [point.energy for point in curve.points],
                "work_J": curve.work(),
            }
        )
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def values_table(result: GasketCurvesResult) -> pd.DataFrame:
    """Return stiffness and damping of the six axes, in SI."""
    rows = []
    for axis, (motion, kind) in AXES.items():
        curve = result.curves[motion.name].curve
        key = f"{kind}damping_{axis[-1]}"
        rows.append(
            {
                "axis": axis,
                "stiffness_at_rest": curve.slope_at_rest(),
                "stiffness_first_20_percent": curve.table.nominal_stiffness,
                "damping": getattr(result.machine.gasket, key),
                "unit_of_stiffness": "N*m/rad" if motion.rotates else "N/m",
            }
        )
    return pd.DataFrame(rows)


def checks_table(result: GasketCurvesResult) -> pd.DataFrame:
    """Return stretch, stress, error of the work, touching folds and wrinkles of each curve."""
    rows = []
    for name, checked in result.curves.items():
        unit = units_of(checked.curve.motion.rotates)
        rows.append(
            {
                "curve": name,
                "unit": unit.unit,
                "from": unit.factor * checked.curve.values[0],
                "to": unit.factor * checked.curve.values[-1],
                "stretch_at_begin": checked.begin.stretch,
                "stretch_at_end": checked.end.stretch,
                "stress_at_begin_MPa": MPA_PER_PA * checked.begin.stress,
                "stress_at_end_MPa": MPA_PER_PA * checked.end.stress,
                "work_error": checked.curve.work_error(),
                "folds_touch_from": unit.factor * checked.touches_at[0],
                "folds_touch_to": unit.factor * checked.touches_at[1],
                "largest_overlap_in_thicknesses": checked.depth,
                "wrinkles_from": unit.factor * checked.wrinkles_at[0],
                "wrinkles_to": unit.factor * checked.wrinkles_at[1],
                "stopped": checked.curve.stopped,
            }
        )
    return pd.DataFrame(rows)


def _pictures(curves: dict[str, Curve]) -> tuple[Picture, Picture, Picture]:
    """Return the curves, the cuts through the wall and the deformed rings."""
    drawn = picture(
        curves_figure(curves),
        "Four panels: axial and radial force over displacement, twist and tilt moment over angle.",
        "Force on the moved rim over its displacement, and moment over its angle. By symmetry the "
        "radial curve is that of x and z, the tilt curve that about x and z: six curves in all.",
    )
    sections = picture(
        sections_figure(curves),
        "Cuts through the wall as drawn and at both ends of each curve.",
        "Cuts through the wall in the plane of the motion, to scale. Squares: folds touch.",
    )
    rings = picture(
        rings_figure(curves),
        "Half of the ring at both ends of each curve.",
        "Half of the ring at both ends of each curve, to scale: lines of the mesh, seen from the "
        "side and above.",
    )
    return drawn, sections, rings


def _rubber_section(result: GasketCurvesResult) -> list[Section]:
    """Return the section of the tension test; none without one."""
    rubber = result.drawing.rubber
    figure = rubber_figure(rubber)
    if figure is None or rubber.test is None:
        return []
    deviation = f"{significant(100.0 * rubber.test.deviation, 2)} %"
    about = (
        "Stress of the rubber in tension, force over first cross-section, over the stretch. The "
        f"root mean square of fit less test is {deviation} of the largest stress."
    )
    return [Section("rubber", "Rubber", (picture(figure, "Stress over stretch.", about),))]


def summary(result: GasketCurvesResult) -> str:
    """Return the result in a few sentences."""
    slopes = {
        name: checked.curve.table.nominal_stiffness for name, checked in result.curves.items()
    }
    largest = max(max(c.begin.stretch, c.end.stretch) for c in result.curves.values())
    worst = max(checked.curve.work_error() for checked in result.curves.values())
    axial, radial = (slopes[motion.name] / MM_PER_M for motion in (AXIAL, RADIAL))
    both = coupling(result.by_motion)
    return (
        f"Slopes of the first 20 %: radial {significant(radial, 3)} N/mm, axial "
        f"{significant(axial, 3)} N/mm, twist {significant(slopes[TWIST.name], 3)} N m/rad, tilt "
        f"{significant(slopes[TILT.name], 3)} N m/rad. A radial displacement gives a moment too: "
        f"{significant(both, 3)} N m/m about z along x. The largest stretch is "
        f"{number(largest, 2)}. Work of the rim and strain energy agree within "
        f"{significant(100.0 * worst, 2)} %."
    )


def _rubber_text(result: GasketCurvesResult) -> str:
    rubber = result.drawing.rubber
    c1, c2, c3 = (significant(MPA_PER_PA * value, 3) for value in rubber.constants)
    modulus = rubber.modulus(result.frequency)
    hardness = "" if rubber.shore_a is None else f"{rubber.shore_a:g} Shore A, "
    return (
        f"{hardness}constants of Yeoh {c1}, {c2}, {c3} MPa, bulk modulus "
        f"{significant(MPA_PER_PA * rubber.bulk, 3)} MPa. At the frequency of the damping its "
        f"storage and loss modulus are {significant(modulus.real, 3)} and "
        f"{significant(modulus.imag, 3)} of the modulus of the curves"
    )


def values_shown(result: GasketCurvesResult) -> Table:
    """Return stiffness and damping of the six axes in units for reading."""
    groups = []
    for row in values_table(result).to_dict("records"):
        motion, _ = AXES[row["axis"]]
        per = 1.0 if motion.rotates else 1.0 / MM_PER_M
        cells = (
            "N m/rad" if motion.rotates else "N/mm",
            significant(per * row["stiffness_at_rest"], 4),
            significant(per * row["stiffness_first_20_percent"], 4),
            significant(per * row["damping"], 3),
            percent(_change(result, motion.name, 0)),
            percent(_change(result, motion.name, -1)),
        )
        groups.append(line(row["axis"].replace("_", " "), cells))
    header = (
        "axis", "unit of stiffness", "stiffness at rest", "first 20 %", "damping, times s",
        "secant at the negative end", "at the positive end",
    )  # fmt: skip
    caption = (
        "Stiffness: slope at rest, and slope of the line through the first 20 % of the curve as in "
        "[B]. The last columns compare the secant at both ends of the curve with the slope at rest."
    )
    return Table(caption, header, tuple(groups), text_columns=2)


def _change(result: GasketCurvesResult, name: str, end: int) -> float:
    """Return the secant stiffness at an end against the slope at rest. [%]"""
    curve = result.curves[name].curve
    secant = float(curve.wrench()[end] / curve.values[end])
    return 100.0 * (secant / curve.slope_at_rest() - 1.0)


def _checks_shown(result: GasketCurvesResult) -> Table:
    groups = []
    for name, checked in result.curves.items():
        unit = units_of(checked.curve.motion.rotates)
        cells = (
            unit.unit,
            *(unit.factor * checked.curve.values[[0, -1]]),
            max(checked.begin.stretch, checked.end.stretch),
            MPA_PER_PA * max(checked.begin.stress, checked.end.stress),
            100.0 * checked.curve.work_error(),
            *(unit.factor * checked.touches_at),
            100.0 * checked.depth,
            *(unit.factor * checked.wrinkles_at),
        )
        groups.append(line(name, cells))
    header = (
        "curve", "unit", Column("from", decimals=2), Column("to", decimals=2),
        Column("largest stretch", decimals=3), Column("largest stress", "MPa", 3),
        Column("work less energy", "%", 3), Column("folds touch below", decimals=2),
        Column("folds touch above", decimals=2), Column("overlap", "% of wall", 2),
        Column("wrinkles below", decimals=2),
        Column("wrinkles above", decimals=2),
    )  # fmt: skip
    caption = (
        "Stretch: largest principal stretch at both ends. Stress: equivalent stress of von Mises. "
        "Folds touch: at the first points where they do; the overlap is that of the soft contact."
    )
    return Table(caption, header, tuple(groups), text_columns=2)


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


def _outline(ring: Ring, point: CurvePoint, column: int) -> FloatArray:
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
        for place, edge in enumerate(lines):
            yield edge[:: -1 if place % 2 else 1]
        yield np.full((1, 2), np.nan)
