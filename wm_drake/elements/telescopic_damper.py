"""Telescopic damper: two tubes as bodies, a bushing at each end, friction along the joint."""

from dataclasses import dataclass, replace

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, numbers, rows_to_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.packed import ARRAY, LAYOUT, SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, cross, dot, rotate, scale
from wm_drake.elements.bushing import (
    BUSHING,
    SixComponentBushingParameters,
    six_component_bushing_between,
    six_component_bushing_wrench,
)
from wm_drake.elements.damper_law import (
    LAW,
    damper_response,
    frictionless_law,
    law_of,
    law_structure,
)
from wm_drake.elements.kind import Described, ElementKind, Output
from wm_drake.elements.layouts import packed_once
from wm_drake.elements.motion import (
    GENERALIZED_FORCE_SIZE,
    PLANT_STATE_SIZE,
    TREE_STATE,
    TubMotion,
    motion_at,
    read_tree_state,
    tub_motion,
    write_generalized_force,
)
from wm_drake.parameters.elements import TelescopicDamper
from wm_drake.parameters.types import FloatArray

DAMPER_FORCES = PackedLayout(
    "TelescopicDamperForces", tension=SCALAR, on_outer_tube=ARRAY(6), on_housing=ARRAY(6)
)
"""Forces of a damper: tension [N]; force and moment of the bushing at the tub on the outer tube;
force and moment of the other bushing on the housing [N, N m]."""
FORCE_SIZE = DAMPER_FORCES.fixed_size
write_damper_forces = DAMPER_FORCES.write

TELESCOPIC_DAMPER = PackedLayout(
    "TelescopicDamperNumbers",
    axis=VECTOR,
    engaged=SCALAR,
    tub_bushing=LAYOUT(BUSHING),
    housing_bushing=LAYOUT(BUSHING),
    law=LAW,
)
"""Direction of the joint in the frame of the outer tube, 1 or 0 for a law that is taken out,
bushings, law."""
TUBES_STATE = PackedLayout("TubesState", tubes=LAYOUT(TREE_STATE), deformation=SCALAR)
"""State of a telescopic damper: outer tube and joint, then deformation of the sponge. [m]"""
TUBES_STATE_SIZE, DEFORMATION = TUBES_STATE.fixed_size, TUBES_STATE.offsets["deformation"]
read_telescopic_damper, read_tubes_state = TELESCOPIC_DAMPER.read, TUBES_STATE.read


@dataclass(frozen=True)
class TelescopicDamperParameters:
    """A telescopic damper in its place.

    Attributes:
        axis: Direction of the joint in the frame of the outer tube; the damper is longer when the
            inner one moves along it.
        tub_bushing: Between tub and outer tube: its tub side is on the tub, its ground side on the
            outer tube.
        housing_bushing: Between inner tube and housing; its tub-side frame is given in the outer
            tube's frame, at extension 0.
        packed_law: Law along the joint.
        engaged: 0 takes the law out, not the tubes.
    """

    axis: FloatArray
    tub_bushing: SixComponentBushingParameters
    housing_bushing: SixComponentBushingParameters
    packed_law: FloatArray
    engaged: float = 1.0

    @property
    def kind(self) -> ElementKind:
        """Return the kind of the element."""
        return TELESCOPIC_DAMPER_TUBES

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
        """Numbers that must be equal in a batch: number of the law, points of the tables."""
        return [
            *self.tub_bushing.structure,
            *self.housing_bushing.structure,
            *law_structure(self.packed_law),
        ]

    def without_friction(self) -> "TelescopicDamperParameters":
        """Return the damper without law and friction: the part of it that is linear in a mode."""
        return replace(
            self,
            tub_bushing=self.tub_bushing.without_friction(),
            housing_bushing=self.housing_bushing.without_friction(),
            engaged=0.0,
        )

    def sliding(self) -> "TelescopicDamperParameters":
        """Return the damper without friction but with its law, as steady sliding has it."""
        return replace(
            self,
            tub_bushing=self.tub_bushing.without_friction(),
            housing_bushing=self.housing_bushing.without_friction(),
            packed_law=frictionless_law(self.packed_law),
        )

    @packed_once
    def packed(self) -> FloatArray:
        """Return the numbers of `TELESCOPIC_DAMPER`."""
        return TELESCOPIC_DAMPER.pack(
            axis=self.axis,
            engaged=self.engaged,
            tub_bushing=self.tub_bushing.packed(),
            housing_bushing=self.housing_bushing.packed(),
            law=self.packed_law,
        )


@law
def telescopic_damper_forces(tub, outer, extension, extension_rate, deformation, p, at):
    """Return the forces of a telescopic damper.

    Args:
        tub, outer: `TubMotion` of the tub, and of the outer tube.
        extension, extension_rate: Extension of the joint, > 0 longer, and its rate. [m, m/s]
        deformation: Deformation of the sponge; any number for a law without one. [m]
        p, at: Array that holds the numbers of `TELESCOPIC_DAMPER`, and where they begin.

    Returns:
        Moment about To and force on the tub; moment about the origin of the outer tube and force on
        both tubes; force on the joint; rate of deformation; tension; force and moment of the first
        bushing on the outer tube (in its frame), of the second on the housing.
    """
    damper = read_telescopic_damper(p, at)
    inner, axis, moved = inner_tube_motion(outer, extension, extension_rate, damper)
    on_tub, on_outer, first_force = six_component_bushing_between(tub, outer, *damper.tub_bushing)
    on_inner, second_force = six_component_bushing_wrench(inner, *damper.housing_bushing)
    tension, deformation_rate = damper_response(extension_rate, deformation, *damper.law)
    tension = damper.engaged * tension
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
def inner_tube_motion(outer, extension, extension_rate, damper):
    """Return the motion of the inner tube, direction of the joint and shift of the tube, in W.

    Args:
        outer: `TubMotion` of the outer tube.
        extension, extension_rate: Extension of the joint, > 0 longer, and its rate. [m, m/s]
        damper: Numbers of `TELESCOPIC_DAMPER`, by name.
    """
    axis = rotate(outer.rotation, damper.axis)
    moved = scale(extension, axis)
    velocity = add(
        outer.velocity, add(cross(outer.angular_velocity, moved), scale(extension_rate, axis))
    )
    position = add(outer.position, moved)
    return TubMotion(outer.rotation, position, outer.angular_velocity, velocity), axis, moved


@law
def _forces_at(x, deformation, p):
    """Return `telescopic_damper_forces` at the states of two trees, one after the other."""
    outer, joint = motion_at(x, PLANT_STATE_SIZE), read_tree_state(x, PLANT_STATE_SIZE)
    extension, extension_rate = joint.joint_position, joint.joint_rate
    return telescopic_damper_forces(
        tub_motion(x), outer, extension, extension_rate, deformation, p, 0
    )


@law
def evaluate_telescopic_damper(x, state, p, generalized_force, force, rate):
    """Write the forces of a telescopic damper; arguments as in `ElementSystem`.

    x: states of two trees of the plant, one after the other: tub and drum; outer tube and joint.
    The generalized force is that on both.
    """
    deformation = state[0] if len(state) > 0 else 0.0 * x[0]
    y, q = numbers(x), numbers(p)
    on_tub, on_tubes, along, deformation_rate, tension, first, second = _forces_at(
        y, deformation, q
    )
    write_generalized_force(generalized_force, 0, on_tub, 0.0 * tension)
    write_generalized_force(generalized_force, GENERALIZED_FORCE_SIZE, on_tubes, along)
    write_damper_forces(force, 0, tension, first, second)
    if len(rate) > 0:
        rate[0] = deformation_rate


@law
def telescopic_damper_history(states, element_states, p, forces):
    """Write the own forces at each row of a sampled motion, as `evaluate_telescopic_damper`."""
    align_stack()
    x_numbers, sponge_numbers = np.empty(2 * PLANT_STATE_SIZE * WIDTH), np.empty(WIDTH)
    force_numbers, p_numbers = np.empty(FORCE_SIZE * WIDTH), in_each_lane(p)
    x, sponge, force_lanes, q = (
        lane_array(x_numbers),
        lane_array(sponge_numbers),
        lane_array(force_numbers),
        lane_array(p_numbers),
    )
    for begin in range(0, len(states), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        rows_to_lanes(element_states, begin, sponge_numbers)
        _, _, _, _, tension, first, second = _forces_at(x, sponge[0], q)
        write_damper_forces(force_lanes, 0, tension, first, second)
        lanes_to_rows(force_numbers, begin, forces)
    keep(p_numbers)


_BUSHINGS = (
    ("tub_point_T", "Tub bushing, on the tub.", "tub_bushing.tub_side_point"),
    ("outer_point_outer_tube", "It on the outer tube.", "tub_bushing.ground_side_point"),
    ("inner_point_outer_tube", "Housing bushing.", "housing_bushing.tub_side_point"),
    ("housing_point_W", "It on the housing.", "housing_bushing.ground_side_point"),
    ("tub_bushing_on_tub_rotation_T", "Its frame.", "tub_bushing.tub_side_rotation"),
    ("tub_bushing_law_rotation_outer_tube", "Of its law.", "tub_bushing.ground_side_rotation"),
    ("housing_bushing_on_inner_tube_rotation_outer_tube", "", "housing_bushing.tub_side_rotation"),
    ("housing_bushing_law_rotation_W", "Of its law.", "housing_bushing.ground_side_rotation"),
)
"""Key of each place of the bushings, meaning, and where it is; the last word is the frame: that of
the inner tube is given in the frame of the outer one, at extension 0."""
DESCRIBED = (
    Described("axis_outer_tube", "Direction of extension.", "axis", shape=(3,)),
    *(Described(*one, "m", (3,)) for one in _BUSHINGS[:4]),
    *(Described(*one, "", (3, 3)) for one in _BUSHINGS[4:]),
)

TELESCOPIC_DAMPER_TUBES = ElementKind(
    name="telescopic_damper",
    parameters=TelescopicDamper,
    layout=TELESCOPIC_DAMPER,
    outputs=(
        Output("force", "N", "tension of the law along the joint, > 0"),
        Output("tub_bushing_force", "N", "force on the outer tube, in its frame", size=3),
        Output("tub_bushing_moment", "N m", "moment on the outer tube, in its frame", size=3),
        Output("housing_bushing_force", "N", "force on the housing", size=3),
        Output("housing_bushing_moment", "N m", "moment on the housing", size=3),
    ),
    words="damper of two tubes that are bodies, each on a bushing",
    described=DESCRIBED,
    on_plant=evaluate_telescopic_damper,
    trees=2,
)
assert TELESCOPIC_DAMPER_TUBES.output_size == FORCE_SIZE
