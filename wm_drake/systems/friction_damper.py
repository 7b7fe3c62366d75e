"""Friction damper, a massless strut between a point of the tub and a point of the housing."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.friction_damper import evaluate_friction_damper
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element_system import ElementSystem, define_system


@define_system("FrictionDamper_", __name__)
def FrictionDamper_(T: type) -> Any:
    """Return the class FrictionDamper for a scalar type."""

    class FrictionDamper(ElementSystem, LeafSystem_[T]):
        """Friction damper with end bushings; laws `damper_response` and `bending_moment`.

            plant_state (14) ──▶ [ FrictionDamper  ] ──▶ generalized_force (7) [N m, N]
                                 [ (state: sponge) ] ──▶ force (1), tension > 0 [N]
                                                     ──▶ state (1) deformation of the sponge [m]

        A law with a sponge has one continuous state, the deformation of the sponge: construct it
        with `state_size` 1. A law without a sponge has `state_size` 0 and no port "state".
        """

        def _construct(
            self, parameters: FloatArray, state_size: int, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(
                T,
                evaluate_friction_damper,
                parameters,
                {"force": slice(0, 1)},
                state_size=state_size,
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, other.state_size, converter=converter)

    Impl = FrictionDamper
    return FrictionDamper


FrictionDamper = FrictionDamper_[None]
