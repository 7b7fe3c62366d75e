"""One machine by itself: packed numbers, its struts side by side, and memory to integrate in."""

import numpy as np

from wm_drake.kernel.integration import derivative_alone, integrate_alone
from wm_drake.kernel.mechanics import LINE_SIZE
from wm_drake.kernel.packing import aligned, pack, struts_side_by_side
from wm_drake.kernel.schedule import Schedule
from wm_drake.laws.lanes import QUAD
from wm_drake.machine import Setup
from wm_drake.parameters.elements import FloatArray


class Alone:
    """A machine as it is set up, which no other runs beside.

    Attributes:
        p, layout: Packed numbers, from `pack`.
    """

    def __init__(self, setup: Setup) -> None:
        """Packs a machine.

        Raises:
            InputError: it has something that the compiled engine does not represent.
        """
        self.p, self.layout = pack(setup)
        self._struts, self._elements = struts_side_by_side(setup, self.layout.elements)
        self._scratch = aligned(QUAD * LINE_SIZE * max(1, len(self._elements.dampers)))

    def derivative(self, x: FloatArray, acceleration: float) -> FloatArray:
        """Derivative of a state (size,) at an acceleration of the drum [rad/s^2], for integrators of others."""
        padded = np.append(x, np.zeros(QUAD))
        dx = np.empty_like(padded)
        derivative_alone(padded, dx, acceleration, self.p, self._struts, self._elements, self._scratch)
        return dx[: len(x)]

    def integrate(self, schedule: Schedule, begin: int, end: int, x: FloatArray, samples: FloatArray) -> None:
        """Steps a state from the begin of one step of a schedule to that of another.

        Args:
            schedule: The steps.
            begin, end: Numbers of steps.
            x: State (size,), which is advanced.
            samples: (rows, size + `Layout.rates_size`) states and accelerations; those on the way are written.
        """
        work = (*(aligned(len(x) + QUAD) for _ in range(3)), self._scratch)
        numbers = self.p, self._struts, self._elements
        integrate_alone(schedule.steps, begin, end, *numbers, x, work, samples.reshape(-1))
