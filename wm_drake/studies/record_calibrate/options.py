"""Options of the command `wm-drake record calibrate`, and its declaration."""

from typing import Literal

from wm_drake.studies.compare.options import CompareOptions
from wm_drake.studies.study import SEED, Study, imported, option


class RecordCalibrateOptions(CompareOptions):
    """Options of the calibration to recordings."""

    unknown: tuple[str, ...] = option(
        ...,
        "Number to find, with or without a range: gasket.stiffness_y='(1, 4) N/mm'. KEY1+KEY2 are "
        "two keys with the same value. Repeatable.",
        "KEYS[=RANGE]",
        min_length=1,
    )
    by: Literal["envelope", "order", "rms"] = option(
        "envelope",
        "What is fitted: envelope (amplitudes over the drum speed), order (those of order 1), or "
        "rms (in the regions of the profile).",
        "NAME",
    )
    seed: int = SEED


RECORD_CALIBRATE = Study(
    "calibrate",
    "Fit numbers of a machine to recordings of its sensors.",
    RecordCalibrateOptions,
    imported("wm_drake.studies.record_calibrate.task:RecordCalibrateTask"),
    has_runs=False,
    group="record",
    folder="wm-drake-record-calibrate",
)
"""The command."""
