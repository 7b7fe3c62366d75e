"""Time derivatives of the state at many states of a machine, and their slopes, in one pass.

Linearisation and harmonic balance stand on these: they evaluate the same compiled right-hand side
that runs integrate, so that no law is written twice. A slope is a difference quotient. Eight moved
states are evaluated side by side.
"""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import in_each_lane, sine_cosine
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    STATE_SIZE,
    mass_properties,
    state_derivative,
)
from wm_drake.engines.compiled.packing import initial_state, pack
from wm_drake.engines.compiled.tubes import TUBES_STATE_SIZE
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray

POSITION_STEP, VELOCITY_STEP = 1e-6, 1e-7
"""Steps of the differences. [m or rad, m/s or rad/s]

The step of a velocity is a tenth of the regularisation velocity of the papers' friction, so that
the slope at rest is that of a friction damper that sticks."""


class SlopedDerivative:
    """The time derivative of the state of a machine as it is set up, and its slopes.

    A state has the layout of `wm_drake.engines.compiled.mechanics`. Free are all its numbers but
    angle and rate of the drum, which are prescribed.

    Attributes:
        layout: Indices of the parts of the machine in packed numbers and states.
        packed: Packed numbers of the machine.
        rest: State of rest, with a drum that stands still.
        free: Indices of the free numbers.
        is_velocity: Whether a free number is a velocity. (free,)
    """

    def __init__(self, setup: Setup) -> None:
        """Pack a machine.

        Raises:
            InputError: the machine has something that the compiled engine does not represent.
        """
        self.packed, self.layout = pack(setup)
        self.rest = initial_state(setup, SpinProfile(time=(0.0, 1.0), speed=(0.0, 0.0)))
        size = len(self.rest)
        self.free = np.setdiff1d(np.arange(size), (DRUM_ANGLE, DRUM_RATE))
        velocities = np.zeros(size, dtype=bool)
        velocities[STATE_SIZE // 2 : STATE_SIZE] = True
        begin = STATE_SIZE + len(setup.dampers)
        for _ in setup.telescopes:
            velocities[begin + 7 : begin + TUBES_STATE_SIZE - 1] = True
            begin += TUBES_STATE_SIZE
        velocities[begin + (size - begin) // 2 :] = True
        self.is_velocity = velocities[self.free]
        self._steps = np.where(velocities, VELOCITY_STEP, POSITION_STEP)
        self._steps[DRUM_RATE] = POSITION_STEP

    def __call__(self, states: FloatArray) -> FloatArray:
        """Return the time derivatives (n, size) at states (n, size)."""
        return self._evaluate(states, np.zeros(0, dtype=np.int64), np.zeros(0))[0]

    def with_slopes(
        self, states: FloatArray, *, drum_rate: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return the time derivatives of the free numbers, and their slopes by forward differences.

        Args:
            states: (n, size), the drum's angle and rate among them.
            drum_rate: Whether the last slope is that by the drum's rate.

        Returns:
            (n, free), and (n, k, free) with the slope by each free number k.
        """
        columns = np.append(self.free, DRUM_RATE) if drum_rate else self.free
        steps = self._steps[columns]
        rates, moved = self._evaluate(states, columns, steps)
        moved -= rates[:, None, :]
        moved /= steps[:, None]
        return rates[:, self.free], moved[:, :, self.free]

    def jacobian(self, states: FloatArray) -> FloatArray:
        """Return the Jacobian of the free numbers by central differences. (n, free, free)"""
        steps = self._steps[self.free]
        columns, both = np.tile(self.free, 2), np.concatenate([steps, -steps])
        moved = self._evaluate(states, columns, both)[1][:, :, self.free]
        half = len(self.free)
        slopes = (moved[:, :half] - moved[:, half:]) / (2.0 * steps[:, None])
        return np.ascontiguousarray(slopes.transpose(0, 2, 1))

    def _evaluate(
        self, states: FloatArray, columns: FloatArray, steps: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        states = np.ascontiguousarray(states)
        rates = np.empty_like(states)
        moved = np.empty((len(states), len(columns), states.shape[1]))
        derivatives_at(states, columns, steps, self.packed, self.layout.elements, rates, moved)
        return rates, moved


@long_running
def derivatives_at(states, columns, steps, p, elements, rates, moved):
    """Evaluate the time derivative at states, and at each of them moved in each of some numbers.

    Args:
        states: (n, size); angle and rate of the drum are read from them.
        columns, steps: Index and size of each move. (k,)
        p: Packed numbers.
        elements: `Elements`.
        rates: Time derivatives at the states, written. (n, size)
        moved: Time derivatives at the moved states, written. (n, k, size)
    """
    align_stack()
    count, size, moves = len(states), states.shape[1], len(columns)
    x_numbers, dx_numbers = np.empty(size * WIDTH), np.empty(size * WIDTH)
    p_numbers = in_each_lane(p)
    x, dx, numbers = lane_array(x_numbers), lane_array(dx_numbers), lane_array(p_numbers)
    total = count * (moves + 1)
    for begin in range(0, total, WIDTH):
        for lane in range(WIDTH):
            at = min(begin + lane, total - 1)
            row, move = at // (moves + 1), at % (moves + 1)
            for k in range(size):
                x_numbers[k * WIDTH + lane] = states[row, k]
            if move > 0:
                x_numbers[columns[move - 1] * WIDTH + lane] += steps[move - 1]
        sine, cosine = sine_cosine(x[DRUM_ANGLE])
        masses = mass_properties(numbers, cosine, sine)
        state_derivative(x, dx, masses, x[DRUM_RATE], 0.0, numbers, elements)
        for lane in range(min(WIDTH, total - begin)):
            at = begin + lane
            row, move = at // (moves + 1), at % (moves + 1)
            if move == 0:
                for k in range(size):
                    rates[row, k] = dx_numbers[k * WIDTH + lane]
            else:
                for k in range(size):
                    moved[row, move - 1, k] = dx_numbers[k * WIDTH + lane]
