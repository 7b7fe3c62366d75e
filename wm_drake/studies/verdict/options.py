"""Options of the verdict, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import PROFILE, SEED, Options, Study, imported, option


class VerdictOptions(Options):
    """Options of the verdict."""

    machine: str = option(
        "reference", "Name of a shipped machine, or machine file.", "MACHINE", "argument"
    )
    clearance: str = option(
        "0 mm", "Gap between tub and housing that must remain in every run.", "LENGTH"
    )
    laundry: str = option(
        "laundry",
        "What scatters beside the loads of the machine: shipped vary file (laundry, "
        "heavy_laundry, laundry_and_parts), or a YAML file.",
        "NAME|FILE",
    )
    samples: int = option(512, "Samples of the laundry, a power of two.", "N", ge=16)
    change: float = option(
        20.0, "Change of a part that is tried, more and less. [%]", "PERCENT", ge=1.0, le=80.0
    )
    limit: tuple[str, ...] = option(
        (),
        "Largest rise that a proposal may cost, in percent of the machine's: of one response or of "
        "a kind, such as F=5 or mount_force_peak=10. Repeatable. Default: 10 of amplitude, F and "
        "cabinet_force_peak, none of mount_force_peak.",
        "NAME=PERCENT",
    )
    only: tuple[str, ...] = option(
        (),
        "What may change: a key path or its first parts, such as gasket or damper_types. "
        "Repeatable. Default: springs, dampers, bushings, gasket, counterweights.",
        "KEY",
    )
    profile: Path | None = PROFILE
    seed: int = SEED


VERDICT = Study(
    "verdict",
    "Say whether the tub touches the housing, how likely that is, and what to change.",
    VerdictOptions,
    imported("wm_drake.studies.verdict.task:VerdictTask"),
    quick={"samples": 16},
    group="",
)
