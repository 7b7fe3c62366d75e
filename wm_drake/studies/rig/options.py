"""Options of `wm-drake rig`, and the declarations of its commands."""

from functools import partial

from wm_drake.studies.component_options import ARM, AXIS, JIG_MASS, OUTER_MASS, ComponentOptions
from wm_drake.studies.study import Study, imported, option


class RigOptions(ComponentOptions):
    """Options of a bench test."""

    frequency: str | None = option(
        None, "Of the motion; several as '1,3,5 Hz'.", "FREQUENCIES", "--frequency -f"
    )
    amplitude: str | None = option(
        None, "Of the motion; several as '1,3,5 mm', angles in deg.", "AMPLITUDES", "--amplitude -a"
    )
    matrix: str | None = option(
        None, "Run the test matrix of a paper: A, or for dampers C.", "PAPER"
    )


class RigDamperOptions(RigOptions):
    """Options of a bench test of a damper."""

    sponge_mass: str | None = option(
        None,
        "Mass of the sponge, law {laws_with_mass} only, e.g. '10 g'; none in the machine.",
        "MASS",
    )
    outer_mass: str | None = OUTER_MASS
    jig_mass: str | None = JIG_MASS


class RigAxisOptions(RigOptions):
    """Options of a bench test of one axis."""

    axis: str = option(..., AXIS, "AXIS")
    arm: str | None = ARM
    static: bool = option(
        False, "Quasi-static test ([B] 3.1.1): to --amplitude on both sides and back at --rate."
    )
    rate: str | None = option(
        None, "Of a quasi-static test; as in [B] 100 mm/min where none is given.", "RATE"
    )
    preload: str | None = option(
        None,
        "Displacement at which the component is clamped: a quasi-static test begins there.",
        "LENGTH",
    )


RIG = tuple(
    Study(
        kind,
        about,
        options,
        partial(imported("wm_drake.studies.rig.task:RigTask"), kind),
        has_runs=False,
        group="rig",
        has_machine=False,
        folder="wm-drake-rig",
    )
    for kind, about, options in (
        (
            "damper",
            "Test a friction damper along its line; with masses, their effect on the loops is "
            "printed and in masses.csv.",
            RigDamperOptions,
        ),
        ("bushing", "One axis of a six-component bushing.", RigAxisOptions),
        ("gasket", "One axis of the gasket.", RigAxisOptions),
    )
)
"""Commands of components."""
