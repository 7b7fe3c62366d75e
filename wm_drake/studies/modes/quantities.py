"""Quantities of modes: words, unit and digits of each, once."""

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import number
from wm_drake.report.quantity import SPEED, Quantity, of_measure

UNDAMPED = 1e-9
"""Damping ratio below which a mode has no damping but errors of rounding."""


def damping_text(ratio: float) -> str:
    """Return a damping ratio for reading; a word where there is none but errors of rounding."""
    return number(ratio, 4) if abs(ratio) > UNDAMPED else "undamped"


def without_rounding(values: FloatArray) -> FloatArray:
    """Return values with 0 in place of errors of rounding, which would set the scale of an axis."""
    return np.where(np.abs(values) > UNDAMPED, values, 0.0)


MM, PERCENT = Unit("m", "mm"), Unit("", "%")

FREQUENCY = Quantity("frequency", Unit("Hz", "Hz"), 3)
DAMPING = Quantity("damping ratio", form=damping_text)
FREQUENCY_CHANGE = Quantity("change of the frequency in % for 1 % more")
DAMPING_CHANGE = Quantity("change of the damping ratio in 0.01 for 1 % more")
CRITICAL_SPEED = Quantity("speed", SPEED.unit, 1)
ORDER = Quantity("order", form="{:g}×".format)
AMPLITUDE = Quantity("amplitude", MM, form="{:g}".format)
SMALLEST_GAP = of_measure("smallest_gap")
PARTICIPATION = Quantity("participation", PERCENT, 0)
STRAIN_ENERGY = Quantity("strain energy", PERCENT, 1)
DISSIPATION = Quantity("dissipation", PERCENT, 1)
MAC = Quantity("MAC with the speed before")
