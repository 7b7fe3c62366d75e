"""Options of the study of what to measure next, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import PROFILE, SEED, Options, Study, imported, option


class NextOptions(Options):
    """Options of the study of what to measure next."""

    machine: str = option(
        "reference", "Name of a shipped machine, or machine file.", "MACHINE", "argument"
    )
    vary: str | None = option(
        None,
        "What is known: the distributions of a shipped vary file, or of a YAML file. Default: "
        "unmeasured, which fits any machine.",
        "NAME|FILE",
    )
    calibrated: Path | None = option(
        None,
        "Folder with results of wm-drake calibrate, of this machine and the file of --vary: what "
        "is known after it.",
        "FOLDER",
    )
    answers: tuple[str, ...] = option(
        ("gap",),
        "Response that shall become sure, of the worst load, as for study gasket. Repeatable. "
        "Default: gap.",
        "RESPONSE",
        "--for",
    )
    candidates: str = option(
        "usual", "What could be measured: shipped file (usual), or a YAML file.", "NAME|FILE"
    )
    budget: int = option(3, "Number of measurements, one after the other.", "N", ge=1, le=10)
    samples: int = option(
        256, "Machines drawn from what is known, each run with all loads.", "N", ge=32
    )
    profile: Path | None = PROFILE
    seed: int = SEED


NEXT = Study(
    "next",
    "Say which measurement makes an answer about a machine surer, and which does not.",
    NextOptions,
    imported("wm_drake.studies.next.task:NextTask"),
    quick={"samples": 32, "budget": 2},
)
