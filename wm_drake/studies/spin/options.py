"""Options of the command `wm-drake spin`, and its declaration."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import field_validator

from wm_drake.studies.inputs import with_drive, with_measured
from wm_drake.studies.study import ENGINE, MEASURED, PROFILE, Options, Study, imported, option

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.parameters import MachineParameters

MOST_VARIANTS = 6
"""Largest number of variants that a figure can tell apart."""


class SpinOptions(Options):
    """Options of spin runs."""

    machine: tuple[str, ...] = option(  # type: ignore[assignment]  # that of `Options` is one
        ("reference",),
        "Name of a shipped machine, or machine file. Repeatable: several machines are compared on "
        "one page.",
        "NAME|FILE",
        min_length=1,
    )
    load: tuple[str, ...] = option(
        (),
        "Load of the machine, or load file. Repeatable. Default: all loads of the machine; of "
        "several machines, those that all have.",
        "NAME|FILE",
    )
    no_gasket: bool = option(False, "Run without the gasket.")
    compare_gasket: bool = option(
        False, "Compare with and without the gasket on one page: amplitudes and the steady state."
    )
    profile: Path | None = PROFILE
    engine: str = ENGINE
    replay: bool = option(
        False, "Also write a 3D replay around the largest amplitude of each load."
    )
    detail: bool = option(
        False,
        "Draw mount forces, accelerations and spectra of every load, not only of the load with the "
        "largest amplitude.",
    )
    no_records: bool = option(False, "Leave out the netCDF records, one for each load.")
    measured: tuple[Path, ...] = MEASURED
    drive: str | None = option(
        None,
        "Drive in place of that of the machine file: prescribed (follows the profile exactly) or "
        "motor (the default motor with torque limit and speed controller, or the motor of the "
        "machine file).",
        "NAME",
    )

    @field_validator("machine", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        """Return a tuple for the name of a single machine."""
        return (value,) if isinstance(value, str) else value


def _adapted(parameters: "MachineParameters", options: SpinOptions) -> "MachineParameters":
    changed = with_drive(parameters, options.drive)
    return with_measured(changed, options.measured, "--measured")


SPIN = Study(
    "spin",
    "Simulate the run-up of the drum through the resonances, and report the motion of the tub.",
    SpinOptions,
    imported("wm_drake.studies.spin.task:SpinTask"),
    quick={"load": ("middle",)},
    has_runs=False,
    adapt=_adapted,
    group="",
)
