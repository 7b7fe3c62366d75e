"""Six-component bushing between a frame of the tub and a frame of the housing; the gasket is one."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from wm_drake.laws.bushing import bushing_force
from wm_drake.laws.compilation import law
from wm_drake.laws.strut import wrench_at_origin
from wm_drake.laws.vectors import add, compose, cross, rotate, rotate_back, rotation_from_rpy, rotation_vector, scale, subtract
from wm_drake.laws.vectors import transpose as transposed
from wm_drake.parameters.elements import Bushing, FloatArray, packed_stiffness
from wm_drake.systems.element import SCALARS, ForceElement

AXES = ("x", "y", "z")


def packed_bushing_law(bushing: Bushing) -> FloatArray:
    """Parameters in the order of `wm_drake.laws.bushing.bushing_force`."""
    kinds = ("damping", "rotational_damping", "friction_torque", "full_friction_rate")
    constants = [getattr(bushing, f"{kind}_{axis}") for kind in kinds for axis in AXES]
    curves = [getattr(bushing, f"{kind}_{axis}") for kind in ("stiffness", "rotational_stiffness") for axis in AXES]
    return np.concatenate([constants, *map(packed_stiffness, curves)])


@dataclass(frozen=True)
class SixComponentBushingParameters:
    """A bushing in its place: its two frames at the rest pose and its law. `engaged` 0 takes it out of the machine."""

    p_ToB_T: FloatArray
    R_TB: FloatArray
    p_WG: FloatArray
    R_WG: FloatArray
    packed_law: FloatArray
    engaged: float = 1.0

    def packed(self) -> FloatArray:
        """Flat: tub-side point (T) and rotation by rows, housing-side point (W) and rotation by rows, engaged, law."""
        return np.concatenate([self.p_ToB_T, self.R_TB.ravel(), self.p_WG, self.R_WG.ravel(), [self.engaged], self.packed_law])


@law
def evaluate_six_component_bushing(x, state, p, generalized_force, force, rate):
    """Force of a bushing; arguments as in `ForceElement`, parameters as in `SixComponentBushingParameters.packed`."""
    rotation = rotation_from_rpy(x[0], x[1], x[2])
    w = (x[7], x[8], x[9])
    r_tub = (p[3], p[4], p[5], p[6], p[7], p[8], p[9], p[10], p[11])
    r_ground = (p[15], p[16], p[17], p[18], p[19], p[20], p[21], p[22], p[23])
    arm = rotate(rotation, (p[0], p[1], p[2]))
    d = rotate_back(r_ground, subtract(add((x[3], x[4], x[5]), arm), (p[12], p[13], p[14])))
    d_rate = rotate_back(r_ground, add((x[10], x[11], x[12]), cross(w, arm)))
    relative = compose(transposed(r_ground), compose(rotation, r_tub))
    f, m = bushing_force(d, d_rate, rotation_vector(relative), rotate_back(r_ground, w), p, 25)
    f = scale(p[24], f)
    m = scale(p[24], m)
    wrench = wrench_at_origin(arm, rotate(r_ground, f), rotate(r_ground, m))
    for i in range(6):
        generalized_force[i] = wrench[i]
    generalized_force[6] = 0.0 * f[0]
    for i in range(3):
        force[i] = -f[i]
        force[3 + i] = -m[i]


@law
def six_component_bushing_history(states, own_states, p, forces):
    """Own force at each row of a sampled motion: `evaluate_six_component_bushing` without Drake, for records."""
    generalized_force = np.empty(7)
    rate = np.empty(own_states.shape[1])
    for i in range(len(states)):
        evaluate_six_component_bushing(states[i], own_states[i], p, generalized_force, forces[i], rate)


@TemplateSystem.define("SixComponentBushing_", T_list=SCALARS)
def SixComponentBushing_(T: type) -> Any:
    """Template of SixComponentBushing."""

    class SixComponentBushing(ForceElement, LeafSystem_[T]):
        """A six-component bushing; law `bushing_force`. Stiffness lives in the housing-side frame G.

            plant_state (14) ──▶ [ SixComponentBushing ] ──▶ generalized_force (7) [N m, N]
                                                         ──▶ force (6) on the housing, in G: force [N], moment [N m]

        The force on the housing acts at the tub-side point, where that of the tub does.
        """

        def _construct(self, parameters: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_element(T, evaluate_six_component_bushing, parameters, force_size=6, state_size=0)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.packed, converter=converter)

    Impl = SixComponentBushing
    return SixComponentBushing


SixComponentBushing = SixComponentBushing_[None]
