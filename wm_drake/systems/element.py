"""What all force elements share: ports, parameters in the Context, and the two ways of running one law."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import BasicVector_, NumericParameterIndex

from wm_drake.compiler.compilation import generic
from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE, PLANT_STATE_SIZE

SCALARS = (float, AutoDiffXd)
"""Scalar types of all systems: one more would make Drake trace Python callbacks symbolically."""


def evaluator(compiled: Any, scalar: type) -> Callable[..., None]:
    """The law to call on a scalar type: compiled for float, the same source interpreted for AutoDiffXd."""
    return compiled if scalar is float else generic(compiled)


class ElementSystem:
    """Mixin of the LeafSystems that put a force on the plant.

        plant_state ──▶ [ element ] ──▶ generalized_force   on the plant, 7: moment about To, force (W), drum torque
            (state) ──▶             ──▶ force               the element's own, for logging

    A subclass hands `declare_element` a compiled function
    ``evaluate(plant_state, state, parameters, generalized_force, force, rate)`` that writes the last three. `parameters` is a
    flat array that lives in the Context as a numeric parameter. An element with a state takes it from a port and puts its
    rate behind the generalized force on the first output port; an Integrator beside it closes the loop. One call of
    Python gives both then, where a state of its own would cost a second one at every step.
    """

    def declare_element(
        self,
        scalar: type,
        evaluate: Any,
        parameters: np.ndarray,
        force_size: int,
        state_size: int,
        trees: int = 1,
    ) -> None:
        """Declares ports and parameters. `self` is a LeafSystem of the given scalar type.

        An element between bodies of two `trees` of the plant gets the states of both, one after the other, and answers with
        the generalized forces on both.
        """
        system: Any = self
        self.packed = parameters  # what a scalar-converted copy begins with
        self.state_size = state_size
        state_port = system.DeclareVectorInputPort("plant_state", trees * PLANT_STATE_SIZE)
        own_state_port = system.DeclareVectorInputPort("state", state_size) if state_size else None
        index = system.DeclareNumericParameter(BasicVector_[scalar](parameters))
        self.parameter_index = index
        self._held = _Held()
        calc_generalized_force, calc_force = _callbacks(
            scalar,
            evaluator(evaluate, scalar),
            state_port,
            own_state_port,
            index,
            (trees * GENERALIZED_FORCE_SIZE, force_size, state_size),
            self._held,
        )
        needs = {state_port.ticket(), system.numeric_parameter_ticket(NumericParameterIndex(index))}
        if own_state_port is not None:
            needs.add(own_state_port.ticket())
        first = "generalized_force_and_rate" if state_size else "generalized_force"
        system.DeclareVectorOutputPort(
            first, trees * GENERALIZED_FORCE_SIZE + state_size, calc_generalized_force, needs
        )
        system.DeclareVectorOutputPort("force", force_size, calc_force, needs)

    def set_parameters(self, context: Any, parameters: np.ndarray, name: str = "") -> None:
        """Puts packed parameters into the element's Context; an error calls the element by `name`, its own by default.

        Raises:
            ValueError: another number of them than this element was built with (a table with more points, say).
        """
        if len(parameters) != len(self.packed):
            name = name or self.get_name()  # type: ignore[attr-defined]
            raise ValueError(
                f"{name}: a table has another number of points than the built machine's; build a new one"
            )
        context.get_mutable_numeric_parameter(self.parameter_index).SetFromVector(parameters)

    def hold(self, context: Any) -> None:
        """Keeps the parameters of a Context at hand, where they lie, until `release`; the Context must last so long."""
        self._held.both = (
            context,
            np.asarray(context.get_numeric_parameter(self.parameter_index).value()),
        )

    def release(self) -> None:
        """The end of `hold`."""
        self._held.both = None, None


class _Held:
    """A Context and its parameters: to ask Drake for them at every call takes an eighth of a run."""

    __slots__ = ("both",)

    def __init__(self) -> None:
        self.both: tuple[Any, Any] = None, None


def _callbacks(
    scalar: type,
    run: Callable[..., None],
    state_port: Any,
    own_state_port: Any,
    index: int,
    sizes: tuple[int, int, int],
    held: _Held,
) -> tuple[Callable[[Any, Any], None], ...]:
    """Drake's callbacks for the two output ports of an element.

    One run comes here half a million times: for floats names are bound beforehand, nothing is allocated, and a law writes
    where Drake keeps the value.
    """
    kind = float if scalar is float else object
    size, force_size, state_size = sizes
    both, force = np.empty(size + state_size, kind), np.empty(force_size, kind)
    generalized_force, rate = both[:size], both[size:]
    no_state = np.empty(0)
    plant_state = state_port.Eval
    own_state = own_state_port.Eval if own_state_port is not None else lambda context: no_state

    def numbers(context: Any) -> Any:
        of, kept = held.both
        if context is of:
            return kept
        parameters = context.get_numeric_parameter(index)
        if scalar is float:
            return np.asarray(parameters.value())
        # a law needs plain numbers to walk its packed tables; derivatives are by state
        return np.array([value.value() for value in parameters.CopyToVector()])

    def calc_generalized_force(context: Any, output: Any) -> None:
        run(
            plant_state(context),
            own_state(context),
            numbers(context),
            generalized_force,
            force,
            rate,
        )
        output.SetFromVector(both)

    def calc_force(context: Any, output: Any) -> None:
        run(
            plant_state(context),
            own_state(context),
            numbers(context),
            generalized_force,
            force,
            rate,
        )
        output.SetFromVector(force)

    def calc_stateless_force(context: Any, output: Any) -> None:
        run(
            plant_state(context),
            no_state,
            numbers(context),
            output.get_mutable_value(),
            force,
            no_state,
        )

    in_place = scalar is float and not state_size
    return calc_stateless_force if in_place else calc_generalized_force, calc_force


__all__ = ["GENERALIZED_FORCE_SIZE", "PLANT_STATE_SIZE", "SCALARS", "ElementSystem", "evaluator"]
