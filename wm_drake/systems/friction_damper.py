"""Friction damper, as a massless strut between a point of the tub and a point of the housing."""

from typing import Any

from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem_
from pydrake.systems.primitives import Demultiplexer, Integrator
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.elements.friction_damper import evaluate_friction_damper
from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.element import SCALARS, ElementSystem


@TemplateSystem.define("DamperForce_", T_list=SCALARS)
def DamperForce_(T: type) -> Any:
    """Template of DamperForce."""

    class DamperForce(ElementSystem, LeafSystem_[T]):
        """Force of a damper strut with bushings at its ends; laws `damper_response`, `bending_moment`.

        plant_state (14) ──▶ [ DamperForce ] ──▶ generalized_force (7) [N m, N], and the rate (1) of the state [m/s]
        state (1) [m]    ──▶                 ──▶ force (1) tension, > 0 pulls its ends together [N]
        """

        def _construct(
            self, parameters: FloatArray, state_size: int, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(
                T, evaluate_friction_damper, parameters, force_size=1, state_size=state_size
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, other.state_size, converter=converter)

    Impl = DamperForce
    return DamperForce


DamperForce = DamperForce_[None]


class DamperWithSponge(Diagram):
    """A force of a damper, and the integrator that holds the deformation of its sponge, if it has one."""

    def __init__(self, force: Any, state_size: int, generalized_force_size: int) -> None:
        """Puts both together; `force` is a `ElementSystem`."""
        super().__init__()
        builder = DiagramBuilder()
        self._force = builder.AddNamedSystem("force", force)
        self.state_size = state_size
        builder.ExportInput(self._force.GetInputPort("plant_state"), "plant_state")
        if state_size:
            split = builder.AddNamedSystem(
                "split", Demultiplexer([generalized_force_size, state_size])
            )
            sponge = builder.AddNamedSystem("sponge", Integrator(state_size))
            builder.Connect(
                self._force.GetOutputPort("generalized_force_and_rate"), split.get_input_port()
            )
            builder.Connect(split.get_output_port(1), sponge.get_input_port())
            builder.Connect(sponge.get_output_port(), self._force.GetInputPort("state"))
            builder.ExportOutput(split.get_output_port(0), "generalized_force")
            builder.ExportOutput(self._force.GetOutputPort("force"), "force")
            builder.ExportOutput(sponge.get_output_port(), "state")
        else:
            builder.ExportOutput(
                self._force.GetOutputPort("generalized_force"), "generalized_force"
            )
            builder.ExportOutput(self._force.GetOutputPort("force"), "force")
        builder.BuildInto(self)

    def set_parameters(self, context: Any, parameters: FloatArray) -> None:
        """Puts packed parameters into the damper's Context; as `ElementSystem.set_parameters`."""
        self._force.set_parameters(
            self.GetMutableSubsystemContext(self._force, context), parameters, self.get_name()
        )

    def hold(self, context: Any) -> None:
        """As `ElementSystem.hold`, of the force inside."""
        self._force.hold(self.GetSubsystemContext(self._force, context))

    def release(self) -> None:
        """As `ElementSystem.release`."""
        self._force.release()


class FrictionDamper(DamperWithSponge):
    """A friction damper of any law; where it has a sponge, the sponge's deformation is its continuous state.

    plant_state (14) ──▶ [ FrictionDamper        ] ──▶ generalized_force (7) [N m, N]
                         [ force ──▶ rate        ] ──▶ force (1) tension, > 0 pulls its ends together [N]
                         [   ◀── sponge (state)  ] ──▶ state (1) deformation, only with a sponge [m]
    """

    def __init__(self, parameters: FloatArray, state_size: int) -> None:
        """Builds the damper from packed parameters; `state_size` is 1 for a law with a sponge, else 0."""
        super().__init__(DamperForce(parameters, state_size), state_size, GENERALIZED_FORCE_SIZE)
