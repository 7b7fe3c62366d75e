"""Options of the design study, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import PROFILE, SEED, Options, Study, imported, option


class DesignOptions(Options):
    """Options of the design study."""

    file: str = option(
        "gasket", "Shipped vary file (gasket), or a YAML file.", "NAME|FILE", "argument"
    )
    evaluations: int = option(2000, "Number of designs to evaluate.", "N", ge=4)
    population: int = option(64, "Designs of a generation.", "N", ge=4)
    search: str = option(
        "genetic",
        "genetic: NSGA-II, or NSGA-III for more than two objectives. surfaces: NSGA on response "
        "surfaces of the designs so far, which needs fewer designs.",
        "NAME",
    )
    profile: Path | None = PROFILE
    seed: int = SEED


DESIGN = Study(
    "design",
    "Find the designs of which no other is better in every objective.",
    DesignOptions,
    imported("wm_drake.studies.design.task:DesignTask"),
    quick={"evaluations": 48, "population": 16},
)
