"""Sampled motion -> what is read off it, compiled, for one machine or for several side by side."""

import numpy as np

from wm_drake.kernel.mechanics import LINE_SIZE, mass_properties, state_derivative
from wm_drake.laws.compilation import law, long_running
from wm_drake.laws.elementary import in_each_lane, lanes_to_rows, rows_to_lanes, sine_cosine, where
from wm_drake.laws.lanes import WIDTH, align_stack, lane_array
from wm_drake.laws.motion import tub_motion
from wm_drake.laws.vectors import add, dot, rotate, rotation_from_rpy
from wm_drake.systems.six_component_bushing import six_component_bushing_wrench

POINT_SIZE = 7
"""Numbers of a measured point: its place in T, the direction in W along which it is measured, its value at rest. [m]"""


@long_running
def rates_history(samples, acceleration, p, elements, rates):
    """What follows from the state at each sample: accelerations of the tub, torque of the motor.

    Args:
        samples: States, (n, size).
        acceleration: Of the drum at each sample, (n, 1). [rad/s^2]
        p, elements: As for `state_derivative`.
        rates: (n, 7), written: angular acceleration of the tub and acceleration of To, in W [rad/s^2, m/s^2]; torque of the
            motor on the drum [N m].
    """
    align_stack()
    size = samples.shape[1] * WIDTH
    x_numbers, drum_numbers, numbers = np.empty(size), np.empty(WIDTH), np.empty(7 * WIDTH)
    x, drum, answer = lane_array(x_numbers), lane_array(drum_numbers), lane_array(numbers)
    dx_numbers, scratch_numbers = np.empty(size), np.empty(LINE_SIZE * WIDTH * len(elements.dampers))
    p_numbers = in_each_lane(p)
    dx, scratch, q = lane_array(dx_numbers), lane_array(scratch_numbers), lane_array(p_numbers)
    for begin in range(0, len(rates), WIDTH):
        rows_to_lanes(samples, begin, x_numbers)
        rows_to_lanes(acceleration, begin, drum_numbers)
        sine, cosine = sine_cosine(x[6])
        masses = mass_properties(q, cosine, sine)
        answer[6] = state_derivative(x, dx, masses, x[13], drum[0], q, q, elements, scratch)
        for k in range(6):
            answer[k] = dx[7 + k]
        lanes_to_rows(numbers, begin, rates)


@long_running
def position_history(samples, points, positions):
    """Positions in W of points of the tub at each sample. [m]

    Args:
        samples: (n, >= 6) roll, pitch, yaw, x, y, z. [rad, m]
        points: (k, 3) in T. [m]
        positions: (n, 3 k), written: x, y, z of each point.
    """
    align_stack()
    x_numbers, numbers = np.empty(samples.shape[1] * WIDTH), np.empty(3 * len(points) * WIDTH)
    x, place = lane_array(x_numbers), lane_array(numbers)
    for begin in range(0, len(samples), WIDTH):
        rows_to_lanes(samples, begin, x_numbers)
        rotation = rotation_from_rpy(x[0], x[1], x[2])
        for k in range(len(points)):
            turned = rotate(rotation, (points[k, 0], points[k, 1], points[k, 2]))
            place[3 * k], place[3 * k + 1], place[3 * k + 2] = add((x[3], x[4], x[5]), turned)
        lanes_to_rows(numbers, begin, positions)


@law
def in_bounds(x, angle, displacement):
    """Whether a tub is within the bounds where a run may go on: 1 or 0."""
    level = (abs(x[0]) <= angle) & (abs(x[1]) <= angle) & (abs(x[2]) <= angle)
    near = (abs(x[3]) <= displacement) & (abs(x[4]) <= displacement) & (abs(x[5]) <= displacement)
    return where(level & near, 1.0, 0.0)


@law
def measure_samples(samples, rows, size, bounds, p, gasket, points, count, x, moved, extremes):
    """Displacements at measured points, and the largest values of a run up to the first sample out of bounds.

    Args:
        samples: States, one after the other.
        rows, size: How many they are, and how many numbers each has.
        bounds: Largest angle and displacement of the tub at which a run goes on. [rad, m]
        p, gasket: Packed numbers and where the gasket begins in them, -1 without one.
        points, count: Measured points, one after the other, and how many they are.
        x: A state to work in.
        moved: Displacement at each sample and point, written. [m]
        extremes: Written: largest absolute displacement at each point [m]; largest absolute force and moment of the
            gasket on the housing, x, y, z [N, N m]; number of samples in bounds.
    """
    zero = 0.0 * p[0]
    for k in range(count + 7):
        extremes[k] = zero
    good = zero + 1.0
    for row in range(rows):
        for k in range(size):
            x[k] = samples[row * size + k]
        good = good * in_bounds(x, bounds[0], bounds[1])
        motion = tub_motion(x)
        for k in range(count):
            at = k * POINT_SIZE
            place = (points[at], points[at + 1], points[at + 2])
            direction = (points[at + 3], points[at + 4], points[at + 5])
            value = dot(direction, add(motion.position, rotate(motion.rotation, place))) - points[at + 6]
            moved[row * count + k] = value
            extremes[k] = larger(extremes[k], value, good)
        if gasket >= 0:
            _, on_housing = six_component_bushing_wrench(motion, p, gasket)
            for k in range(6):
                extremes[count + k] = larger(extremes[count + k], on_housing[k], good)
        extremes[count + 6] = extremes[count + 6] + good


@law
def larger(largest, value, good):
    """The largest absolute value so far, after one more, which counts if it is good."""
    size = abs(value)
    return where((good > 0.5) & (size > largest), size, largest)


@long_running
def measure_samples_lanes(samples, rows, size, bounds, p, gasket, points, count, x, moved, extremes):
    """`measure_samples` of `lanes.WIDTH` machines side by side."""
    align_stack()
    runs = (lane_array(samples), rows, size, bounds)
    measured = (lane_array(points), count, lane_array(x), lane_array(moved), lane_array(extremes))
    measure_samples(*runs, lane_array(p), gasket, *measured)
