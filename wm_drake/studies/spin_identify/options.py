"""Options of the identification from a spin cycle, and its declaration."""

from pathlib import Path
from typing import Literal

from wm_drake.studies.spin_cycle.options import SpinCycleDataOptions
from wm_drake.studies.study import Study, imported, option


class SpinIdentifyOptions(SpinCycleDataOptions):
    """Options of the identification from a spin cycle."""

    unknown: tuple[str, ...] = option(
        (),
        "Number to find, with or without a range: gasket.stiffness_y='(1, 4) N/mm'. KEY1+KEY2 are "
        "two keys with the same value. Repeatable. Default: the numbers of [A] Table 8.",
        "KEYS[=RANGE]",
    )
    case: tuple[str, ...] = option(
        (),
        "Use only this case; 'all' are those of the table, 33 in [A] Table 9. Repeatable. Default: "
        "those of --cases, or 2, 5 and 29 of [A] Table 9.",
        "NAME",
    )
    record: tuple[str, ...] = option(
        (),
        "Recorded file of a case, in place of --measured: 5=run_5.mf4. Repeatable; several of a "
        "case are repeats. The model predicts the signals of the sensors.",
        "CASE=FILE",
    )
    test: Path | None = option(
        None,
        "For --record: file with sensors and channel of the drum speed. Default: the sensors of "
        "the machine file.",
        "FILE",
    )
    by: Literal["envelope", "order", "rms", "history"] = option(
        "rms", "What is fitted of records, as in `calibrate`.", "NAME"
    )
    noise: float = option(
        0.005, "Relative standard deviation of the noise in a virtual experiment.", ge=0.0
    )
    seed: int = option(
        0,
        "Seed of the planted values of a virtual experiment, and of the search.",
        "N",
        ge=0,
        le=2**32 - 1,
    )


SPIN_IDENTIFY = Study(
    "spin-identify",
    "Fit numbers of a machine to RMS displacements in a spin cycle; without measurements, to a "
    "virtual experiment.",
    SpinIdentifyOptions,
    imported("wm_drake.studies.spin_identify.task:SpinIdentifyTask"),
    quick={"unknown": ("gasket.stiffness_y",), "case": ("2",)},
)
