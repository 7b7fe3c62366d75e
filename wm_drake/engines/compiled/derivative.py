"""The time derivative of a machine's state, for integrators of other packages and for tests."""

import numpy as np

from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.integration import derivative_lanes
from wm_drake.engines.compiled.water import pack_run
from wm_drake.model.machine import Setup
from wm_drake.parameters.types import FloatArray


class StateDerivative:
    """The time derivative of the state of a machine as it is set up.

    The order of a state is that of `layout.states`; see `initial_state`.

    Attributes:
        layout: Indices of the parts of the machine in packed numbers and states.
    """

    def __init__(self, setup: Setup) -> None:
        """Pack a machine.

        Raises:
            InputError: the machine has something that the compiled engine does not represent.
        """
        packed, self.layout, _ = pack_run(setup)
        self._elements = self.layout.elements
        self._p = fill_lanes(aligned(len(packed) * WIDTH), [packed])

    def __call__(
        self, x: FloatArray, acceleration: float = 0.0, *, reference: float = 0.0
    ) -> FloatArray:
        """Return the time derivative at a state.

        Args:
            x: State (size,).
            acceleration: Acceleration of the drum against the tub, or against the drum carrier
                with a compliant bearing; a motor decides it itself. [rad/s^2]
            reference: Speed of the drum that the controller of a motor wants. [rad/s]

        Returns:
            Derivative of each number of the state (size,). All lanes compute the same derivative.
        """
        return self.at_states(np.tile(x, (WIDTH, 1)), acceleration, reference=reference)[0]

    def at_states(
        self, states: FloatArray, acceleration: float = 0.0, *, reference: float = 0.0
    ) -> FloatArray:
        """Return the time derivatives at several states of one machine.

        Args:
            states: (WIDTH, size), one a lane.
            acceleration, reference: As for a call, the same at all states. [rad/s^2, rad/s]

        Returns:
            (WIDTH, size)
        """
        state, rate = aligned(states.size), aligned(states.size)
        state[:] = states.T.ravel()
        inputs = aligned(self.layout.states.begins.inputs * WIDTH)
        derivative_lanes(state, rate, inputs, reference, acceleration, self._p, self._elements)
        return rate.reshape(-1, WIDTH).T.copy()
