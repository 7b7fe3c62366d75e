"""Sampled motion -> displacements and forces, as compiled code."""

import numpy as np

from wm_drake.compiler.chosen import call
from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, rows_to_lanes, where
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.vectors import add, rotate, rotation_from_rpy
from wm_drake.elements.friction_damper import friction_damper_force
from wm_drake.elements.motion import PLANT_STATE_SIZE, read_pose, tub_motion
from wm_drake.elements.rubber import bushing_wrench
from wm_drake.elements.sensor import POINT_SIZE, displacement_at
from wm_drake.elements.spring import read_spring, spring_strut_wrench
from wm_drake.elements.strut import strut_line


@long_running
def position_history(samples, points, positions):
    """Evaluate the positions in W of points of the tub at each sample. [m]

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
        pose = read_pose(x, 0)
        roll, pitch, yaw = pose.angles
        rotation = rotation_from_rpy(roll, pitch, yaw)
        for k in range(len(points)):
            turned = rotate(rotation, (points[k, 0], points[k, 1], points[k, 2]))
            place[3 * k], place[3 * k + 1], place[3 * k + 2] = add(pose.position, turned)
        lanes_to_rows(numbers, begin, positions)


@long_running
def output_history(states, points, p, mounts, outputs):
    """Evaluate displacements at points and forces of springs, dampers and bushings at each sample.

    The forces are those of the elements' ports in Drake, from the same functions.

    Args:
        states: (n, size) states of the mounts.
        points: Measured points, one after the other (`POINT_SIZE` numbers each).
        p, mounts: Packed numbers of the mounts, and the `Mounts` in them and in the states.
        outputs: (n, k) written: displacement at each point [m], tension of each spring and each
            damper [N], force and moment of each bushing on the housing [N, N m], outputs of each
            element of another package.
    """
    align_stack()
    state_numbers, numbers = np.empty(states.shape[1] * WIDTH), np.empty(outputs.shape[1] * WIDTH)
    p_numbers, point_numbers = in_each_lane(p), in_each_lane(points)
    x, answer = lane_array(state_numbers), lane_array(numbers)
    q, measured = lane_array(p_numbers), lane_array(point_numbers)
    for begin in range(0, len(states), WIDTH):
        rows_to_lanes(states, begin, state_numbers)
        motion = tub_motion(x)
        column = len(points) // POINT_SIZE
        for k in range(column):
            answer[k] = displacement_at(motion, measured, k * POINT_SIZE)
        for at in mounts.springs:
            _, answer[column] = spring_strut_wrench(motion, q, at)
            column += 1
        for i, at in enumerate(mounts.dampers):
            answer[column] = friction_damper_force(motion, x[mounts.sponge_states + i], q, at)
            column += 1
        for at in mounts.bushings:
            _, on_housing = bushing_wrench(motion, q, at, x, mounts.branches)
            for k in range(6):
                answer[column + k] = on_housing[k]
            column += 6
        write_outputs_of_others(x, motion, q, mounts.others, answer, column)
        lanes_to_rows(numbers, begin, outputs)
    keep(p_numbers)
    keep(point_numbers)


@law
def write_outputs_of_others(x, motion, p, others, answer, column):
    """Write the outputs of each element of another package; `others` is None without any."""
    if others is not None:
        for i in range(len(others.at)):
            column = call(
                others.outputs, i, x, motion, p, others.at[i], others.states[i], answer, column
            )


@law
def in_bounds(x, angle, displacement):
    """Return 1 if the tub is within the bounds of angle and displacement, else 0."""
    pose = read_pose(x, 0)
    level = all_within(pose.angles, angle)
    return where(level & all_within(pose.position, displacement), 1.0, 0.0)


@law
def all_within(a, limit):
    """Return whether the absolute values of all components of a vector are up to a limit."""
    return (abs(a[0]) <= limit) & (abs(a[1]) <= limit) & (abs(a[2]) <= limit)


@law
def larger(largest, value, good):
    """Return the larger of `largest` and the absolute value, which counts if `good` is 1."""
    size = abs(value)
    return where((good > 0.5) & (size > largest), size, largest)


@long_running
def measure_samples_lanes(
    samples,
    rows,
    size,
    bounds,
    p,
    gasket,
    branches,
    points,
    count,
    springs,
    moved,
    extremes,
    lengths,
):
    """Measure `lanes.WIDTH` runs side by side, each up to its first sample out of bounds.

    All arrays of floats are flat arrays of lanes.

    Args:
        samples: Samples, one after the other, each with the state first.
        rows, size: Number of samples, and of the numbers in each.
        bounds: Largest angle and displacement of the tub at which a run goes on. [rad, m]
        p, gasket: Packed numbers and index of the gasket in them, -1 without one.
        branches: `Branches` of rubber bushings, None without them.
        points, count: Measured points, one after the other, and their number.
        springs: Array of the indices of the springs whose lengths are measured.
        moved: Displacement at each point and sample, written; point after point. [m]
        extremes: Written: largest absolute displacement at each point [m]; largest absolute force
            and moment of the gasket on the housing, x, y, z [N, N m]; number of samples in bounds.
        lengths: Written: smallest length of each spring; inf for a run without samples in bounds.
            [m]
    """
    align_stack()
    end = PLANT_STATE_SIZE if branches is None else size
    x_numbers = np.empty(end * WIDTH)
    x, states, numbers = lane_array(x_numbers), lane_array(samples), lane_array(p)
    measured, values, largest = lane_array(points), lane_array(moved), lane_array(extremes)
    shortest = lane_array(lengths)
    zero = 0.0 * numbers[0]
    for k in range(count + 7):
        largest[k] = zero
    for k in range(len(springs)):
        shortest[k] = zero + np.inf
    good = zero + 1.0
    for row in range(rows):
        for k in range(end):
            x[k] = states[row * size + k]
        good = good * in_bounds(x, bounds[0], bounds[1])
        motion = tub_motion(x)
        for k in range(count):
            value = displacement_at(motion, measured, k * POINT_SIZE)
            values[k * rows + row] = value
            largest[k] = larger(largest[k], value, good)
        if gasket >= 0:
            _, on_housing = bushing_wrench(motion, numbers, gasket, x, branches)
            for k in range(6):
                largest[count + k] = larger(largest[count + k], on_housing[k], good)
        for k in range(len(springs)):
            spring = read_spring(numbers, springs[k])
            arm = rotate(motion.rotation, spring.p_ToA_T)
            length, _, _, _, _ = strut_line(motion, arm, spring.p_WH)
            shortest[k] = where((good > 0.5) & (length < shortest[k]), length, shortest[k])
        largest[count + 6] = largest[count + 6] + good
    keep(x_numbers)
