"""Friction damper, as a massless strut between a point of the tub and a point of the housing."""

import math
from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.vectors import add, cross, rotate, scale, subtract
from wm_drake.elements.motion import tub_motion
from wm_drake.laws.damper import (
    COULOMB,
    FREE_STROKE,
    HAVSIN,
    MSTV,
    STV,
    STV_SPONGE,
    damper_response,
)
from wm_drake.laws.strut import (
    bending_moment,
    strut_line,
    transverse,
    transverse_couple,
    wrench_at_origin,
)
from wm_drake.parameters.elements import (
    CoulombDamper,
    DamperType,
    EndBushing,
    FreeStrokeDamper,
    HavsinDamper,
    StvDamper,
    StvSpongeDamper,
    packed_stiffness,
)
from wm_drake.parameters.types import FloatArray


def packed_damper_law(damper: DamperType) -> FloatArray:
    """Law number, then its parameters in the order of `wm_drake.laws.damper`."""
    match damper:
        case CoulombDamper():
            return np.array([COULOMB, damper.friction_force, damper.damping])
        case StvDamper():
            return np.array(
                [STV, damper.friction_force, damper.transition_velocity, damper.damping]
            )
        case HavsinDamper():
            return np.array(
                [HAVSIN, damper.friction_force, damper.full_friction_velocity, damper.damping]
            )
    if isinstance(damper, StvSpongeDamper):
        sponge = [damper.sponge_stiffness, damper.sponge_damping, damper.slider_damping]
        return np.array([STV_SPONGE, damper.friction_force, damper.transition_velocity, *sponge])
    friction = [damper.friction_force, damper.friction_damping, damper.regularisation_velocity]
    if isinstance(damper, FreeStrokeDamper):
        basic = [damper.basic_friction_force, damper.basic_full_friction_velocity]
        return np.concatenate([[FREE_STROKE], friction, basic, packed_stiffness(damper.sponge)])
    return np.array(
        [MSTV, *friction, damper.sponge_stiffness, damper.sponge_damping, damper.slider_damping]
    )


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
        bushing = [
            b.stiffness,
            b.damping,
            b.friction_torque,
            0.5 * np.pi / b.full_friction_rate,
            self.engaged,
        ]
        return np.concatenate(
            [
                self.p_ToA_T,
                self.p_WH,
                line / math.dist(self.p_ToA_T, self.p_WH),
                bushing,
                self.packed_law,
            ]
        )


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
    on_strut_by_tub = bending_moment(
        direction, against_tub, rotate(motion.rotation, axis), *bushing
    )
    on_strut_by_housing = bending_moment(direction, w_strut, axis, *bushing)
    couple = transverse_couple(add(on_strut_by_tub, on_strut_by_housing), direction, inverse_length)
    force = scale(engaged, add(scale(-tension, direction), couple))
    return wrench_at_origin(arm, force, scale(-engaged, on_strut_by_tub))


@law
def evaluate_friction_damper(x, state, p, generalized_force, force, rate):
    """Force of a damper strut; arguments as in `ElementSystem`, parameters as in `FrictionDamperParameters.packed`."""
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
