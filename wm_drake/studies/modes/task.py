"""The task of the study of modes."""

import logging

from wm_drake.model.machine import Machine
from wm_drake.parameters.units import Unit
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.modes.animation import mode_motion
from wm_drake.studies.modes.options import ModesOptions
from wm_drake.studies.modes.page import ModesResult
from wm_drake.studies.modes.study import SLIDING, MachineModes, modes
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Task


class ModesTask(Task):
    """The study with checked options."""

    def __init__(self, options: ModesOptions, machine: Machine) -> None:
        """Read the amplitude."""
        self.options, self.machine = options, machine
        self.amplitude = quantities_of(options.amplitude, Unit("m", "mm"), "--amplitude")[0]

    def run(self, executor: Executor) -> ModesResult:
        """Compute the modes and, with `--replay`, their animations."""
        with executor.fraction("modes") as progress:
            result = modes(
                self.machine,
                self.options.load,
                gasket=not self.options.no_gasket,
                amplitude=self.amplitude,
                run_up=True,
                progress=progress,
            )
        return ModesResult(result, _replays(result) if self.options.replay else {})


def _replays(result: MachineModes) -> dict[str, str]:
    """Return the page of the animation of each sliding mode."""
    from wm_drake.model.replay import replay_page

    # Meshcat would print the address of its server
    logging.getLogger("drake").setLevel(logging.WARNING)
    return {
        mode.name: replay_page(result.parameters, mode_motion(mode), title=mode.name)
        for mode in result.modes[SLIDING]
    }
