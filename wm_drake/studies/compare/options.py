"""Options of the command `wm-drake record compare`, and its declaration."""

from pathlib import Path
from typing import Literal

from wm_drake.studies.study import PROFILE, Options, Study, imported, option


class CompareOptions(Options):
    """Options of the comparison of recordings with a machine."""

    records: tuple[Path, ...] = option(
        ...,
        "Recorded files of one test: CSV, MDF, TDMS, UFF 58, MAT or HDF5. Several are repeats.",
        "RECORD...",
        "argument",
        min_length=1,
    )
    test: Path | None = option(
        None,
        "File with load, sensors and channel of the drum speed. Default: the sensors of the "
        "machine file (Xr, ... and S1_x, ...), and a channel named speed if there is one.",
        "FILE",
    )
    load: str | None = option(
        None, "Load of the machine, or load file. Default: that of the test.", "NAME|FILE"
    )
    profile: Path | None = PROFILE
    speed: Literal["profile", "measured"] = option(
        "profile",
        "Speed that drives the model: profile, or measured (of each record).",
        "NAME",
    )
    unit: tuple[str, ...] = option(
        (),
        "Unit of a channel whose file has none: 'Acc 1=g', or of all: g. Repeatable.",
        "NAME=UNIT",
    )
    channels: str | None = option(
        None,
        "Names in the files: 'S1_x=Acc 1,speed=Group/rpm' (names of sensors, time, speed).",
        "WORD=NAME,...",
    )


COMPARE = Study(
    "compare",
    "Compare recordings of a test with what the sensors would record of the model.",
    CompareOptions,
    imported("wm_drake.studies.compare.task:CompareTask"),
    has_runs=False,
    group="record",
)
"""The command."""
