"""Compliant bearing of the drum: a six-component bushing between the tub and the drum's carrier."""

from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import (
    anywhere,
    in_each_lane,
    lanes_to_rows,
    numbers,
    rows_to_lanes,
)
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.packed import LAYOUT, SCALAR, PackedLayout
from wm_drake.compiler.vectors import (
    add,
    cross,
    rotate,
    rotate_back,
    rotation_vector,
    scale,
    subtract,
)
from wm_drake.elements.bushing import (
    BUSHING,
    SixComponentBushingParameters,
    motion_between,
    six_component_bushing_between,
)
from wm_drake.elements.kind import ElementKind, Output
from wm_drake.elements.layouts import packed_once
from wm_drake.elements.motion import (
    GENERALIZED_FORCE_SIZE,
    PLANT_STATE_SIZE,
    motion_at,
    tub_motion,
    write_generalized_force,
)
from wm_drake.elements.strut import wrench_at_origin
from wm_drake.laws.clearance import clearance_force
from wm_drake.parameters.machine import Bearing
from wm_drake.parameters.types import FloatArray

DRUM_BEARING_NUMBERS = PackedLayout(
    "DrumBearingNumbers",
    clearance=SCALAR,
    contact_stiffness=SCALAR,
    contact_damping=SCALAR,
    bushing=LAYOUT(BUSHING),
)
"""Clearance and its contact, 0 without one [m, N/m, N s/m]; bushing, whose ground is the tub."""

read_drum_bearing = DRUM_BEARING_NUMBERS.read

FORCE_SIZE = 12
"""Own numbers: displacement and rotation vector of the drum's carrier against the tub, force and
moment on the tub."""

PRESSED = 1.2
"""Displacement by the clearance at which the damping of the contact is full."""


@dataclass(frozen=True)
class DrumBearingParameters(SixComponentBushingParameters):
    """A compliant bearing in its place: a bushing, and a contact beyond its clearance.

    Attributes:
        clearance: Radial clearance; 0 for none. [m]
        contact_stiffness, contact_damping: Of the contact beyond it. [N/m, N s/m]
    """

    clearance: float = 0.0
    contact_stiffness: float = 0.0
    contact_damping: float = 0.0

    @property
    def kind(self) -> ElementKind:
        """Return the kind of the element."""
        return DRUM_BEARING

    def sag(self, weight: FloatArray) -> FloatArray:
        """Return how far a shaft that hangs in the bearing moves into contact.

        Args:
            weight: Weight on the bearing, in the frame of its ground side. (3,) [N]

        Returns:
            Displacement across the axis, in the same frame, (3,) [m]; 0 without a clearance, or if
            the radial stiffness holds the shaft within it.
        """
        across = np.array([weight[0], 0.0, weight[2]])
        load, soft = float(np.linalg.norm(across)), float(self.stiffness[0])
        if not self.clearance or load <= soft * self.clearance:
            return np.zeros(3)
        pressed = (load - soft * self.clearance) / (soft + self.contact_stiffness)
        return (self.clearance + pressed) / load * across

    def into_contact(self, displaced: FloatArray) -> FloatArray:
        """Return the change of the shaft's place with which it presses on its bearing.

        Args:
            displaced: Displacement of the shaft, in the frame of the body on the ground side.
                (3,) [m]

        Returns:
            Change across the axis, outwards, in the same frame, (3,) [m]; 0 without a clearance, or
            if it presses already.
        """
        rotation = self.ground_side_rotation
        x, _, z = rotation.T @ displaced
        size = float(np.hypot(x, z))
        needed = PRESSED * self.clearance - size
        if needed <= 0.0:
            return np.zeros(3)
        outwards = np.array([x, 0.0, z]) / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
        return np.asarray(rotation @ (needed * outwards))

    @packed_once
    def packed(self) -> FloatArray:
        """Return the numbers of `DRUM_BEARING_NUMBERS`."""
        return DRUM_BEARING_NUMBERS.pack(
            clearance=self.clearance,
            contact_stiffness=self.contact_stiffness,
            contact_damping=self.contact_damping,
            bushing=self.packed_bushing(),
        )


@law
def drum_bearing_forces(tub, carrier, p, at):
    """Return the wrenches of the bearing on tub and carrier, and its own numbers.

    Args:
        tub, carrier: `TubMotion` of the two bodies.
        p, at: Array that holds the numbers of `DRUM_BEARING_NUMBERS`, and where they begin.

    Returns:
        Moment about its origin and force on the tub, and on the carrier (six numbers each, W);
        `FORCE_SIZE` own numbers, in the frame on the tub: y along the drum axis.
    """
    bearing = read_drum_bearing(p, at)
    on_carrier, on_tub, on_ground = six_component_bushing_between(carrier, tub, *bearing.bushing)
    arm, tub_arm, r_ground, displaced, relative = motion_between(carrier, tub, *bearing.bushing)
    d = rotate_back(r_ground, displaced)
    if anywhere(bearing.clearance > 0.0):
        v_carrier = add(carrier.velocity, cross(carrier.angular_velocity, arm))
        v_tub = add(tub.velocity, cross(tub.angular_velocity, tub_arm))
        v = rotate_back(r_ground, subtract(v_carrier, v_tub))
        f_x, f_z = clearance_force(
            (d[0], d[2]),
            (v[0], v[2]),
            bearing.clearance,
            bearing.contact_stiffness,
            bearing.contact_damping,
        )
        zero = 0.0 * f_x
        none = (zero, zero, zero)
        force = rotate(r_ground, (f_x, zero, f_z))
        on_carrier = sum_of(on_carrier, wrench_at_origin(arm, force, none))
        on_tub = sum_of(on_tub, wrench_at_origin(tub_arm, scale(-1.0, force), none))
        on_ground = sum_of(on_ground, (-f_x, zero, -f_z, zero, zero, zero))
    return on_tub, on_carrier, d + rotation_vector(relative) + on_ground


@law
def sum_of(a, b):
    """Return the sum of two wrenches of six numbers."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@law
def evaluate_drum_bearing(x, state, p, generalized_force, force, rate):
    """Write the forces of the bearing; arguments as in `ElementSystem`.

    x: states of two trees of the plant, one after the other: tub and drum; the drum's carrier and
    drum. The generalized force is that on both.
    """
    y, q = numbers(x), numbers(p)
    on_tub, on_carrier, outputs = drum_bearing_forces(
        tub_motion(y), motion_at(y, PLANT_STATE_SIZE), q, 0
    )
    zero = 0.0 * on_tub[0]
    write_generalized_force(generalized_force, 0, on_tub, zero)
    write_generalized_force(generalized_force, GENERALIZED_FORCE_SIZE, on_carrier, zero)
    for i in range(FORCE_SIZE):
        force[i] = outputs[i]


@law
def drum_bearing_history(states, element_states, p, forces):
    """Write the own numbers at each row of a sampled motion, as `evaluate_drum_bearing`."""
    align_stack()
    x_numbers, output_numbers = np.empty(2 * PLANT_STATE_SIZE * WIDTH), np.empty(FORCE_SIZE * WIDTH)
    p_numbers = in_each_lane(p)
    x, outputs, q = lane_array(x_numbers), lane_array(output_numbers), lane_array(p_numbers)
    for begin in range(0, len(states), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        _, _, values = drum_bearing_forces(tub_motion(x), motion_at(x, PLANT_STATE_SIZE), q, 0)
        for k in range(FORCE_SIZE):
            outputs[k] = values[k]
        lanes_to_rows(output_numbers, begin, forces)
    keep(p_numbers)


DRUM_BEARING = ElementKind(
    name="drum_bearing",
    parameters=Bearing,
    layout=DRUM_BEARING_NUMBERS,
    outputs=(
        Output("displacement", "m", "displacement of the drum carrier", size=3),
        Output("rotation", "rad", "rotation vector of the drum carrier", size=3),
        Output("force", "N", "force on the tub at the point of the carrier", size=3),
        Output("moment", "N m", "moment on the tub at the point of the carrier", size=3),
    ),
    words="compliant bearing of the drum; outputs in the frame of the tub, y along the drum axis",
    picture="points",
    on_plant=evaluate_drum_bearing,
    trees=2,
)
assert DRUM_BEARING.output_size == FORCE_SIZE
