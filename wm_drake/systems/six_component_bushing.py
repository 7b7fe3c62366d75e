"""Six-component bushing between a frame of the tub and a frame of the housing; the gasket is one."""

from typing import Any

from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.elements.bushing import evaluate_six_component_bushing
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element import SCALARS, ElementSystem


@TemplateSystem.define("SixComponentBushing_", T_list=SCALARS)
def SixComponentBushing_(T: type) -> Any:
    """Template of SixComponentBushing."""

    class SixComponentBushing(ElementSystem, LeafSystem_[T]):
        """A six-component bushing; law `bushing_force`. Stiffness lives in the housing-side frame G.

            plant_state (14) ──▶ [ SixComponentBushing ] ──▶ generalized_force (7) [N m, N]
                                                         ──▶ force (6) on the housing, in G: force [N], moment [N m]

        The force on the housing acts at the tub-side point, where that of the tub does.
        """

        def _construct(self, parameters: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(
                T, evaluate_six_component_bushing, parameters, force_size=6, state_size=0
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, converter=converter)

    Impl = SixComponentBushing
    return SixComponentBushing


SixComponentBushing = SixComponentBushing_[None]
