"""External force on the tub, for the systems of a user."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import define_system


@define_system("TubForce_", __name__)
def TubForce_(T: type) -> Any:
    """Return the class TubForce for a scalar type."""

    class TubForce(LeafSystem_[T]):
        """External spatial force on the tub; zero if no value is connected or fixed.

            tub_force (6) ──▶ [ TubForce ] ──▶ generalized_force (7) [N m, N]

        `tub_force` is moment about To and force on the tub, in W. [N m, N]
        """

        __slots__ = NO_SLOTS

        def _construct(self, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._force = self.DeclareVectorInputPort("tub_force", GENERALIZED_FORCE_SIZE - 1)
            self.DeclareVectorOutputPort(
                "generalized_force",
                GENERALIZED_FORCE_SIZE,
                callback(self._calc),
                {self._force.ticket()},
            )

        def _calc(self, context: Any, output: Any) -> None:
            force = [T(0.0)] * GENERALIZED_FORCE_SIZE
            if self._force.HasValue(context):
                force[:-1] = self._force.Eval(context)
            output.SetFromVector(force)

    return TubForce


TubForce = TubForce_[None]
