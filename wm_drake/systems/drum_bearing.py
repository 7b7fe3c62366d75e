"""Bearing of the drum where it gives: a six-component bushing between the tub and what carries the drum."""

from typing import Any

from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.elements.bearing import FORCE_SIZE, evaluate_drum_bearing
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element import SCALARS, ElementSystem


@TemplateSystem.define("DrumBearing_", T_list=SCALARS)
def DrumBearing_(T: type) -> Any:
    """Template of DrumBearing."""

    class DrumBearing(ElementSystem, LeafSystem_[T]):
        """The bearing of the drum; law `bushing_force`. Stiffness lives in the frame on the tub, y along the drum axis.

            plant_state (28) ──▶ [ DrumBearing ] ──▶ generalized_force (14) on tub and drum, on carrier and drum [N m, N]
                                                 ──▶ force (12), see `FORCE_SIZE` [m, rad, N, N m]

        Force and moment on the tub act at the point of the carrier.
        """

        def _construct(self, parameters: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(
                T, evaluate_drum_bearing, parameters, force_size=FORCE_SIZE, state_size=0, trees=2
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, converter=converter)

    Impl = DrumBearing
    return DrumBearing


DrumBearing = DrumBearing_[None]
