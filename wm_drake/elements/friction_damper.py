"""Friction damper, as a massless strut between a point of the tub and a point of the housing."""

import math
from dataclasses import dataclass, replace

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.packed import LAYOUT, SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, cross, rotate, scale, subtract
from wm_drake.elements.damper_law import (
    LAW,
    damper_response,
    frictionless_law,
    law_of,
    law_structure,
    packed_damper_law,
)
from wm_drake.elements.kind import Described, ElementKind, Ends, Output
from wm_drake.elements.layouts import layout_of, packed_fields, packed_once
from wm_drake.elements.motion import tub_motion, write_generalized_force
from wm_drake.elements.strut import STRUT_ENDS, strut_line, transverse, wrench_at_origin
from wm_drake.laws.strut import bending_moment, transverse_couple
from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.elements import Damper, EndBushing
from wm_drake.parameters.types import FloatArray

END_BUSHING = layout_of("EndBushingNumbers", EndBushing, tuple(EndBushing.model_fields))
"""Numbers of the bushings at both ends, in the order of `EndBushing`."""
FRICTION_DAMPER = PackedLayout(
    "FrictionDamperNumbers",
    p_ToA_T=VECTOR,
    p_WH=VECTOR,
    axis=VECTOR,
    engaged=SCALAR,
    end_bushing=LAYOUT(END_BUSHING),
    law=LAW,
)
"""Tub end (T) and housing end (W) [m], unit vector from the housing end to the tub end at the rest
pose, 1 or 0 for a damper whose law is taken out, end bushings, law."""
read_end_bushing, read_friction_damper = END_BUSHING.read, FRICTION_DAMPER.read


@dataclass(frozen=True)
class FrictionDamperParameters:
    """A damper in its place: ends at the rest pose, end bushings, law.

    `engaged` 0 takes the law out, not the end bushings.
    """

    p_ToA_T: FloatArray
    p_WH: FloatArray
    end_bushing: EndBushing
    packed_law: FloatArray
    engaged: float = 1.0

    @property
    def kind(self) -> ElementKind:
        """Return the kind of the element."""
        return FRICTION_DAMPER_STRUT

    @property
    def state_size(self) -> int:
        """Return the number of own states: 1 for a law with a sponge."""
        return int(self.has_sponge)

    @property
    def has_sponge(self) -> bool:
        """Whether the law has a state."""
        return law_of(self.packed_law).has_sponge

    @property
    def structure(self) -> list[int]:
        """Number of its law, and of the points of its sponge's table if it has one."""
        return law_structure(self.packed_law)

    def without_friction(self) -> "FrictionDamperParameters":
        """Return the damper without friction, as a small motion on top of steady sliding has it."""
        law = frictionless_law(self.packed_law)
        return replace(self, end_bushing=self._end_bushing_without_friction(), packed_law=law)

    def without_law(self) -> "FrictionDamperParameters":
        """Return the end bushings alone, without friction."""
        return replace(self, end_bushing=self._end_bushing_without_friction(), engaged=0.0)

    def _end_bushing_without_friction(self) -> EndBushing:
        return self.end_bushing.model_copy(update={"friction_torque": 0.0})

    @property
    def axis(self) -> FloatArray:
        """Unit vector from the housing end to the tub end, as drawn."""
        return (self.p_ToA_T - self.p_WH) / math.dist(self.p_ToA_T, self.p_WH)

    @packed_once
    def packed(self) -> FloatArray:
        """Return the numbers of `FRICTION_DAMPER`."""
        return FRICTION_DAMPER.pack(
            p_ToA_T=self.p_ToA_T,
            p_WH=self.p_WH,
            axis=self.axis,
            engaged=self.engaged,
            end_bushing=packed_fields(END_BUSHING, self.end_bushing),
            law=self.packed_law,
        )


@law
def friction_damper_line(motion, p, at):
    """Return the arm of the tub end in W, and `strut_line`, of a damper.

    Args:
        motion: `TubMotion`.
        p, at: Array that holds the numbers of `FRICTION_DAMPER`, and where they begin.
    """
    damper = read_friction_damper(p, at)
    arm = rotate(motion.rotation, damper.p_ToA_T)
    return arm, strut_line(motion, arm, damper.p_WH)


@law
def friction_damper_tension(elongation_rate, deformation, p, at):
    """Return the tension that the law of a damper gives, and the deformation rate of its sponge.

    Args:
        elongation_rate: Rate of its length. [m/s]
        deformation: Deformation of the sponge; any number for a law without one. [m]
        p, at: Array that holds the numbers of `FRICTION_DAMPER`, and where they begin.

    Returns:
        Tension [N], also of a law that is taken out, and deformation rate [m/s].
    """
    return damper_response(elongation_rate, deformation, *read_friction_damper(p, at).law)


@law
def friction_damper_force(motion, deformation, p, at):
    """Return the own force of a damper, which is its tension; 0 if its law is taken out. [N]

    Args:
        motion: `TubMotion`.
        deformation: As for `friction_damper_tension`. [m]
        p, at: Array that holds the numbers of `FRICTION_DAMPER`, and where they begin.
    """
    _, line = friction_damper_line(motion, p, at)
    tension, _ = friction_damper_tension(line[1], deformation, p, at)
    return read_friction_damper(p, at).engaged * tension


@law
def friction_damper_wrench(motion, arm, line, tension, p, at):
    """Return moment about To and force on the tub (six numbers, W) of a damper under a tension.

    Args:
        motion: `TubMotion`.
        arm, line: From `friction_damper_line`.
        tension: From `friction_damper_tension`. [N]
        p, at: Array that holds the numbers of `FRICTION_DAMPER`, and where they begin.
    """
    _, _, direction, v_A, inverse_length = line
    damper = read_friction_damper(p, at)
    bushing = read_end_bushing(*damper.end_bushing)
    w_strut = scale(inverse_length, cross(direction, v_A))
    against_tub = subtract(w_strut, transverse(motion.angular_velocity, direction))
    on_strut_by_tub = end_moment(
        direction, against_tub, rotate(motion.rotation, damper.axis), bushing
    )
    on_strut_by_housing = end_moment(direction, w_strut, damper.axis, bushing)
    couple = transverse_couple(add(on_strut_by_tub, on_strut_by_housing), direction, inverse_length)
    force = add(scale(-damper.engaged * tension, direction), couple)
    return wrench_at_origin(arm, force, scale(-1.0, on_strut_by_tub))


@law
def end_moment(direction, rate, axis, bushing):
    """Return `bending_moment` of an end bushing, from the numbers of `END_BUSHING`. [N m]"""
    return bending_moment(
        direction,
        rate,
        axis,
        stiffness=bushing.stiffness,
        damping=bushing.damping,
        friction_torque=bushing.friction_torque,
        full_friction_rate=bushing.full_friction_rate,
    )


@law
def evaluate_friction_damper(x, state, p, generalized_force, force, rate):
    """Write the force of a damper strut; arguments as in `ElementSystem`."""
    deformation = state[0] if len(state) > 0 else 0.0 * x[0]
    motion, q = tub_motion(numbers(x)), numbers(p)
    arm, line = friction_damper_line(motion, q, 0)
    tension, deformation_rate = friction_damper_tension(line[1], deformation, q, 0)
    wrench = friction_damper_wrench(motion, arm, line, tension, q, 0)
    write_generalized_force(generalized_force, 0, wrench, 0.0 * tension)
    force[0] = read_friction_damper(q, 0).engaged * tension
    if len(rate) > 0:
        rate[0] = deformation_rate


def placed_damper(ends: Ends, _: Damper, type_: DamperNumbers) -> FrictionDamperParameters:
    """Return a damper that is a massless strut in its place."""
    points = ends.tub_point, ends.housing_point
    return FrictionDamperParameters(*points, type_.end_bushing, packed_damper_law(type_))


FRICTION_DAMPER_STRUT = ElementKind(
    name="friction_damper",
    parameters=Damper,
    layout=FRICTION_DAMPER,
    place=placed_damper,
    outputs=(Output("force", "N", "tension of a damper, > 0"),),
    acts_at_rest=False,
    words="damper as a massless strut between a point of the tub and a point of the housing",
    described=(
        *STRUT_ENDS,
        Described(
            "neutral_direction",
            "Direction as drawn. Both end bushings are neutral when the strut has this direction "
            "in W (housing end) and in T (tub end).",
            "axis",
            shape=(3,),
        ),
    ),
    on_plant=evaluate_friction_damper,
)
