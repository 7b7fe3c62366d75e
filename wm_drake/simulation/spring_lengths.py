"""Sampled motion -> smallest length of each spring, as compiled code."""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import where
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.vectors import rotate
from wm_drake.elements.motion import PLANT_STATE_SIZE, tub_motion
from wm_drake.elements.spring import read_spring
from wm_drake.elements.strut import strut_line
from wm_drake.simulation.histories import in_bounds


@long_running
def smallest_lengths_lanes(samples, rows, size, bounds, p, springs, smallest):
    """Measure `lanes.WIDTH` runs side by side, each up to its first sample out of bounds.

    All arrays of floats but `bounds` are flat arrays of lanes.

    Args:
        samples: Samples, one after the other, each with the state first.
        rows, size: Number of samples, and of the numbers in each.
        bounds: Largest angle and displacement of the tub at which a run goes on. [rad, m]
        p: Packed numbers.
        springs: Array of the indices of the springs in them.
        smallest: Written: smallest length of each spring [m]; inf for a run without samples in
            bounds.
    """
    align_stack()
    x_numbers = np.empty(PLANT_STATE_SIZE * WIDTH)
    x, states, numbers = lane_array(x_numbers), lane_array(samples), lane_array(p)
    least = lane_array(smallest)
    zero = 0.0 * numbers[0]
    for k in range(len(springs)):
        least[k] = zero + np.inf
    good = zero + 1.0
    for row in range(rows):
        for k in range(PLANT_STATE_SIZE):
            x[k] = states[row * size + k]
        good = good * in_bounds(x, bounds[0], bounds[1])
        motion = tub_motion(x)
        for k in range(len(springs)):
            spring = read_spring(numbers, springs[k])
            arm = rotate(motion.rotation, spring.p_ToA_T)
            length, _, _, _, _ = strut_line(motion, arm, spring.p_WH)
            least[k] = where((good > 0.5) & (length < least[k]), length, least[k])
    keep(x_numbers)
