"""Page of the curves of a gasket."""

from wm_drake.report.formatting import MM_PER_M, MPA_PER_PA, number, percent, significant
from wm_drake.report.page import picture
from wm_drake.report.sections import Section, SectionedPage
from wm_drake.report.table import Column, Table, line
from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST
from wm_drake.studies.gasket_curves.figures import (
    curves_figure,
    rings_figure,
    rubber_figure,
    sections_figure,
)
from wm_drake.studies.gasket_curves.machine import coupling
from wm_drake.studies.gasket_curves.study import CurvesResult
from wm_drake.studies.gasket_curves.tables import AXES, values_table
from wm_drake.studies.rig.units import units_of
from wm_drake.studies.study import Facts

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


def curves_page(result: CurvesResult, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    curves = {name: checked.curve for name, checked in result.curves.items()}
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
    links = (
        ("gasket.yaml", "section gasket of a machine file"),
        ("machine.yaml", "machine with this gasket"),
    )
    made = [
        ("Drawing", f"{result.name}: {result.drawing.about}"),
        ("Rubber", _rubber_text(result)),
        ("Frequency of the damping", f"{significant(result.frequency)} Hz"),
        (
            "Mesh",
            f"{result.mesh.meridian} by {result.mesh.around} elements of half the ring, "
            f"{3 * result.mesh.meridian} of the wedge; 27 nodes each",
        ),
        *facts.rows(),
    ]
    return SectionedPage(
        f"Curves of gasket {result.name}",
        summary(result),
        [
            Section("curves", "Curves", (drawn,)),
            Section("cuts", "Cuts through the wall", (sections,)),
            Section("rings", "Deformed ring", (rings,)),
            *_rubber_section(result),
            Section("values", "Stiffness and damping", tables=(values_shown(result),)),
            Section("checks", "Checks", tables=(_checks_shown(result),)),
            Section("files", "Files", links=links),
        ],
        made,
        warnings=(*facts.warnings, *result.warnings(), *result.failures()),
        about="From the drawing and the rubber to the numbers of a machine file.",
        method=METHOD,
    ).html()


def _rubber_section(result: CurvesResult) -> list[Section]:
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


def summary(result: CurvesResult) -> str:
    """Return the result in a few sentences."""
    slopes = {
        name: checked.curve.table.nominal_stiffness for name, checked in result.curves.items()
    }
    curves = {name: checked.curve for name, checked in result.curves.items()}
    largest = max(max(c.begin.stretch, c.end.stretch) for c in result.curves.values())
    worst = max(checked.curve.work_error() for checked in result.curves.values())
    axial, radial = (slopes[motion.name] / MM_PER_M for motion in (AXIAL, RADIAL))
    both = coupling(curves)
    return (
        f"Slopes of the first 20 %: radial {significant(radial, 3)} N/mm, axial "
        f"{significant(axial, 3)} N/mm, twist {significant(slopes[TWIST.name], 3)} N m/rad, tilt "
        f"{significant(slopes[TILT.name], 3)} N m/rad. A radial displacement gives a moment too: "
        f"{significant(both, 3)} N m/m about z along x. The largest stretch is "
        f"{number(largest, 2)}. Work of the rim and strain energy agree within "
        f"{significant(100.0 * worst, 2)} %."
    )


def _rubber_text(result: CurvesResult) -> str:
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


def values_shown(result: CurvesResult) -> Table:
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


def _change(result: CurvesResult, name: str, end: int) -> float:
    """Return the secant stiffness at an end against the slope at rest. [%]"""
    curve = result.curves[name].curve
    secant = float(curve.wrench()[end] / curve.values[end])
    return 100.0 * (secant / curve.slope_at_rest() - 1.0)


def _checks_shown(result: CurvesResult) -> Table:
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
