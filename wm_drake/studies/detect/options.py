"""Options of the study of detection, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import PROFILE, SEED, Options, Study, imported, option


class DetectOptions(Options):
    """Options of the study of detection."""

    machine: str = option(
        "motor", "Name of a shipped machine, or machine file.", "MACHINE", "argument"
    )
    laundry: str = option(
        "tumbled_laundry",
        "What scatters: shipped vary file (tumbled_laundry, heavy_laundry, laundry_and_parts), or "
        "a YAML file.",
        "NAME|FILE",
    )
    at: tuple[str, ...] = option(
        (),
        "Speed of detection, or profile for the first hold of the spin profile. Repeatable; the "
        "first one decides, the others are compared. Default: that hold, or 90 rpm without one.",
        "SPEED",
    )
    hold: str = option("8 s", "Duration of a hold at a speed.", "TIME")
    turns: int = option(4, "Turns of the drum over which signals are measured.", "N", ge=1, le=64)
    signal: tuple[str, ...] = option(
        (),
        "Signal that the controller reads, with its errors: torque, speed, a sensor, or "
        "accelerometer and axis: 'Xr, noise=0.1 mm, resolution=0.05 mm, sample=10 ms'. Repeatable; "
        "thresholds are those of the first one. Default: torque and speed, or the first sensor.",
        "NAME",
    )
    features: str = option(
        "amplitude,phase,products",
        "Features of the estimate: amplitude of order one, phase (against the first signal), "
        "order2, and products, of all these with each other.",
        "NAMES",
    )
    estimator: str = option("linear", "Estimator: linear, or one of yours.", "NAME")
    clearance: str = option(
        "0 mm", "Gap between tub and housing that must remain in every spin.", "LENGTH"
    )
    risk: str = option("0.5 %", "Tolerated share of washes in which the tub touches.", "SHARE")
    retry: str = option("90 s", "Duration of a distribution of the laundry.", "TIME")
    samples: int | None = option(
        None, "Draws, a power of two. Default: 4 over the risk, at least 1024.", "N", ge=64
    )
    profile: Path | None = PROFILE
    seed: int = SEED


DETECT = Study(
    "detect",
    "Find the threshold of unbalance from which a machine must not spin, its risk and its cost.",
    DetectOptions,
    imported("wm_drake.studies.detect.task:DetectTask"),
    quick={"samples": 64, "risk": "10 %", "hold": "6 s"},
)
