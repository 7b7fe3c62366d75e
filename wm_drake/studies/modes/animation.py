"""Motion of a mode as positions of the machine, for a replay in 3D."""

import numpy as np

from wm_drake.model.replay import Motion
from wm_drake.model.scene import REPLAY_RATE
from wm_drake.studies.modes.shapes import ANGLE_ARM, Mode

SHOWN_AMPLITUDE = 0.03
"""Largest displacement of a shown mode, with angles times 0.25 m. [m]"""

PERIOD, PERIODS = 1.5, 2
"""Time of a shown cycle, slower than it is, and number of cycles. [s]"""


def mode_motion(mode: Mode) -> Motion:
    """Return the motion of a mode that neither grows nor decays; the drum stands still."""
    time = np.arange(0.0, PERIODS * PERIOD, 1.0 / REPLAY_RATE)
    turns = np.exp(2j * np.pi * time / PERIOD)
    weight = np.repeat([ANGLE_ARM, 1.0], 3)
    shape = mode.shape * (SHOWN_AMPLITUDE / np.max(np.abs(mode.shape * weight)))
    motion = np.real(np.outer(turns, shape))
    still = np.zeros(len(time))
    return Motion(time, np.column_stack([motion, still]), still)
