"""Ports, parameters and state that all element systems share."""

import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common import cpp_template
from pydrake.systems.framework import BasicVector_, NumericParameterIndex
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.compiler.compilation import generic
from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE, PLANT_STATE_SIZE
from wm_drake.parameters.types import FloatArray

SCALARS = (float, AutoDiffXd)
"""Scalar types of all systems. With `Expression`, Drake would trace the callbacks symbolically."""


def define_system(name: str, module: str) -> Callable[[Callable[[type], Any]], Any]:
    """Return the decorator of a system that converts between `SCALARS`.

    It is `TemplateSystem.define` of Drake. Drake finds the module of a template by reading all
    frames of the stack, twice for each class. During an import of this package that takes seconds
    in total. Here it is told the module.

    Args:
        name: Name of the template.
        module: `__name__` of the module that defines it.
    """
    scope = sys.modules[module]

    def decorate(of_scalar: Callable[[type], Any]) -> Any:
        template = TemplateSystem.define(name, T_list=SCALARS, scope=scope)(of_scalar)
        search = cpp_template._get_module_from_stack
        cpp_template._get_module_from_stack = lambda frame=2: scope
        try:
            template[None]  # defines the class for float
        finally:
            cpp_template._get_module_from_stack = search
        return template

    return decorate


def evaluator(compiled: Any, scalar: type) -> Callable[..., None]:
    """Return the function to call for a scalar type.

    Args:
        compiled: A compiled law.
        scalar: float gets the compiled law; AutoDiffXd gets the same source, interpreted.
    """
    return compiled if scalar is float else generic(compiled)


def empty(size: int, scalar: type) -> Any:
    """Return an uninitialized array of a scalar type. (size,)"""
    return np.empty(size, float if scalar is float else object)


class ElementSystem:
    """Mixin of the LeafSystems that put a force on the plant.

        plant_state ──▶ [ element ] ──▶ generalized_force   moment about To, force (W), drum torque
                        [ (state) ] ──▶ own outputs         force, moment, ... of the element
                                    ──▶ (state)             if the element has a state

    A subclass passes a compiled function to `declare_element`:
    ``evaluate(plant_state, state, parameters, generalized_force, own, rate)`` writes its last three
    arguments. The packed parameters are a numeric parameter of the Context. AutoDiffXd computes
    derivatives with respect to state and parameters. A system holds no Context.
    """

    def declare_element(
        self,
        scalar: type,
        evaluate: Any,
        parameters: FloatArray,
        own_outputs: Mapping[str, slice],
        *,
        state_size: int = 0,
        trees: int = 1,
    ) -> None:
        """Declare ports, parameters and state. `self` is a LeafSystem of the given scalar type.

        Args:
            scalar: Scalar type of the system.
            evaluate: Compiled function, see the class.
            parameters: Packed parameters, the default of the numeric parameter.
            own_outputs: Name of each own output port, and its part of the array `own`.
            state_size: Number of continuous states.
            trees: Number of trees of the plant that the element acts on. The plant state and the
                generalized force have one part for each, one after the other.
        """
        system: Any = self
        self.packed = parameters  # a scalar-converted copy is constructed from these
        self.state_size = state_size
        self._scalar, self._evaluate = scalar, evaluator(evaluate, scalar)
        self._sizes = (
            trees * GENERALIZED_FORCE_SIZE,
            max(part.stop for part in own_outputs.values()),
            state_size,
        )
        self._plant_state = system.DeclareVectorInputPort("plant_state", trees * PLANT_STATE_SIZE)
        self._parameters = system.DeclareNumericParameter(BasicVector_[scalar](parameters))
        needs = {
            self._plant_state.ticket(),
            system.numeric_parameter_ticket(NumericParameterIndex(self._parameters)),
        }
        if state_size:
            state = system.DeclareContinuousState(state_size)
            needs.add(system.xc_ticket())
        outputs = {"generalized_force": (0, slice(None))}
        outputs |= {name: (1, part) for name, part in own_outputs.items()}
        for name, (vector, part) in outputs.items():
            size = len(range(self._sizes[vector])[part])
            calc = _output(self._calc, vector, part)
            system.DeclareVectorOutputPort(name, size, calc, needs)
        if state_size:
            system.DeclareStateOutputPort("state", state)

    def set_parameters(self, context: Any, parameters: FloatArray) -> None:
        """Set the packed parameters in the element's own Context.

        Raises:
            ValueError: a table has another number of points than in the built element.
        """
        if len(parameters) != len(self.packed):
            name = self.get_name()  # type: ignore[attr-defined]
            raise ValueError(
                f"{name}: a table has another number of points than the built machine's; "
                "rebuild the machine"
            )
        context.get_mutable_numeric_parameter(self._parameters).SetFromVector(parameters)

    def packed_numbers(self, context: Any) -> Any:
        """Return the packed parameters in the element's own Context."""
        return context.get_numeric_parameter(self._parameters).CopyToVector()

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        """Write the time derivative of the element's state."""
        if self.state_size:
            derivatives.get_mutable_vector().SetFromVector(self._calc(context)[2])

    def _calc(self, context: Any) -> tuple[Any, ...]:
        """Return generalized force, own numbers and time derivative of the state."""
        written = tuple(empty(size, self._scalar) for size in self._sizes)
        self._evaluate(
            self._plant_state.Eval(context),
            context.get_continuous_state_vector().CopyToVector(),
            self.packed_numbers(context),
            *written,
        )
        return written


def _output(
    calc: Callable[[Any], tuple[Any, ...]], vector: int, part: slice
) -> Callable[[Any, Any], None]:
    """Return the callback of an output port that is a part of one of the computed vectors."""

    def write(context: Any, output: Any) -> None:
        output.SetFromVector(calc(context)[vector][part])

    return write
