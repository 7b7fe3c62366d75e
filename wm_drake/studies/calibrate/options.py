"""Options of `wm-drake calibrate`, and its declaration."""

from pathlib import Path
from typing import Literal

from wm_drake.studies.compare.options import CompareOptions
from wm_drake.studies.study import Study, imported, option


class CalibrateOptions(CompareOptions):
    """Options of a calibration, to targets or to records."""

    records: tuple[Path, ...] = option(
        (),
        "Recorded files of one test: CSV, MDF, TDMS, UFF 58, MAT or HDF5. Several are repeats; "
        "LOAD=RECORD is one of another load. Without: targets.",
        "RECORD...",
        "argument",
    )
    vary: str | None = option(
        None, "Vary file: the numbers to find, with bounds and priors.", "FILE"
    )
    unknown: tuple[str, ...] = option(
        (),
        "For records, in place of --vary: number to find, with or without a range: "
        "gasket.stiffness_y='(1, 4) N/mm'. KEY1+KEY2 are two keys with the same value. Repeatable.",
        "KEYS[=RANGE]",
    )
    by: Literal["envelope", "order", "rms", "history"] = option(
        "envelope",
        "What is fitted of records: envelope (amplitudes over the drum speed), order (those of "
        "order 1), rms (in the regions of the profile), or history (the signals over time).",
        "NAME",
    )
    targets: tuple[Path, ...] = option(
        (),
        "Measured amplitudes, or other responses (docs/how-to/calibrate.md). Repeatable. Default: "
        "those of the machine file.",
        "CSV",
    )
    starts: int = option(8, "Number of searches, each with its own starting point.", ge=1)
    iterations: int = option(0, "Largest number of iterations per search; 0: 60.", ge=0)
    seed: int = option(0, "Seed of the random starting points.", "N", ge=0, le=2**32 - 1)
    deviation: tuple[str, ...] = option(
        (),
        "Standard deviation of a measured amplitude, in percent (default: 5), or that of other "
        "responses by name or kind, such as Fx=8 or moment=15 (default: 10). Repeatable.",
        "PERCENT|NAME=PERCENT",
    )
    resolution: float = option(
        0.1, "Step to which measured amplitudes are rounded, in mm.", ge=0, allow_inf_nan=False
    )
    weight: tuple[str, ...] = option(
        (),
        "Weight of a load, a sensor, a response, a kind of response, or LOAD:NAME. Default: 1. "
        "Repeatable.",
        "NAME=NUMBER",
    )
    limit: tuple[str, ...] = option(
        (),
        "Largest accepted difference of all amplitudes, in percent, or that of a load, a sensor, a "
        "response, a kind of response or LOAD:NAME, such as moment=50. A value beyond its limit "
        "costs much more. Repeatable.",
        "PERCENT|NAME=PERCENT",
    )
    leave_out: tuple[str, ...] = option(
        (),
        "Loads to hold out: calibrate without them, then predict them. Repeatable.",
        "LOAD[,LOAD]",
    )


CALIBRATE = Study(
    "calibrate",
    "Fit unknown numbers of a machine to measured amplitudes, or to records of its sensors.",
    CalibrateOptions,
    imported("wm_drake.studies.calibrate.task:calibrate_task"),
    quick={"starts": 1, "iterations": 3},
    has_cluster=False,
    group="",
)
