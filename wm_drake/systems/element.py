"""What all force elements share: ports, parameters in the Context, and the two ways of running one law."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import BasicVector_, ContinuousStateIndex, NumericParameterIndex

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
        self.packed = parameters  # what a scalar-converted copy begins with
        self.state_size = state_size
        state_port = system.DeclareVectorInputPort("plant_state", PLANT_STATE_SIZE)
        index = system.DeclareNumericParameter(BasicVector_[scalar](parameters))
        self.parameter_index = index
        if state_size:
            system.DeclareContinuousState(state_size)
        calc_generalized_force, calc_force, self.calc_rate = _callbacks(
            scalar, evaluator(evaluate, scalar), state_port, index, (GENERALIZED_FORCE_SIZE, force_size, state_size)
        )
        needs = {state_port.ticket(), system.numeric_parameter_ticket(NumericParameterIndex(index)), system.xc_ticket()}
        system.DeclareVectorOutputPort("generalized_force", GENERALIZED_FORCE_SIZE, calc_generalized_force, needs)
        system.DeclareVectorOutputPort("force", force_size, calc_force, needs)
        if state_size:
            system.DeclareStateOutputPort("state", ContinuousStateIndex(0))

    def set_parameters(self, context: Any, parameters: np.ndarray) -> None:
        """Puts packed parameters into the element's Context.

        Raises:
            ValueError: another number of them than this element was built with (a table with more points, say).
        """
        if len(parameters) != len(self.packed):
            name = self.get_name()  # type: ignore[attr-defined]
            raise ValueError(f"{name}: a table has another number of points than the built machine's; build a new one")
        context.get_mutable_numeric_parameter(self.parameter_index).SetFromVector(parameters)


def _callbacks(
    scalar: type, run: Callable[..., None], state_port: Any, index: int, sizes: tuple[int, int, int]
) -> tuple[Callable[[Any, Any], None], ...]:
    """Drake's callbacks for the two output ports and the state rate of an element.

    One run comes here a million times: for floats names are bound beforehand, nothing is allocated, and a law writes where
    Drake keeps the value.
    """
    generalized_force, force, rate = (np.empty(size, float if scalar is float else object) for size in sizes)
    has_state = sizes[2] > 0
    no_state = np.empty(0)
    plant_state = state_port.Eval

    def own_state(context: Any) -> np.ndarray:
        return context.get_continuous_state_vector().CopyToVector() if has_state else no_state

    def numbers(context: Any) -> np.ndarray:
        values = context.get_numeric_parameter(index).CopyToVector()
        # a law needs plain numbers to walk its packed tables; derivatives are by state
        return values if scalar is float else np.array([value.value() for value in values])

    def calc_force(context: Any, output: Any) -> None:
        run(plant_state(context), own_state(context), numbers(context), generalized_force, force, rate)
        output.SetFromVector(force)

    def calc_rate(context: Any, derivatives: Any) -> None:
        run(plant_state(context), own_state(context), numbers(context), generalized_force, force, rate)
        derivatives.get_mutable_vector().SetFromVector(rate)

    def calc_generalized_force(context: Any, output: Any) -> None:
        run(plant_state(context), own_state(context), numbers(context), generalized_force, force, rate)
        output.SetFromVector(generalized_force)

    def calc_stateless_force(context: Any, output: Any) -> None:
        numbers = context.get_numeric_parameter(index).value()
        run(plant_state(context), no_state, numbers, output.get_mutable_value(), force, no_state)

    def calc_stateful_force(context: Any, output: Any) -> None:
        state = context.get_continuous_state_vector().CopyToVector()
        numbers = context.get_numeric_parameter(index).value()
        run(plant_state(context), state, numbers, output.get_mutable_value(), force, rate)

    if scalar is float:
        return calc_stateful_force if has_state else calc_stateless_force, calc_force, calc_rate
    return calc_generalized_force, calc_force, calc_rate


__all__ = ["GENERALIZED_FORCE_SIZE", "PLANT_STATE_SIZE", "SCALARS", "ForceElement", "evaluator"]
