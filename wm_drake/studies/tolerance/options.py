"""Options of the tolerance study, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import PROFILE, SEED, Options, Study, imported, option


class ToleranceOptions(Options):
    """Options of the tolerance study."""

    file: str = option(
        "laundry",
        "Shipped vary file (laundry, heavy_laundry, laundry_and_parts), or a YAML file.",
        "NAME|FILE",
        "argument",
    )
    samples: int = option(4096, "Number of samples, a power of two.", "N", ge=16)
    sensitivity: int | None = option(
        None,
        "Samples of the Sobol indices, a power of two; each needs one run more than there are "
        "quantities. 0 for none. Default: 512, or the samples if they are fewer.",
        "N",
        ge=0,
    )
    subset: int = option(
        1000,
        "Runs of each level of the subset simulation, which estimates contact that is rarer than "
        "1 in 1000. 0 for none.",
        "N",
        ge=0,
    )
    limits: Path | None = option(
        None, "YAML file of limits: quantity, at_least or at_most, allowed_share.", "FILE"
    )
    response: tuple[str, ...] = option(
        (),
        "What is measured of each run, as for study gasket. Repeatable. Default: D, F, M, gap, "
        "amplitude and mount_force_peak.",
        "NAME",
    )
    profile: Path | None = PROFILE
    seed: int = SEED


TOLERANCE = Study(
    "tolerance",
    "Find how often the tub touches, how far it moves, and which quantities decide that.",
    ToleranceOptions,
    imported("wm_drake.studies.tolerance.task:ToleranceTask"),
    quick={"samples": 512, "sensitivity": 32, "subset": 0},
)
