"""Options of the study of a spin cycle, and its declaration."""

from pathlib import Path
from typing import Any

from wm_drake.studies.study import Options, Study, imported, option

CASE: Any = option((), "Run only this case. Repeatable.", "NAME")


class SpinCycleDataOptions(Options):
    """Options of all studies of a spin cycle: profile, unbalance cases, and measurements."""

    machine: str = option("free_stroke", "Name of a shipped machine, or machine file.", "NAME|FILE")
    profile: str = option(
        "spin_cycle",
        "Name of a shipped profile (spin_cycle, run_up, ifb_9kg, household), or file with regions.",
        "NAME|FILE",
    )
    cases: Path | None = option(
        None,
        "CSV file of cases: case, front_g, rear_g, phase_deg. Default: the 33 cases of [A] Table "
        "9.",
        "FILE",
    )
    case: tuple[str, ...] = CASE
    measured: Path | None = option(
        None, "CSV file of measured RMS displacements: case, region, sensor, axis, rms_mm.", "FILE"
    )
    accelerations: Path | None = option(
        None,
        "Folder of measured accelerations, one file CASE.csv per case: time_s, S1_x, S1_y, ...; or "
        "MDF, TDMS, UFF 58, MAT or HDF5 with channels of these names.",
        "DIR",
    )
    unit: tuple[str, ...] = option(
        (),
        "Unit of a channel whose file has none: 'S1_x=g'; of all: 'g'. Default: m/s^2. Repeatable.",
        "NAME=UNIT",
    )
    channels: str | None = option(
        None,
        "Names in the files: 'S1_x=Acc 1,S1_y=Group/Acc 2' (also time).",
        "WORD=NAME,...",
    )


SPIN_CYCLE = Study(
    "spin-cycle",
    "Run a spin cycle with many unbalances, and report RMS displacements per region and sensor.",
    SpinCycleDataOptions,
    imported("wm_drake.studies.spin_cycle.task:SpinCycleTask"),
    quick={"case": ("2",)},
)
