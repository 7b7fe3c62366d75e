"""The task of the study of modes: options checked, modes and animations computed."""

import numpy as np

from wm_drake.model.machine import Machine
from wm_drake.model.replay import Motion
from wm_drake.model.scene import REPLAY_RATE
from wm_drake.parameters.units import Unit
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.modes.linearisation import SLIDING
from wm_drake.studies.modes.options import ModesOptions
from wm_drake.studies.modes.page import modes_answer
from wm_drake.studies.modes.shapes import ANGLE_ARM, Mode
from wm_drake.studies.modes.study import MachineModes, modes
from wm_drake.studies.study import Task

SHOWN_AMPLITUDE = 0.03
"""Largest displacement of a shown mode, with angles times 0.25 m. [m]"""

PERIOD, PERIODS = 1.5, 2
"""Time of a shown cycle, slower than it is, and number of cycles. [s]"""


class ModesTask(Task):
    """The study with checked options."""

    def __init__(self, options: ModesOptions, machine: Machine) -> None:
        """Read the amplitude."""
        self.options, self.machine = options, machine
        self.amplitude = quantities_of(options.amplitude, Unit("m", "mm"), "--amplitude")[0]

    def run(self, executor: Executor) -> Answer:
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
        if result.run_up is not None:
            executor.steps.add_table(result.run_up)
        return modes_answer(result, _replays(result) if self.options.replay else {})


def _replays(result: MachineModes) -> dict[str, str]:
    """Return the page of the animation of each sliding mode."""
    from wm_drake.model.replay import replay_page

    return {
        mode.name: replay_page(result.parameters, mode_motion(mode), title=mode.name)
        for mode in result.modes[SLIDING]
    }


def mode_motion(mode: Mode) -> Motion:
    """Return the motion of a mode that neither grows nor decays; the drum stands still."""
    time = np.arange(0.0, PERIODS * PERIOD, 1.0 / REPLAY_RATE)
    turns = np.exp(2j * np.pi * time / PERIOD)
    weight = np.repeat([ANGLE_ARM, 1.0], 3)
    shape = mode.shape * (SHOWN_AMPLITUDE / np.max(np.abs(mode.shape * weight)))
    motion = np.real(np.outer(turns, shape))
    still = np.zeros(len(time))
    return Motion(time, np.column_stack([motion, still]), still)
