"""A LeafSystem class for each element kind, made from its declaration."""

import functools
import typing
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector_, LeafSystem_

from wm_drake.elements.kind import ElementKind
from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE, PLANT_STATE_SIZE
from wm_drake.elements.named_numbers import NamedNumber, NumberWithUnit, named_numbers
from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import Packed, define_system, empty, evaluator

if typing.TYPE_CHECKING:  # the class of a kind is a LeafSystem of its scalar type
    from pydrake.systems.framework import LeafSystem as System
else:
    System = object

_NONE = np.empty(0)
"""State and rates of an element without states."""


class ElementSystem(Packed, System):
    """An element that puts a force on the plant, of any `ElementKind`.

        plant_state ──▶ [ element ] ──▶ generalized_force   moment about To, force (W), drum torque
                        [ (state) ] ──▶ own outputs         force, moment, ... of the element
                                    ──▶ state               if the element has a state

    The law of the kind, `ElementKind.on_plant`, writes the generalized force, its own numbers and
    the time derivative of its state. The plant state and the generalized force have one part for
    each tree of the plant that the element acts on, one after the other. The packed numbers are a
    numeric parameter of the Context. AutoDiffXd computes derivatives with respect to state and
    numbers. In a default Context the state is `initial`. A system holds no Context.

    Each kind has a class of its own, such as SpringStrut, for both scalar types (`element_system`).
    """

    __slots__ = NO_SLOTS
    kind: ElementKind

    def declare_element(
        self, scalar: type, packed: FloatArray, initial: Sequence[float] | FloatArray
    ) -> None:
        """Declare ports, numbers and state; `self` is a LeafSystem of the scalar type."""
        kind, self.initial, self.state_size = self.kind, initial, len(initial)
        self._scalar, self._evaluate = scalar, evaluator(kind.on_plant, scalar)
        self._force_size = kind.trees * GENERALIZED_FORCE_SIZE
        self._output_size = kind.output_size
        size = kind.trees * PLANT_STATE_SIZE
        self._plant_state = self.DeclareVectorInputPort("plant_state", size)
        needs = {self._plant_state.ticket(), self.declare_numbers(scalar, packed)}
        if self.state_size:
            state = self.DeclareContinuousState(BasicVector_[scalar](initial))
            needs.add(self.xc_ticket())
        force = callback(self._calc_force)
        self.DeclareVectorOutputPort("generalized_force", self._force_size, force, needs)
        for name, part in kind.output_parts.items():
            calc = callback(self._calc_output, part)
            self.DeclareVectorOutputPort(name, part.stop - part.start, calc, needs)
        if self.state_size:
            self.DeclareStateOutputPort("state", state)

    def number(self, context: Any, name: str) -> Any:
        """Return a number in a root Context. [SI]

        Args:
            context: Root Context of the diagram.
            name: Its name in the machine file, such as "damping_x"; of a part of the element with
                the part before it, such as "end_bushing.stiffness". A table gives its slope at 0.

        Raises:
            InputError: there is no such number; the message lists those that exist.
        """
        packed = self.packed_numbers(self.GetMyContextFromRoot(context))
        return self._named(packed, name).read(packed)

    def set_number(self, context: Any, name: str, value: Any) -> None:
        """Set a number in a root Context; it alone changes, at the rest pose of the others. [SI]

        `set_up` with other parameters also finds the preloads and the rest pose of the changed
        machine.

        Args:
            context: Root Context of the diagram.
            name: As in `number`. A table is scaled.
            value: A float; or an AutoDiffXd, of a system of that scalar type.

        Raises:
            InputError: there is no such number, or a table has no slope at 0.
        """
        part = self.GetMyContextFromRoot(context)
        packed = self.packed_numbers(part)
        self._named(packed, name).write(packed, value)
        self.set_parameters(part, packed)

    def numbers(self, context: Any) -> dict[str, NumberWithUnit]:
        """Return value and unit of all numbers of the machine file in a root Context, by name."""
        packed = self.packed_numbers(self.GetMyContextFromRoot(context))
        named = named_numbers(self.kind, packed)
        return {name: NumberWithUnit(one.read(packed), one.unit) for name, one in named.items()}

    def _named(self, packed: Any, name: str) -> NamedNumber:
        named = named_numbers(self.kind, packed)
        if name not in named:
            raise input_error(
                f"no number '{name}' of {self.get_name()}; the numbers are {', '.join(named)}"
            )
        return named[name]

    def _calc_force(self, context: Any, output: Any) -> None:
        if self._scalar is float:  # a law writes into the output: no copies
            self._evaluated(context, output.get_mutable_value())
        else:
            force = empty(self._force_size, self._scalar)
            self._evaluated(context, force)
            output.SetFromVector(force)

    def _calc_output(self, context: Any, output: Any, part: slice) -> None:
        force = empty(self._force_size, self._scalar)
        output.SetFromVector(self._evaluated(context, force)[0][part])

    def _evaluated(self, context: Any, force: Any) -> tuple[Any, Any]:
        """Write the generalized force; return own numbers and time derivative of the state."""
        state = rates = _NONE
        if self.state_size:
            state = context.get_continuous_state_vector().CopyToVector()
            rates = empty(self.state_size, self._scalar)
        written = empty(self._output_size, self._scalar)
        plant_state, numbers = self._plant_state.Eval(context), self.packed_numbers(context)
        self._evaluate(plant_state, state, numbers, force, written, rates)
        return written, rates


class ElementSystemWithState(ElementSystem):
    """An element with a state.

    A class of its own: Drake would call the method of elements without a state at each step.
    """

    __slots__ = NO_SLOTS

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        """Write the time derivative of the element's state."""
        rates = self._evaluated(context, empty(self._force_size, self._scalar))[1]
        derivatives.get_mutable_vector().SetFromVector(rates)


def element_system(
    kind: ElementKind, packed: FloatArray, initial: Sequence[float] | FloatArray = ()
) -> Any:
    """Return a system of an element, of the class of its kind.

    Args:
        kind: Kind of the element.
        packed: Its packed numbers.
        initial: Its state in a default Context.
    """
    base = ElementSystemWithState if len(initial) else ElementSystem
    return _class_of(kind, base)(packed, initial)


@functools.cache
def _class_of(kind: ElementKind, base: Any) -> Any:
    """Return the template of the classes of a kind, one for each scalar type."""

    def of_scalar(T: type) -> Any:
        class Impl(base, LeafSystem_[T]):
            __slots__ = NO_SLOTS
            __doc__ = f"{kind.title}: {kind.words or kind.name}; see `ElementSystem`."

            def _construct(self, packed: FloatArray, initial: Any, converter: Any = None) -> None:
                LeafSystem_[T].__init__(self, converter=converter)
                self.declare_element(T, packed, initial)

        Impl.kind = kind
        return Impl

    return define_system(f"{kind.title}_", __name__)(of_scalar)
