"""Show the curves of a gasket, and what a machine file gets."""

import math
from collections.abc import Iterable, Iterator

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, machine_yaml
from wm_drake.parameters.files import machine_tree, yaml_text
from wm_drake.parameters.gasket_drawing import GasketDrawing, Rubber, tension_stress
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import significant
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity, text_of
from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST, Curve, CurvePoint
from wm_drake.solid.mesh import Ring, axes_at
from wm_drake.solid.touching import Faces
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.gasket_curves.study import (
    AXES,
    STRESS,
    STRETCH,
    WORK_ERROR,
    Checked,
    checks_data,
    curves_data,
    values_data,
)
from wm_drake.studies.rig.quantities import LINEAR, PREFIXES, loop_quantities

PLACE = LINEAR["displacement"]
LARGEST_STRETCH = Quantity("largest stretch", decimals=2)

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

LARGEST_WORK_ERROR = 0.01
"""Difference of work and strain energy above which a curve has too few points."""


def curves_answer(
    name: str,
    drawing: GasketDrawing,
    curves: dict[str, Checked],
    numbers: xr.Dataset,
    machine: MachineParameters,
) -> Answer:
    """Return the answer of the study.

    Args:
        name: Name or file of the drawing.
        curves: Its curves by the names of the motions.
        numbers: As of `numbers_data` in `wm_drake.studies.gasket_curves.study`.
        machine: The machine with this gasket.
    """
    stopped = [checked.curve.stopped for checked in curves.values()]
    ends = tuple(
        f"{text}; the curve ends there, and its other points are kept" for text in stopped if text
    )
    drawn, sections, rings = _plots({name: checked.curve for name, checked in curves.items()})
    points = [
        LabelledTable(f"{prefix}curves", curves_data(curves, rotates=rotates))
        for rotates, prefix in PREFIXES.items()
    ]
    whole = LabelledTable("numbers", numbers)
    return Answer(
        f"Curves of gasket {name}",
        summary(curves, numbers),
        None,
        (
            Part("Curves", (drawn, *points), remarks=ends),
            Part("Cuts through the wall", (sections,)),
            Part("Deformed ring", (rings,)),
            Part("Rubber", _rubber_plots(drawing.rubber)),
            Part("Stiffness and damping", [*_values(curves, machine), whole]),
            Part("Checks", _checks(curves)),
            Part(
                "Files",
                links=(
                    ("gasket.yaml", "section gasket of a machine file"),
                    ("machine.yaml", "machine with this gasket"),
                ),
            ),
        ),
        (
            ("Drawing", f"{name}: {drawing.about}"),
            ("Rubber", _rubber_text(drawing.rubber, numbers)),
            ("Frequency of the damping", text_of(numbers.frequency)),
            ("Mesh", _mesh_text(numbers)),
        ),
        METHOD,
        {
            "gasket.yaml": yaml_text({"gasket": machine_tree(machine)["gasket"]}),
            "machine.yaml": machine_yaml(machine),
        },
        tuple(text for one in curves.values() for text in _warnings_of(one, drawing.contact)),
        diverged=ends,
    )


def _mesh_text(numbers: xr.Dataset) -> str:
    along, around = (int(numbers[f"elements_{way}"]) for way in ("along", "around"))
    return f"{along} by {around} elements of half the ring, {3 * along} of the wedge; 27 nodes each"


def _warnings_of(checked: Checked, has_contact: bool) -> Iterable[str]:
    name, rotates = checked.curve.motion.name, checked.curve.motion.rotates
    motion = loop_quantities(rotates)["displacement"]

    def listed(values: FloatArray) -> str:
        numbers = [motion.number(value) for value in values if np.isfinite(value)]
        return f"{' and '.join(numbers)} {motion.unit_text}"

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
            f"{WORK_ERROR.text(checked.curve.work_error())}; use more --points"
        )


def _plots(curves: dict[str, Curve]) -> tuple[Plot, Plot, Plot]:
    """Return the curves, the cuts through the wall and the deformed rings."""
    drawn = Plot(
        curves_figure(curves),
        "Four panels: axial and radial force over displacement, twist and tilt moment over angle.",
        "Force on the moved rim over its displacement, and moment over its angle. By symmetry the "
        "radial curve is that of x and z, the tilt curve that about x and z: six curves in all.",
    )
    sections = Plot(
        sections_figure(curves),
        "Cuts through the wall as drawn and at both ends of each curve.",
        "Cuts through the wall in the plane of the motion, to scale. Squares: folds touch.",
    )
    rings = Plot(
        rings_figure(curves),
        "Half of the ring at both ends of each curve.",
        "Half of the ring at both ends of each curve, to scale: lines of the mesh, seen from the "
        "side and above.",
    )
    return drawn, sections, rings


def _rubber_plots(rubber: Rubber) -> tuple[Plot, ...]:
    """Return the tension test; nothing without one."""
    figure = rubber_figure(rubber)
    if figure is None or rubber.test is None:
        return ()
    about = (
        "Stress of the rubber in tension, force over first cross-section, over the stretch. The "
        f"root mean square of fit less test is {WORK_ERROR.text(rubber.test.deviation)} of the "
        "largest stress."
    )
    return (Plot(figure, "Stress over stretch.", about),)


def summary(curves: dict[str, Checked], numbers: xr.Dataset) -> str:
    """Return the result in a few sentences."""
    slopes = []
    for motion in (RADIAL, AXIAL, TWIST, TILT):
        stiffness = loop_quantities(motion.rotates)["stiffness"].unit
        slope = curves[motion.name].curve.table.nominal_stiffness
        slopes.append(f"{motion.name} {stiffness.reading(slope, 3)}")
    largest = max(max(c.begin.stretch, c.end.stretch) for c in curves.values())
    worst = max(checked.curve.work_error() for checked in curves.values())
    return (
        f"Slopes of the first 20 %: {', '.join(slopes)}. A radial displacement gives a moment too: "
        f"{text_of(numbers.coupling)} about z along x. The largest stretch is "
        f"{LARGEST_STRETCH.text(largest)}. Work of the rim and strain energy agree within "
        f"{WORK_ERROR.text(worst)}."
    )


def _rubber_text(rubber: Rubber, numbers: xr.Dataset) -> str:
    c1, c2, c3 = (significant(float(STRESS.values(value)), 3) for value in rubber.constants)
    hardness = "" if rubber.shore_a is None else f"{rubber.shore_a:g} Shore A, "
    return (
        f"{hardness}constants of Yeoh {c1}, {c2}, {c3} {STRESS.unit_text}, bulk modulus "
        f"{STRESS.unit.reading(rubber.bulk, 3)}. At the frequency of the damping its storage "
        f"and loss modulus are {text_of(numbers.storage_modulus)} and "
        f"{text_of(numbers.loss_modulus)} "
        "of the modulus of the curves"
    )


def _values(curves: dict[str, Checked], machine: MachineParameters) -> list[LabelledTable]:
    """Return stiffness and damping along the axes, and about them."""
    headings = {False: "Along the axes", True: "About the axes"}
    return [
        LabelledTable(
            f"{prefix}values",
            values_data(curves, machine, rotates=rotates),
            headings[rotates],
            f"{headings[rotates]}. Stiffness: slope at rest, and slope of the line through the "
            "first 20 % of the curve as in [B]. The last columns compare the secant at both ends "
            "of the curve with the slope at rest.",
            words={axis: axis.replace("_", " ") for axis in AXES},
            is_in_terminal=True,
        )
        for rotates, prefix in PREFIXES.items()
    ]


def _checks(curves: dict[str, Checked]) -> list[LabelledTable]:
    """Return the checks of the curves along the axes, and of those about them."""
    return [
        LabelledTable(
            f"{prefix}checks",
            checks_data(curves, rotates=rotates),
            "Checks",
            "Stretch: largest principal stretch at both ends. Stress: equivalent stress of von "
            "Mises. Folds touch: at the first points where they do; the overlap is that of the "
            "soft contact.",
        )
        for rotates, prefix in PREFIXES.items()
    ]


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
        quantities, table = loop_quantities(curve.motion.rotates), curve.table
        motion = quantities["displacement"]
        finer = np.linspace(curve.values[0], curve.values[-1], 121)
        slope = fig.Line(
            motion.values(finer),
            table.nominal_stiffness * finer,
            color=fig.QUIET,
            dash="dashed",
            key="slope of the first 20 %",
        )
        between = fig.Line(
            motion.values(finer), table.values(finer), key="table of the machine file"
        )
        x, y = motion.values(curve.values), curve.wrench()
        points = fig.Line(x, y, width=0.0, symbol="circle", key="equilibria")
        marks: tuple[fig.Mark, ...] = (fig.Rule(0.0, color=fig.QUIET), slope, between, points)
        x_axis, y_axis = fig.Axis(label=motion.label), fig.Axis(label=quantities["load"].label)
        panels.append(fig.Panel(title=TITLES[name], marks=marks, x=x_axis, y=y_axis))
    return fig.Figure(panels=fig.in_grid(panels, 2), height=230.0)


def rubber_figure(rubber: Rubber) -> fig.Figure | None:
    """Draw the tension test of a rubber and the fitted curve; None without a test."""
    if rubber.test is None:
        return None
    measured = np.array(rubber.test.stretch)
    stretch = np.linspace(min(1.0, measured.min()), measured.max(), 100)
    curve = STRESS.values(tension_stress(stretch, rubber.constants))
    stress = STRESS.values(rubber.test.stress)
    marks = (
        fig.Line(stretch, curve, color=fig.OURS, key="fit"),
        fig.Points(measured, stress, color=fig.MEASURED, key="test"),
    )
    x, y = fig.Axis(label=STRETCH.label), fig.Axis(label=STRESS.label)
    panel = fig.Panel(marks=marks, x=x, y=y)
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
                x=fig.Axis(label=PLACE.named("across").label),
                y=fig.Axis(label=PLACE.named("y").label),
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
        outline = PLACE.values(_outline(curve.ring, point, column))
        yield fig.Line(*outline.T, color=color, key=key, width=1.2)
        touching = Faces(curve.ring).touching(point.u).in_column(column)
        radius, y = PLACE.values(touching.places).T
        side = -1.0 if column else 1.0
        if len(y):
            yield fig.Points(side * radius, y, color=color, symbol="square", size=4.0)


def rings_figure(curves: dict[str, Curve]) -> fig.Figure:
    """Draw half of the ring from the side at both ends of each curve, by lines of its mesh."""
    panels = []
    for name, curve in curves.items():
        motion = loop_quantities(curve.motion.rotates)["displacement"]
        for point in (curve.points[0], curve.points[-1]):
            lines = np.concatenate(list(_mesh_lines(_surface(curve.ring, point.u))))
            mark = fig.Line(*PLACE.values(lines).T, color=fig.OURS, width=0.7)
            blank = fig.Axis(ticks=(), has_grid=False, has_line=False)
            title = f"{name}, {motion.text(point.value)}"
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
