"""Options of the study of modes, and its declaration."""

from wm_drake.studies.study import Options, Study, imported, option


class ModesOptions(Options):
    """Options of the study of modes."""

    load: str | None = option(
        None, "Load of the machine in the drum. Default: the empty drum.", "NAME"
    )
    no_gasket: bool = option(False, "Without the gasket.")
    amplitude: str = option(
        "5 mm", "Amplitude of the modes that depend on it, at the middle of the tub.", "LENGTH"
    )
    replay: bool = option(False, "Also write a 3D animation of each sliding mode.")


MODES = Study(
    "modes",
    "Compute natural modes, critical speeds, and how each number of the machine moves them.",
    ModesOptions,
    imported("wm_drake.studies.modes.task:ModesTask"),
    has_runs=False,
)
