"""Compliant bearing of the drum: a six-component bushing between the tub and the drum carrier."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.bearing import evaluate_drum_bearing
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element_system import ElementSystem, define_system

OWN_OUTPUTS = {
    "displacement": slice(0, 3),
    "rotation": slice(3, 6),
    "force": slice(6, 9),
    "moment": slice(9, 12),
}
"""Own output ports, and their part of the own numbers of the element."""


@define_system("DrumBearing_", __name__)
def DrumBearing_(T: type) -> Any:
    """Return the class DrumBearing for a scalar type."""

    class DrumBearing(ElementSystem, LeafSystem_[T]):
        """Compliant bearing of the drum; law `bushing_force`.

            plant_state (28) ──▶ [ DrumBearing ] ──▶ generalized_force (14) [N m, N]
                                                 ──▶ displacement (3) of the carrier [m]
                                                 ──▶ rotation (3) of the carrier [rad]
                                                 ──▶ force (3) on the tub [N]
                                                 ──▶ moment (3) on the tub [N m]

        The generalized force acts on tub and drum (7), then on carrier and drum (7). The stiffness
        and the own outputs are in the frame of the tub whose y axis is the drum axis. Force and
        moment on the tub act at the point of the carrier.
        """

        def _construct(self, parameters: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(T, evaluate_drum_bearing, parameters, OWN_OUTPUTS, trees=2)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, converter=converter)

    Impl = DrumBearing
    return DrumBearing


DrumBearing = DrumBearing_[None]
