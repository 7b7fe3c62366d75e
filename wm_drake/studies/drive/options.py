"""Options of the drive study, and its declaration."""

from pathlib import Path
from typing import TYPE_CHECKING

from wm_drake.studies.study import LOADS, PROFILE, Options, Study, imported, option

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.parameters import MachineParameters


class DriveOptions(Options):
    """Options of the drive study."""

    machine: str = option(
        "motor",
        "Name of a shipped machine, or machine file. A prescribed speed is replaced by the default "
        "motor.",
        "NAME|FILE",
    )
    load: tuple[str, ...] = LOADS
    profile: Path | None = PROFILE
    torques: int = option(9, "Torque limits of the map.", "N", ge=2, le=50)
    unbalances: int = option(6, "Unbalances of the map.", "N", ge=2, le=50)


def _with_motor(parameters: "MachineParameters", _: DriveOptions) -> "MachineParameters":
    from wm_drake.studies.inputs import with_drive

    return with_drive(parameters, "motor")


DRIVE = Study(
    "drive",
    "Find the weakest motor that passes every critical speed.",
    DriveOptions,
    imported("wm_drake.studies.drive.task:DriveTask"),
    quick={"load": ("middle",), "torques": 2, "unbalances": 2},
    adapt=_with_motor,
)
