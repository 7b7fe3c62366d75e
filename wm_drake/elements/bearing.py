"""Compliant bearing of the drum: a six-component bushing between the tub and the drum's carrier."""

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, numbers, rows_to_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.vectors import rotate_back, rotation_vector
from wm_drake.elements.bushing import BUSHING, motion_between, six_component_bushing_between
from wm_drake.elements.kind import ElementKind, Output
from wm_drake.elements.motion import (
    GENERALIZED_FORCE_SIZE,
    PLANT_STATE_SIZE,
    motion_at,
    tub_motion,
    write_generalized_force,
)
from wm_drake.parameters.machine import Bearing

FORCE_SIZE = 12
"""Own numbers: displacement and rotation vector of the drum's carrier against the tub, force and
moment on the tub."""


@law
def drum_bearing_forces(tub, carrier, p, at):
    """Return the wrenches of the bearing on tub and carrier, and its own numbers.

    Args:
        tub, carrier: `TubMotion` of the two bodies.
        p, at: Array that holds the numbers of `BUSHING`, the tub being the ground, and where they
            begin.

    Returns:
        Moment about its origin and force on the tub, and on the carrier (six numbers each, W);
        `FORCE_SIZE` own numbers, in the frame on the tub: y along the drum axis.
    """
    on_carrier, on_tub, bushing_force = six_component_bushing_between(carrier, tub, p, at)
    _, _, r_ground, displaced, relative = motion_between(carrier, tub, p, at)
    return (
        on_tub,
        on_carrier,
        rotate_back(r_ground, displaced) + rotation_vector(relative) + bushing_force,
    )


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
    layout=BUSHING,
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
