"""Telescopic damper: two tubes as bodies, two bushings, and friction along the joint."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.telescopic_damper import evaluate_telescopic_damper
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element_system import ElementSystem, define_system

OWN_OUTPUTS = {
    "force": slice(0, 1),
    "tub_bushing_force": slice(1, 4),
    "tub_bushing_moment": slice(4, 7),
    "housing_bushing_force": slice(7, 10),
    "housing_bushing_moment": slice(10, 13),
}
"""Own output ports, and their part of the own numbers of the element."""


@define_system("TelescopicDamper_", __name__)
def TelescopicDamper_(T: type) -> Any:
    """Return the class TelescopicDamper for a scalar type."""

    class TelescopicDamper(ElementSystem, LeafSystem_[T]):
        """Telescopic damper; laws `bushing_force` twice, and `damper_response` along the joint.

            plant_state (28) ──▶ [ TelescopicDamper ] ──▶ generalized_force (14) [N m, N]
                                 [ (state: sponge)  ] ──▶ force (1), tension > 0 [N]
                                                      ──▶ tub_bushing_force (3) [N]
                                                      ──▶ tub_bushing_moment (3) [N m]
                                                      ──▶ housing_bushing_force (3) [N]
                                                      ──▶ housing_bushing_moment (3) [N m]
                                                      ──▶ state (1) deformation of the sponge [m]

        The generalized force acts on tub and drum (7), then on tubes and joint (7). `force` is that
        of the law along the joint. Force and moment of the tub bushing act on the outer tube, in
        its frame; those of the housing bushing act on the housing. Construct it with `state_size` 1
        for a law with a sponge, else 0; without a sponge there is no port "state".
        """

        def _construct(
            self, parameters: FloatArray, state_size: int, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(
                T,
                evaluate_telescopic_damper,
                parameters,
                OWN_OUTPUTS,
                state_size=state_size,
                trees=2,
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, other.state_size, converter=converter)

    Impl = TelescopicDamper
    return TelescopicDamper


TelescopicDamper = TelescopicDamper_[None]
