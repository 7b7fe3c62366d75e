"""Options of the study of drawings of a gasket, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import LOADS, PROFILE, SEED, Options, Study, imported, option


class GeometryOptions(Options):
    """Options of the study of drawings of a gasket."""

    file: str = option(
        "folded",
        "Shipped gasket drawing (folded, bellows), or a YAML file with shore_a.",
        "NAME|FILE",
        "argument",
    )
    drawings: int = option(27, "Drawings of the design.", "N", ge=6, le=400)
    fresh: int = option(4, "Fresh drawings that test the response surfaces.", "N", ge=2, le=100)
    folds: tuple[int, ...] = option(
        (1,),
        "Times that the folds of the drawing are repeated, each narrower, 1 to 6. Repeat it to "
        "make the number of folds a factor.",
        "N",
    )
    limit: tuple[str, ...] = option(
        (),
        "Largest value of a response that the best drawing may have, such as "
        "largest_gasket_force_N=60 or largest_stretch=1.3; repeat for more.",
        "RESPONSE=VALUE",
    )
    load: tuple[str, ...] = LOADS
    profile: Path | None = PROFILE
    axial: str = option("10 mm", "Largest displacement along the axis, both ways.", "LENGTH")
    radial: str = option("10 mm", "Largest displacement across the axis.", "LENGTH")
    twist: str = option("3 deg", "Largest angle about the axis.", "ANGLE")
    tilt: str = option("3 deg", "Largest angle about an axis across.", "ANGLE")
    frequency: str = option(
        "2.5 Hz", "Frequency at which the damping has the loss factor of the rubber.", "FREQUENCY"
    )
    elements: int = option(14, "Elements along the meridian.", "N", ge=2, le=60)
    around: int = option(6, "Elements around half the ring.", "N", ge=2, le=40)
    seed: int = SEED


GASKET_GEOMETRY = Study(
    "gasket-geometry",
    "Vary the drawing of a gasket: wall, folds, hardness; find the largest gap.",
    GeometryOptions,
    imported("wm_drake.studies.gasket_geometry.task:GeometryTask"),
    quick={
        "drawings": 6,
        "fresh": 2,
        "load": ("middle",),
        "elements": 4,
        "around": 2,
        "axial": "2 mm",
        "radial": "1 mm",
        "twist": "0.5 deg",
        "tilt": "0.2 deg",
    },
)
