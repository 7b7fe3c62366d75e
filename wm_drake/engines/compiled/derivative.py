"""The time derivative of a machine's state, for integrators of other packages and for tests."""

import numpy as np

from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.integration import derivative_lanes
from wm_drake.engines.compiled.packing import aligned, fill_lanes, pack
from wm_drake.model.setup import Setup
from wm_drake.parameters.types import FloatArray


class StateDerivative:
    """The time derivative of the state of a machine as it is set up.

    A state has the layout of `wm_drake.engines.compiled.mechanics`; `initial_state` gives one.

    Attributes:
        layout: Where the parts of the machine begin in packed numbers and states.
    """

    def __init__(self, setup: Setup) -> None:
        """Pack a machine.

        Raises:
            InputError: it has something that the compiled engine does not represent.
        """
        packed, self.layout = pack(setup)
        self._elements = self.layout.elements
        self._p = fill_lanes(aligned(len(packed) * WIDTH), [packed])

    def __call__(self, x: FloatArray, acceleration: float) -> FloatArray:
        """Return the time derivative at a state.

        Args:
            x: State (size,).
            acceleration: Acceleration of the drum against what carries it. [rad/s^2]

        Returns:
            (size,) The derivative of each number of the state. All lanes compute the same one.
        """
        return self.at_states(np.tile(x, (WIDTH, 1)), acceleration)[0]

    def at_states(self, states: FloatArray, acceleration: float = 0.0) -> FloatArray:
        """Return the time derivatives at several states of one machine.

        Args:
            states: (WIDTH, size), one a lane.
            acceleration: As for a call, the same at all states. [rad/s^2]

        Returns:
            (WIDTH, size)
        """
        state, rate = aligned(states.size), aligned(states.size)
        state[:] = states.T.ravel()
        derivative_lanes(state, rate, acceleration, self._p, self._elements)
        return rate.reshape(-1, WIDTH).T.copy()
