"""Options of `wm-drake gasket curves`, and its declaration."""

from wm_drake.studies.study import Options, Study, imported, option


class CurvesOptions(Options):
    """Options of the curves of a gasket."""

    file: str = option(
        "folded", "Shipped gasket drawing (folded, bellows), or a YAML file.", "NAME|FILE",
        "argument",
    )  # fmt: skip
    machine: str = option(
        "reference",
        "Machine that gets the gasket: name of a shipped machine, or machine file.",
        "NAME|FILE",
    )
    axial: str = option("20 mm", "Largest displacement along the axis, both ways.", "LENGTH")
    radial: str = option("15 mm", "Largest displacement across the axis.", "LENGTH")
    twist: str = option("5 deg", "Largest angle about the axis.", "ANGLE")
    tilt: str = option("5 deg", "Largest angle about an axis across.", "ANGLE")
    points: int = option(5, "Points of a curve on each side, evenly spaced.", "N", ge=2, le=40)
    frequency: str = option(
        "2.5 Hz",
        "Frequency at which the damping has the loss factor of the rubber; the resonances of the "
        "suspended group are at 1.3 to 4 Hz.",
        "FREQUENCY",
    )
    elements: int = option(20, "Elements along the meridian.", "N", ge=2, le=60)
    around: int = option(8, "Elements around half the ring.", "N", ge=2, le=40)


GASKET_CURVES = Study(
    "curves",
    "Compute the six curves of a gasket from its drawing, for a machine file.",
    CurvesOptions,
    imported("wm_drake.studies.gasket_curves.task:CurvesTask"),
    quick={"points": 2, "elements": 6, "around": 3, "radial": "4 mm", "axial": "8 mm"},
    has_runs=False,
    group="gasket",
    folder="wm-drake-gasket-curves",
)
