"""A cabinet that moves: the frame that all mounts stand on."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.cabinet import evaluate_mounts_on_cabinet, evaluate_tub_in_cabinet
from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE, PLANT_STATE_SIZE
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import define_system, empty, evaluator


@define_system("Cabinet_", __name__)
def Cabinet_(T: type) -> Any:
    """Return the class Cabinet for a scalar type."""

    class Cabinet(LeafSystem_[T]):
        """Cabinet that moves: it shows the tub to its mounts, and takes their reaction.

            plant_state (28)  ──▶ [ Cabinet ] ──▶ tub_in_cabinet (14)
            mounts_force (7)  ──▶ [         ] ──▶ generalized_force (14) [N m, N]
            feet_force (7)    ──▶ [         ]

        The plant state is that of tub and drum (14), then that of cabinet and drum (14), in W.
        `tub_in_cabinet` is the state of tub and drum seen from the cabinet, in its frame C;
        `mounts_force` is the generalized force of all mounts on tub and drum, in C; `feet_force`
        is that of the floor on the cabinet, in W. The generalized force acts on tub and drum, then
        on cabinet and drum, in W.
        """

        __slots__ = NO_SLOTS

        def _construct(self, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._seen = evaluator(evaluate_tub_in_cabinet, T)
            self._reactions = evaluator(evaluate_mounts_on_cabinet, T)
            self._state = self.DeclareVectorInputPort("plant_state", 2 * PLANT_STATE_SIZE)
            self._on_tub, self._on_feet = (
                self.DeclareVectorInputPort(name, GENERALIZED_FORCE_SIZE)
                for name in ("mounts_force", "feet_force")
            )
            state = self._state.ticket()
            self.DeclareVectorOutputPort(
                "tub_in_cabinet", PLANT_STATE_SIZE, callback(self._calc_seen), {state}
            )
            self.DeclareVectorOutputPort(
                "generalized_force",
                2 * GENERALIZED_FORCE_SIZE,
                callback(self._calc_force),
                {state, self._on_tub.ticket(), self._on_feet.ticket()},
            )

        def _calc_seen(self, context: Any, output: Any) -> None:
            state, seen = self._state.Eval(context), empty(PLANT_STATE_SIZE, T)
            self._seen(state[:PLANT_STATE_SIZE], state[PLANT_STATE_SIZE:], seen)
            output.SetFromVector(seen)

        def _calc_force(self, context: Any, output: Any) -> None:
            force = empty(2 * GENERALIZED_FORCE_SIZE, T)
            inputs = (port.Eval(context) for port in (self._state, self._on_tub, self._on_feet))
            self._reactions(*inputs, force)
            output.SetFromVector(force)

    return Cabinet


Cabinet = Cabinet_[None]
