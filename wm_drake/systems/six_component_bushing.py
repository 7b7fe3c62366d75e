"""Six-component bushing, such as the gasket, between a frame of the tub and one of the housing."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.bushing import evaluate_six_component_bushing
from wm_drake.elements.rubber import evaluate_rubber_bushing
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element_system import ElementSystem, define_system


@define_system("SixComponentBushing_", __name__)
def SixComponentBushing_(T: type) -> Any:
    """Return the class SixComponentBushing for a scalar type."""

    class SixComponentBushing(ElementSystem, LeafSystem_[T]):
        """Six-component bushing; law `bushing_force`, with branches of rubber `rubber_forces` too.

            plant_state (14) ──▶ [ SixComponentBushing ] ──▶ generalized_force (7) [N m, N]
                                 [ (state: stretches)  ] ──▶ force (3) on the housing, in G [N]
                                                         ──▶ moment (3) on the housing, in G [N m]
                                                         ──▶ (state) stretch of each branch [m, rad]

        The stiffness is in the housing-side frame G. Force and moment on the housing act at the
        tub-side point, as those on the tub do. Construct it with `rubber` for the numbers of
        `RUBBER_BUSHING`, with one continuous state for each branch in use.
        """

        def _construct(
            self,
            parameters: FloatArray,
            rubber: bool = False,
            state_size: int = 0,
            converter: Any = None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.rubber = rubber
            self.declare_element(
                T,
                evaluate_rubber_bushing if rubber else evaluate_six_component_bushing,
                parameters,
                {"force": slice(0, 3), "moment": slice(3, 6)},
                state_size=state_size,
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, other.rubber, other.state_size, converter=converter)

    Impl = SixComponentBushing
    return SixComponentBushing


SixComponentBushing = SixComponentBushing_[None]
