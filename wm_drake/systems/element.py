"""What all force elements share: ports, parameters in the Context, and the two ways of running one law."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import BasicVector_, NumericParameterIndex

from wm_drake.laws.compilation import generic

PLANT_STATE_SIZE = 14
"""q = [roll, pitch, yaw, x, y, z, drum angle] and v = [w_WT, v_WTo, drum rate] of the plant."""
GENERALIZED_FORCE_SIZE = 7
"""Moment about To and force on the tub in W, then the torque on the drum joint."""

SCALARS = (float, AutoDiffXd)
"""Scalar types of all systems: one more would make Drake trace Python callbacks symbolically."""


def evaluator(compiled: Any, scalar: type) -> Callable[..., None]:
    """The law to call on a scalar type: compiled for float, the same source interpreted for AutoDiffXd."""
    return compiled if scalar is float else generic(compiled)


class ForceElement:
    """Mixin of the LeafSystems that put a force on the plant.

        plant_state ──▶ [ element ] ──▶ generalized_force   on the plant, 7: moment about To, force (W), drum torque
                                    ──▶ force               the element's own, for logging

    A subclass hands `declare_element` a compiled function
    ``evaluate(plant_state, state, parameters, generalized_force, force, rate)`` that writes the last three; `state` and
    `rate` are the element's own continuous state and its derivative (length 0 for most). `parameters` is a flat array that
    lives in the Context as a numeric parameter.
    """

    def declare_element(self, scalar: type, evaluate: Any, parameters: np.ndarray, force_size: int, state_size: int) -> None:
        """Declares ports, parameters and state. `self` is a LeafSystem of the given scalar type."""
        system: Any = self
        self.scalar = scalar
        self.evaluate = evaluator(evaluate, scalar)
        self.packed = parameters  # what a scalar-converted copy begins with
        self.sizes = (force_size, state_size)
        self.state_port = system.DeclareVectorInputPort("plant_state", PLANT_STATE_SIZE)
        self.parameter_index = system.DeclareNumericParameter(BasicVector_[scalar](parameters))
        if state_size:
            system.DeclareContinuousState(state_size)
        needs = {self.state_port.ticket(), system.numeric_parameter_ticket(NumericParameterIndex(self.parameter_index)), system.xc_ticket()}
        system.DeclareVectorOutputPort(
            "generalized_force", GENERALIZED_FORCE_SIZE, lambda c, o: o.SetFromVector(self.evaluated(c)[0]), needs
        )
        system.DeclareVectorOutputPort("force", force_size, lambda c, o: o.SetFromVector(self.evaluated(c)[1]), needs)

    def evaluated(self, context: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Generalized force, own force and state rate in a Context."""
        force_size, state_size = self.sizes
        kind = float if self.scalar is float else object
        generalized_force, force = np.empty(GENERALIZED_FORCE_SIZE, kind), np.empty(force_size, kind)
        rate = np.empty(state_size, kind)
        parameters = context.get_numeric_parameter(self.parameter_index).CopyToVector()
        if self.scalar is not float:  # a law needs plain numbers to walk its packed tables; derivatives are by state
            parameters = np.array([p.value() for p in parameters])
        state = context.get_continuous_state_vector().CopyToVector() if state_size else rate
        self.evaluate(self.state_port.Eval(context), state, parameters, generalized_force, force, rate)
        return generalized_force, force, rate

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        """Drake's hook for the rate of the element's own state."""
        if self.sizes[1]:
            derivatives.get_mutable_vector().SetFromVector(self.evaluated(context)[2])

    def set_parameters(self, context: Any, parameters: np.ndarray) -> None:
        """Puts packed parameters into the element's Context.

        Raises:
            ValueError: another number of them than this element was built with (a table with more points, say).
        """
        if len(parameters) != len(self.packed):
            name = self.get_name()  # type: ignore[attr-defined]
            raise ValueError(f"{name}: a table has another number of points than the built machine's; build a new one")
        context.get_mutable_numeric_parameter(self.parameter_index).SetFromVector(parameters)


__all__ = ["GENERALIZED_FORCE_SIZE", "PLANT_STATE_SIZE", "SCALARS", "ForceElement", "evaluator"]
