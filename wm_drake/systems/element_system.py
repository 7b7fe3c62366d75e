"""One LeafSystem for elements of all kinds."""

from collections.abc import Callable, Sequence
from typing import Any

from pydrake.systems.framework import BasicVector_, LeafSystem_

from wm_drake.elements.kind import ElementKind
from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE, PLANT_STATE_SIZE
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import Packed, define_system, empty, evaluator


@define_system("ElementSystem_", __name__)
def ElementSystem_(T: type) -> Any:
    """Return the class ElementSystem for a scalar type."""

    class ElementSystem(Packed, LeafSystem_[T]):
        """An element that puts a force on the plant, of any `ElementKind`.

            plant_state ──▶ [ element ] ──▶ generalized_force   moment about To, force (W), drum torque
                            [ (state) ] ──▶ own outputs         force, moment, ... of the element
                                        ──▶ state               if the element has a state

        The law of the kind, `ElementKind.on_plant`, writes the generalized force, its own numbers
        and the time derivative of its state. The plant state and the generalized force have one
        part for each tree of the plant that the element acts on, one after the other. The packed
        numbers are a numeric parameter of the Context. AutoDiffXd computes derivatives with respect
        to state and numbers. In a default Context the state is `initial`. A system holds no Context.
        """  # noqa: E501

        __slots__ = NO_SLOTS

        def _construct(
            self,
            kind: ElementKind,
            packed: FloatArray,
            initial: Sequence[float] | FloatArray = (),
            converter: Any = None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            # a scalar-converted copy is constructed from these
            self.kind, self.initial = kind, initial
            self.state_size = state_size = len(initial)
            self._evaluate = evaluator(kind.on_plant, T)
            self._sizes = kind.trees * GENERALIZED_FORCE_SIZE, kind.output_size, state_size
            self._plant_state = self.DeclareVectorInputPort(
                "plant_state", kind.trees * PLANT_STATE_SIZE
            )
            needs = {self._plant_state.ticket(), self.declare_numbers(T, packed)}
            if state_size:
                state = self.DeclareContinuousState(BasicVector_[T](initial))
                needs.add(self.xc_ticket())
            outputs = {"generalized_force": (0, slice(0, self._sizes[0]))}
            outputs |= {name: (1, part) for name, part in kind.output_parts.items()}
            for name, (vector, part) in outputs.items():
                calc = _output(callback(self._calc), vector, part)
                self.DeclareVectorOutputPort(name, part.stop - part.start, calc, needs)
            if state_size:
                self.DeclareStateOutputPort("state", state)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.kind, other.packed, other.initial, converter=converter)

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            """Write the time derivative of the element's state."""
            if self.state_size:
                derivatives.get_mutable_vector().SetFromVector(self._calc(context)[2])

        def _calc(self, context: Any) -> tuple[Any, ...]:
            """Return generalized force, own numbers and time derivative of the state."""
            written = tuple(empty(size, T) for size in self._sizes)
            self._evaluate(
                self._plant_state.Eval(context),
                context.get_continuous_state_vector().CopyToVector(),
                self.packed_numbers(context),
                *written,
            )
            return written

    Impl = ElementSystem
    return ElementSystem


def _output(
    calc: Callable[[Any], tuple[Any, ...]], vector: int, part: slice
) -> Callable[[Any, Any], None]:
    """Return the callback of an output port that is a part of one of the computed vectors."""

    def write(context: Any, output: Any) -> None:
        output.SetFromVector(calc(context)[vector][part])

    return write


ElementSystem = ElementSystem_[None]
