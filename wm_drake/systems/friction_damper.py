"""Friction damper, as a massless strut between a point of the tub and a point of the housing."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem_
from pydrake.systems.primitives import Demultiplexer, Integrator
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.laws.compilation import law
from wm_drake.laws.damper import COULOMB, FREE_STROKE, HAVSIN, MSTV, STV, STV_SPONGE, damper_response
from wm_drake.laws.elementary import numbers
from wm_drake.laws.motion import tub_motion
from wm_drake.laws.strut import bending_moment, strut_line, transverse, transverse_couple, wrench_at_origin
from wm_drake.laws.vectors import add, cross, rotate, scale, subtract
from wm_drake.parameters.elements import (
    CoulombDamper,
    DamperType,
    EndBushing,
    FloatArray,
    FreeStrokeDamper,
    HavsinDamper,
    StvDamper,
    StvSpongeDamper,
    packed_stiffness,
)
from wm_drake.systems.element import GENERALIZED_FORCE_SIZE, SCALARS, ForceElement


def packed_damper_law(damper: DamperType) -> FloatArray:
    """Law number, then its parameters in the order of `wm_drake.laws.damper`."""
    match damper:
        case CoulombDamper():
            return np.array([COULOMB, damper.friction_force, damper.damping])
        case StvDamper():
            return np.array([STV, damper.friction_force, damper.transition_velocity, damper.damping])
        case HavsinDamper():
            return np.array([HAVSIN, damper.friction_force, damper.full_friction_velocity, damper.damping])
    if isinstance(damper, StvSpongeDamper):
        sponge = [damper.sponge_stiffness, damper.sponge_damping, damper.slider_damping]
        return np.array([STV_SPONGE, damper.friction_force, damper.transition_velocity, *sponge])
    friction = [damper.friction_force, damper.friction_damping, damper.regularisation_velocity]
    if isinstance(damper, FreeStrokeDamper):
        basic = [damper.basic_friction_force, damper.basic_full_friction_velocity]
        return np.concatenate([[FREE_STROKE], friction, basic, packed_stiffness(damper.sponge)])
    return np.array([MSTV, *friction, damper.sponge_stiffness, damper.sponge_damping, damper.slider_damping])


def has_sponge(packed_law: FloatArray) -> bool:
    """Whether a packed law has a state."""
    return int(packed_law[0]) in (MSTV, FREE_STROKE, STV_SPONGE)


def law_structure(packed_law: FloatArray) -> list[int]:
    """Number of a packed law, and of the points of its sponge's table if it has one."""
    number = int(packed_law[0])
    return [number, int(packed_law[6])] if number == FREE_STROKE else [number]


ENGAGED = 13
"""Where the packed parameters say whether the damper is in the machine."""


@dataclass(frozen=True)
class FrictionDamperParameters:
    """A damper in its place: ends at the rest pose, law, bushings at the ends. `engaged` 0 takes it out of the machine."""

    p_ToA_T: FloatArray
    p_WH: FloatArray
    end_bushing: EndBushing
    packed_law: FloatArray
    engaged: float = 1.0

    @property
    def has_sponge(self) -> bool:
        """Whether the law has a state."""
        return has_sponge(self.packed_law)

    @property
    def structure(self) -> list[int]:
        """Number of its law, and of the points of its sponge's table if it has one."""
        return law_structure(self.packed_law)

    def packed(self) -> FloatArray:
        """Flat: tub end (T), housing end (W), axis; end bushing k, c, p, pi / (2 v_t); engaged; law number, its parameters."""
        line = self.p_ToA_T - self.p_WH
        b = self.end_bushing
        bushing = [b.stiffness, b.damping, b.friction_torque, 0.5 * np.pi / b.full_friction_rate, self.engaged]
        return np.concatenate([self.p_ToA_T, self.p_WH, line / math.dist(self.p_ToA_T, self.p_WH), bushing, self.packed_law])


@law
def friction_damper_line(motion, p, at):
    """Arm of the tub end in W and `strut_line` of a damper.

    Args:
        motion: `TubMotion`.
        p, at: Array that holds what `FrictionDamperParameters.packed` gives, and where that begins.
    """
    arm = rotate(motion.rotation, (p[at], p[at + 1], p[at + 2]))
    return arm, strut_line(motion, arm, (p[at + 3], p[at + 4], p[at + 5]))


@law
def friction_damper_tension(elongation_rate, deformation, p, at):
    """Tension and rate of deformation; `deformation` of the sponge is any number for a law without one. [N, m/s; m]"""
    return damper_response(int(p[at + 14]), elongation_rate, deformation, p, at + 15)


@law
def friction_damper_wrench(motion, arm, line, tension, p, at):
    """Moment about To and force on the tub (six numbers, W) of a damper under a tension; arguments as above."""
    _, _, direction, v_A, inverse_length = line
    axis, engaged = (p[at + 6], p[at + 7], p[at + 8]), p[at + ENGAGED]
    bushing = (p[at + 9], p[at + 10], p[at + 11], p[at + 12])
    w_strut = scale(inverse_length, cross(direction, v_A))
    against_tub = subtract(w_strut, transverse(motion.angular_velocity, direction))
    on_strut_by_tub = bending_moment(direction, against_tub, rotate(motion.rotation, axis), *bushing)
    on_strut_by_housing = bending_moment(direction, w_strut, axis, *bushing)
    couple = transverse_couple(add(on_strut_by_tub, on_strut_by_housing), direction, inverse_length)
    force = scale(engaged, add(scale(-tension, direction), couple))
    return wrench_at_origin(arm, force, scale(-engaged, on_strut_by_tub))


@law
def evaluate_friction_damper(x, state, p, generalized_force, force, rate):
    """Force of a damper strut; arguments as in `ForceElement`, parameters as in `FrictionDamperParameters.packed`."""
    deformation = state[0] if len(state) > 0 else 0.0 * x[0]
    motion, q = tub_motion(numbers(x)), numbers(p)
    arm, line = friction_damper_line(motion, q, 0)
    tension, deformation_rate = friction_damper_tension(line[1], deformation, q, 0)
    wrench = friction_damper_wrench(motion, arm, line, tension, q, 0)
    for i in range(6):
        generalized_force[i] = wrench[i]
    generalized_force[6] = 0.0 * tension
    force[0] = p[ENGAGED] * tension
    if len(rate) > 0:
        rate[0] = deformation_rate


@TemplateSystem.define("DamperForce_", T_list=SCALARS)
def DamperForce_(T: type) -> Any:
    """Template of DamperForce."""

    class DamperForce(ForceElement, LeafSystem_[T]):
        """Force of a damper strut with bushings at its ends; laws `damper_response`, `bending_moment`.

        plant_state (14) ──▶ [ DamperForce ] ──▶ generalized_force (7) [N m, N], and the rate (1) of the state [m/s]
        state (1) [m]    ──▶                 ──▶ force (1) tension, > 0 pulls its ends together [N]
        """

        def _construct(self, parameters: FloatArray, state_size: int, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(T, evaluate_friction_damper, parameters, force_size=1, state_size=state_size)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, other.state_size, converter=converter)

    Impl = DamperForce
    return DamperForce


DamperForce = DamperForce_[None]


class DamperWithSponge(Diagram):
    """A force of a damper, and the integrator that holds the deformation of its sponge, if it has one."""

    def __init__(self, force: Any, state_size: int, generalized_force_size: int) -> None:
        """Puts both together; `force` is a `ForceElement`."""
        super().__init__()
        builder = DiagramBuilder()
        self._force = builder.AddNamedSystem("force", force)
        self.state_size = state_size
        builder.ExportInput(self._force.GetInputPort("plant_state"), "plant_state")
        if state_size:
            split = builder.AddNamedSystem("split", Demultiplexer([generalized_force_size, state_size]))
            sponge = builder.AddNamedSystem("sponge", Integrator(state_size))
            builder.Connect(self._force.GetOutputPort("generalized_force_and_rate"), split.get_input_port())
            builder.Connect(split.get_output_port(1), sponge.get_input_port())
            builder.Connect(sponge.get_output_port(), self._force.GetInputPort("state"))
            builder.ExportOutput(split.get_output_port(0), "generalized_force")
            builder.ExportOutput(self._force.GetOutputPort("force"), "force")
            builder.ExportOutput(sponge.get_output_port(), "state")
        else:
            builder.ExportOutput(self._force.GetOutputPort("generalized_force"), "generalized_force")
            builder.ExportOutput(self._force.GetOutputPort("force"), "force")
        builder.BuildInto(self)

    def set_parameters(self, context: Any, parameters: FloatArray) -> None:
        """Puts packed parameters into the damper's Context; as `ForceElement.set_parameters`."""
        self._force.set_parameters(self.GetMutableSubsystemContext(self._force, context), parameters, self.get_name())

    def hold(self, context: Any) -> None:
        """As `ForceElement.hold`, of the force inside."""
        self._force.hold(self.GetSubsystemContext(self._force, context))

    def release(self) -> None:
        """As `ForceElement.release`."""
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
