"""Options of `wm-drake identify`, and the declarations of its commands."""

from functools import partial
from pathlib import Path

from wm_drake.studies.component_options import ARM, AXIS, JIG_MASS, OUTER_MASS, ComponentOptions
from wm_drake.studies.study import Study, imported, option


class IdentifyOptions(ComponentOptions):
    """Options of a fit to measured loops."""

    files: tuple[Path, ...] = option(
        ...,
        "Files with time, displacement, force: CSV, MDF, TDMS, UFF 58, MAT or HDF5.",
        "FILES...",
        "argument",
    )
    validation: tuple[Path, ...] = option(
        (),
        "Files that no fit sees: their loops are predicted. Takes all names that follow it.",
        "FILES...",
        "--validate",
    )
    method: str = option("least-squares", "least-squares, response-surface or evolution.", "NAME")
    bounds: tuple[str, ...] = option(
        (),
        "Of an unknown: sponge_stiffness='(50, 300) N/mm' or LOW..HIGH. Repeatable.",
        "KEY=RANGE",
    )
    fix: tuple[str, ...] = option(
        (), "A number that is known: slider_damping='0.4 N s/mm'. Repeatable.", "KEY=VALUE"
    )
    file_units: str | None = option(
        None, "Of time, displacement, force, where files do not say: 's,mm,N'.", "UNITS"
    )
    cutoff: str | None = option(
        None,
        "Take each motion as recorded, smoothed so that this frequency is halved: '50 Hz'.",
        "FREQUENCY",
    )
    unit: tuple[str, ...] = option(
        (), "Of one channel, where a file does not say: 'Load cell=kN'. Repeatable.", "NAME=UNIT"
    )
    channels: str | None = option(
        None,
        "Names in the files: 'displacement=Pos 1,force=Group/Load' (also time, angle, moment).",
        "WORD=NAME,...",
    )
    knots: int = option(5, "Points of a table on each side of zero.", ge=1, le=12)
    seed: int = option(0, "Of the search.", ge=0)


class IdentifyDamperOptions(IdentifyOptions):
    """Options of a fit of a damper."""

    law: str | None = option(None, "{laws}; the component's by default. Several: mstv,stv.", "LAWS")
    sponge_mass: str | None = option(
        None, "Mass of the sponge on the bench, under sines, e.g. '10 g'.", "MASS"
    )
    outer_mass: str | None = OUTER_MASS
    jig_mass: str | None = JIG_MASS
    static: bool = option(
        False,
        "Quasi-static tests of the sponge of a free-stroke damper ([A] Eq. (5)), below the force "
        "at which it slides: table and hysteresis.",
    )


class IdentifyAxisOptions(IdentifyOptions):
    """Options of a fit of one axis, or of quasi-static tests of several."""

    axis: str | None = option(None, AXIS, "AXIS")
    static: bool = option(
        False,
        "Quasi-static tests, to the end and back: table and hysteresis of each axis. Files are "
        "AXIS=FILE, or all of one --axis.",
    )
    law: str = option(
        "voigt",
        "voigt, table (monotone curve), voigt_dahl, voigt_maxwell, rubber (both) or, about an "
        "axis, voigt_havsin.",
        "LAWS",
    )
    arm: str | None = ARM


IDENTIFY = tuple(
    Study(
        kind,
        about,
        options,
        partial(imported("wm_drake.studies.identify.task:task_of"), kind),
        has_runs=False,
        group="identify",
        has_machine=False,
        folder="wm-drake-identify",
    )
    for kind, about, options in (
        (
            "damper",
            "Identify a friction damper; a curve of its law is found as a monotone table. Several "
            "laws are fitted to the same files and compared. Forces of inertia of masses at the "
            "driven end are printed and taken out of the measured ones.",
            IdentifyDamperOptions,
        ),
        ("bushing", "One axis of a six-component bushing.", IdentifyAxisOptions),
        ("gasket", "One axis of the gasket.", IdentifyAxisOptions),
    )
)
"""Commands that identify a component."""
