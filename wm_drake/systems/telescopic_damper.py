"""Telescopic damper: outer and inner tube are bodies, each held by a six-component bushing, friction along the joint."""

from typing import Any

from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE
from wm_drake.elements.telescopic_damper import FORCE_SIZE, evaluate_telescopic_damper
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element import SCALARS, ElementSystem
from wm_drake.systems.friction_damper import DamperWithSponge


@TemplateSystem.define("TelescopeForce_", T_list=SCALARS)
def TelescopeForce_(T: type) -> Any:
    """Template of TelescopeForce."""

    class TelescopeForce(ElementSystem, LeafSystem_[T]):
        """Forces of a telescopic damper; laws `bushing_force` twice, and `damper_response`.

        plant_state (28) ──▶ [ TelescopeForce ] ──▶ generalized_force (14) [N m, N], and the rate (1) of the state [m/s]
        state (1) [m]    ──▶                    ──▶ force (13), see `FORCE_SIZE` [N, N m]
        """

        def _construct(
            self, parameters: FloatArray, state_size: int, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(
                T,
                evaluate_telescopic_damper,
                parameters,
                force_size=FORCE_SIZE,
                state_size=state_size,
                trees=2,
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, other.state_size, converter=converter)

    Impl = TelescopeForce
    return TelescopeForce


TelescopeForce = TelescopeForce_[None]


class TelescopicDamper(DamperWithSponge):
    """A telescopic damper; where its law has a sponge, the sponge's deformation is its continuous state.

    plant_state (28) ──▶ [ TelescopicDamper      ] ──▶ generalized_force (14) on tub and drum, on tubes and joint [N m, N]
                         [ force ──▶ rate        ] ──▶ force (13) own forces [N, N m]
                         [   ◀── sponge (state)  ] ──▶ state (1) deformation, only with a sponge [m]
    """

    def __init__(self, parameters: FloatArray, state_size: int) -> None:
        """Builds the damper from packed parameters; `state_size` is 1 for a law with a sponge, else 0."""
        super().__init__(
            TelescopeForce(parameters, state_size), state_size, 2 * GENERALIZED_FORCE_SIZE
        )
