"""Speed source of the drum."""

from typing import Any

from pydrake.systems.framework import BasicVector_, LeafSystem_, NumericParameterIndex
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.systems.element import SCALARS

REFLECTED_INERTIA = 1e8
"""Inertia of the drive at the drum joint. [kg m^2] Not physical: it enters only the joint's diagonal of the mass matrix, so
that actuation J alpha turns the drum with alpha, whatever the tub does, to one part in 1e8. The motor torque is what
remains: J (alpha - rate of drum speed)."""


@TemplateSystem.define("SpeedSource_", T_list=SCALARS)
def SpeedSource_(T: type) -> Any:
    """Template of SpeedSource."""

    class SpeedSource(LeafSystem_[T]):
        """Prescribes the angular acceleration of the drum: one straight piece of a spin profile.

            [ SpeedSource ] ──▶ actuation (1) [N m]
              parameter: angular acceleration [rad/s^2]

        A profile jumps from piece to piece. An explicit integrator must not see a jump inside a step, so whoever runs the
        simulation ends a step there and sets the next piece's acceleration (`wm_drake.engines.drake`).
        """

        def _construct(self, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.parameter_index = self.DeclareNumericParameter(BasicVector_[T]([0.0]))
            needs = {self.numeric_parameter_ticket(NumericParameterIndex(self.parameter_index))}
            self.DeclareVectorOutputPort("actuation", 1, self._calc_actuation, needs)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, converter=converter)

        def _calc_actuation(self, context: Any, output: Any) -> None:
            output.SetFromVector(
                REFLECTED_INERTIA
                * context.get_numeric_parameter(self.parameter_index).CopyToVector()
            )

        def set_acceleration(self, context: Any, acceleration: float) -> None:
            """Sets the acceleration [rad/s^2] in the source's own Context."""
            context.get_mutable_numeric_parameter(self.parameter_index).SetFromVector(
                [acceleration]
            )

    Impl = SpeedSource
    return SpeedSource


SpeedSource = SpeedSource_[None]
