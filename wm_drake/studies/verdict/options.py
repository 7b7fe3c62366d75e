"""Options of the verdict, and its declaration."""

from pathlib import Path
from typing import Any

from pydantic import field_validator

from wm_drake.studies.study import PROFILE, SEED, Options, Study, imported, option

MOST_EFFORT = 3.0
"""Largest effort of a proposal if the user gives none: three changes, as more are hard to make."""


class VerdictOptions(Options):
    """Options of the verdict."""

    machine: tuple[str, ...] = option(  # type: ignore[assignment]  # that of `Options` is one
        ("reference",),
        "Name of a shipped machine, or machine file. Several are compared on one page, with a page "
        "for each.",
        "MACHINE",
        "argument",
        min_length=1,
    )
    variant: tuple[str, ...] = option(
        (),
        "Compare the machine with one that has other numbers, as of --set, with blanks after ';': "
        "'gasket.stiffness_x=5 N/mm; C_L=80 %'. Repeatable.",
        "'KEY=VALUE; ...'",
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
    effort: tuple[str, ...] = option(
        (),
        "Effort or cost of a change, in any unit, by a key path or its first parts: "
        "damper_types=2. The first that fits counts. Repeatable. Default: 1 for each change.",
        "KEY=NUMBER",
    )
    most_effort: float = option(
        MOST_EFFORT, "Largest effort of a proposal, the sum of its changes.", "NUMBER", gt=0.0
    )
    profile: Path | None = PROFILE
    seed: int = SEED

    @field_validator("machine", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        """Return a tuple for the name of a single machine."""
        return (value,) if isinstance(value, str) else value


VERDICT = Study(
    "verdict",
    "Say whether the tub touches the housing, how likely that is, and what to change.",
    VerdictOptions,
    imported("wm_drake.studies.verdict.task:begin"),
    quick={"samples": 16},
    group="",
)
