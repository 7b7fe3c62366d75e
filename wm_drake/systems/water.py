"""Water in the laundry as a system: what is left in each wet mass of the load."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import AbstractParameterIndex, BasicVector_, LeafSystem_

from wm_drake.elements.water import rate_of_water
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS
from wm_drake.systems.scalars import define_system, empty, evaluator


@define_system("Water_", __name__)
def Water_(T: type) -> Any:
    """Return the class Water for a scalar type."""

    class Water(LeafSystem_[T]):
        """Share of the water that is left in each wet mass; law `rate_of_water`.

            drum_speed (1) ──▶ [ Water ] ──▶ left (k)
              parameter: packed numbers of each wet mass (abstract)

        By default all water is left. Masses beyond those of the load keep their state. Drake has
        masses as parameters of a Context, not as functions of its state: `Setup.follow_water` sets
        them from this state.
        """

        __slots__ = NO_SLOTS

        def _construct(
            self, count: int, packed: Sequence[FloatArray], converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            # a scalar-converted copy is constructed from these
            self.count, self.packed = count, tuple(packed)
            self._rate_of = evaluator(rate_of_water, T)
            self._drum_speed = self.DeclareVectorInputPort("drum_speed", 1)
            self._index = self.DeclareAbstractParameter(Value[object](self.packed))
            state = self.DeclareContinuousState(BasicVector_[T](np.ones(count)))
            self.DeclareStateOutputPort("left", state)

        def set_load(self, context: Any, packed: Sequence[FloatArray]) -> None:
            """Set the numbers of each wet mass in the system's own Context, with all its water."""
            context.get_mutable_abstract_parameter(self._index).set_value(tuple(packed))
            context.SetContinuousState(np.ones(self.count))

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            """Write the rates of the shares."""
            packed = context.get_abstract_parameter(AbstractParameterIndex(self._index)).get_value()
            left = context.get_continuous_state_vector().CopyToVector()
            speed = self._drum_speed.Eval(context)[0]
            rates = empty(self.count, T)
            for k in range(self.count):
                wet = k < len(packed)
                rates[k] = self._rate_of(left[k], speed, packed[k], 0) if wet else T(0.0)
            derivatives.get_mutable_vector().SetFromVector(rates)

    return Water


Water = Water_[None]
