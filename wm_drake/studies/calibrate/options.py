"""Options of `wm-drake calibrate`, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import Options, Study, imported, option


class CalibrateOptions(Options):
    """Options of a calibration."""

    free: Path = option(..., "YAML file of the free quantities, bounds and priors.", "FILE")
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
    "Fit unknown numbers of a machine to measured amplitudes, within bounds and with priors.",
    CalibrateOptions,
    imported("wm_drake.studies.calibrate.task:CalibrateTask"),
    quick={"starts": 1, "iterations": 3},
    has_cluster=False,
    group="",
)
