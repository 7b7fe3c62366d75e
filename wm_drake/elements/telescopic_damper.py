"""Telescopic damper: outer and inner tube are bodies, each held by a six-component bushing, friction along the joint."""

from dataclasses import dataclass, replace

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, numbers, rows_to_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.compiler.vectors import add, cross, dot, rotate, scale
from wm_drake.elements.bushing import (
    SixComponentBushingParameters,
    six_component_bushing_between,
    six_component_bushing_wrench,
)
from wm_drake.elements.friction_damper import has_sponge, law_structure
from wm_drake.elements.motion import (
    GENERALIZED_FORCE_SIZE,
    PLANT_STATE_SIZE,
    TubMotion,
    motion_at,
    tub_motion,
)
from wm_drake.laws.damper import damper_response
from wm_drake.parameters.types import FloatArray

FORCE_SIZE = 13
"""Own forces: tension; force and moment of the bushing at the tub on the outer tube; those of the other on the housing."""


_HEADER = 6


@dataclass(frozen=True)
class TelescopicDamperParameters:
    """A telescopic damper in its place.

    Attributes:
        axis: Direction of the joint in the frame of the outer tube; the damper is longer when the inner one moves along it.
        tub_bushing: Between tub and outer tube: what it calls tub is the tub, what it calls W is the outer tube.
        housing_bushing: Between inner tube and housing; its tub-side frame is given in the outer tube's, at extension 0.
        packed_law: Along the joint.
        engaged: 0 takes the law out, not the tubes.
    """

    axis: FloatArray
    tub_bushing: SixComponentBushingParameters
    housing_bushing: SixComponentBushingParameters
    packed_law: FloatArray
    engaged: float = 1.0

    @property
    def has_sponge(self) -> bool:
        """Whether the law has a state."""
        return has_sponge(self.packed_law)

    @property
    def structure(self) -> list[int]:
        """Of law and bushings: what must be alike where machines run side by side."""
        return [
            *law_structure(self.packed_law),
            *self.tub_bushing.structure,
            *self.housing_bushing.structure,
        ]

    def without_friction(self) -> "TelescopicDamperParameters":
        """Elastic and viscous parts of the bushings only: what a mode of the machine sees."""
        frictionless = []
        for bushing in (self.tub_bushing, self.housing_bushing):
            packed_law = bushing.packed_law.copy()
            packed_law[6:9] = 0.0
            frictionless.append(replace(bushing, packed_law=packed_law))
        return replace(
            self, tub_bushing=frictionless[0], housing_bushing=frictionless[1], engaged=0.0
        )

    def packed(self) -> FloatArray:
        """Flat: axis, engaged, where the second bushing and the law begin, the bushings, law number and its parameters."""
        first, second = self.tub_bushing.packed(), self.housing_bushing.packed()
        places = [_HEADER + len(first), _HEADER + len(first) + len(second)]
        return np.concatenate([self.axis, [self.engaged], places, first, second, self.packed_law])


@law
def telescopic_damper_forces(tub, outer, extension, extension_rate, deformation, p, at):
    """Forces of a telescopic damper.

    Args:
        tub, outer: `TubMotion` of the tub, and of the outer tube.
        extension, extension_rate: Of the joint, > 0 longer. [m, m/s]
        deformation: Of the sponge; any number for a law without one. [m]
        p, at: Array that holds what `TelescopicDamperParameters.packed` gives, and where that begins.

    Returns:
        Moment about To and force on the tub; moment about the origin of the outer tube and force on both tubes; force on the
        joint; rate of deformation; tension; force and moment of the first bushing on the outer tube (in its frame), of the
        second on the housing.
    """
    axis = rotate(outer.rotation, (p[at], p[at + 1], p[at + 2]))
    moved = scale(extension, axis)
    v_inner = add(
        outer.velocity, add(cross(outer.angular_velocity, moved), scale(extension_rate, axis))
    )
    inner = TubMotion(outer.rotation, add(outer.position, moved), outer.angular_velocity, v_inner)
    on_tub, on_outer, first_force = six_component_bushing_between(tub, outer, p, at + 6)
    on_inner, second_force = six_component_bushing_wrench(inner, p, at + int(p[at + 4]))
    law_at = at + int(p[at + 5])
    tension, deformation_rate = damper_response(
        int(p[law_at]), extension_rate, deformation, p, law_at + 1
    )
    tension = p[at + 3] * tension
    force = (on_inner[3], on_inner[4], on_inner[5])
    shifted = cross(moved, force)
    on_tubes = (
        on_outer[0] + on_inner[0] + shifted[0],
        on_outer[1] + on_inner[1] + shifted[1],
        on_outer[2] + on_inner[2] + shifted[2],
        on_outer[3] + force[0],
        on_outer[4] + force[1],
        on_outer[5] + force[2],
    )
    return (
        on_tub,
        on_tubes,
        dot(axis, force) - tension,
        deformation_rate,
        tension,
        first_force,
        second_force,
    )


@law
def evaluate_telescopic_damper(x, state, p, generalized_force, force, rate):
    """Forces of a telescopic damper; arguments as in `ElementSystem`.

    x: states of two trees of the plant, one after the other: tub and drum; outer tube and joint. The generalized force is
    that on both.
    """
    deformation = state[0] if len(state) > 0 else 0.0 * x[0]
    y, q = numbers(x), numbers(p)
    outer = motion_at(y, PLANT_STATE_SIZE)
    on_tub, on_tubes, along, deformation_rate, tension, first, second = telescopic_damper_forces(
        tub_motion(y), outer, x[PLANT_STATE_SIZE + 6], x[PLANT_STATE_SIZE + 13], deformation, q, 0
    )
    for i in range(6):
        generalized_force[i] = on_tub[i]
        generalized_force[GENERALIZED_FORCE_SIZE + i] = on_tubes[i]
        force[1 + i] = first[i]
        force[7 + i] = second[i]
    generalized_force[6] = 0.0 * tension
    generalized_force[GENERALIZED_FORCE_SIZE + 6] = along
    force[0] = tension
    if len(rate) > 0:
        rate[0] = deformation_rate


@law
def telescopic_damper_history(states, own_states, p, forces):
    """Own forces at each row of a sampled motion: `evaluate_telescopic_damper` without Drake, for records."""
    align_stack()
    x_numbers, own_numbers = np.empty(2 * PLANT_STATE_SIZE * WIDTH), np.empty(WIDTH)
    force_numbers, p_numbers = np.empty(FORCE_SIZE * WIDTH), in_each_lane(p)
    x, own, own_force, q = (
        lane_array(x_numbers),
        lane_array(own_numbers),
        lane_array(force_numbers),
        lane_array(p_numbers),
    )
    for begin in range(0, len(states), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        rows_to_lanes(own_states, begin, own_numbers)
        outer = motion_at(x, PLANT_STATE_SIZE)
        _, _, _, _, tension, first, second = telescopic_damper_forces(
            tub_motion(x), outer, x[PLANT_STATE_SIZE + 6], x[PLANT_STATE_SIZE + 13], own[0], q, 0
        )
        own_force[0] = tension
        for k in range(6):
            own_force[1 + k] = first[k]
            own_force[7 + k] = second[k]
        lanes_to_rows(force_numbers, begin, forces)
