"""Options of the study of modes, and its declaration."""

from typing import TYPE_CHECKING

from wm_drake.studies.study import Options, Study, Task, option

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine


class ModesOptions(Options):
    """Options of the study of modes."""

    load: str | None = option(
        None, "Load of the machine in the drum. Default: the empty drum.", "NAME"
    )
    no_gasket: bool = option(False, "Without the gasket.")
    amplitude: str = option(
        "5 mm",
        "Amplitude of the modes that depend on it, at the middle of the tub.",
        "LENGTH",
    )
    replay: bool = option(False, "Also write a 3D animation of each sliding mode.")


def _begin(options: ModesOptions, machine: "Machine") -> Task:
    from wm_drake.studies.modes.task import ModesTask

    return ModesTask(options, machine)


MODES = Study(
    "modes",
    "Compute natural modes, critical speeds, and how each number of the machine moves them.",
    ModesOptions,
    _begin,
    has_runs=False,
)
