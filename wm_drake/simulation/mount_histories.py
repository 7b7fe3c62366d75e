"""Forces of the mounts on the cabinet at samples, and their sums over a run, as compiled code."""

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import where
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import dot, subtract
from wm_drake.elements.mount import WRENCH_SIZE, write_mount_wrenches
from wm_drake.simulation.histories import in_bounds

VECTOR_SUMS = PackedLayout(
    "VectorSums", first=VECTOR, largest=SCALAR, square=SCALAR, change=VECTOR, change_square=SCALAR
)
"""Sums over the samples of a vector F: its first value F0; largest F . F; sums of F . F, of F - F0
and of its square."""
SIGNAL_SUMS = PackedLayout(
    "SignalSums", first=SCALAR, largest=SCALAR, square=SCALAR, change=SCALAR, change_square=SCALAR
)
"""The same sums of a single signal."""
VECTOR_SIZE, SIGNAL_SIZE = VECTOR_SUMS.fixed_size, SIGNAL_SUMS.fixed_size
read_vector_sums, write_vector_sums = VECTOR_SUMS.read, VECTOR_SUMS.write
read_signal_sums, write_signal_sums = SIGNAL_SUMS.read, SIGNAL_SUMS.write


@law
def add_vector(sums, at, value, is_first, good):
    """Add a sample of a vector to its `VECTOR_SUMS`; it counts if `good` is 1."""
    if is_first:
        zero = 0.0 * good
        write_vector_sums(sums, at, value, zero, zero, (zero, zero, zero), zero)
    old, counts = read_vector_sums(sums, at), good > 0.5
    square, change = dot(value, value), subtract(value, old.first)
    write_vector_sums(
        sums,
        at,
        old.first,
        where(counts & (square > old.largest), square, old.largest),
        where(counts, old.square + square, old.square),
        (
            where(counts, old.change[0] + change[0], old.change[0]),
            where(counts, old.change[1] + change[1], old.change[1]),
            where(counts, old.change[2] + change[2], old.change[2]),
        ),
        where(counts, old.change_square + dot(change, change), old.change_square),
    )


@law
def add_signal(sums, at, value, is_first, good):
    """Add a sample of a signal to its `SIGNAL_SUMS`; it counts if `good` is 1."""
    if is_first:
        zero = 0.0 * good
        write_signal_sums(sums, at, value, zero, zero, zero, zero)
    old, counts = read_signal_sums(sums, at), good > 0.5
    square, change = value * value, value - old.first
    write_signal_sums(
        sums,
        at,
        old.first,
        where(counts & (square > old.largest), square, old.largest),
        where(counts, old.square + square, old.square),
        where(counts, old.change + change, old.change),
        where(counts, old.change_square + change * change, old.change_square),
    )


@long_running
def measure_mounts_lanes(samples, rows, size, bounds, p, mounts, count, cabinet, sums):
    """Sum up the forces of the mounts of `lanes.WIDTH` runs, each up to its first bad sample.

    All arrays of floats are flat arrays of lanes.

    Args:
        samples: Samples, one after the other, each with the state first.
        rows, size: Number of samples, and of the numbers in each.
        bounds: Largest angle and displacement of the tub at which a run goes on. [rad, m]
        p, mounts, count: Packed numbers, the `Mounts` in them, and how many they are.
        cabinet: Written unless it is empty: resultant wrench on the cabinet at each sample, moment
            about the origin of W and force. [N m, N]
        sums: Written: `VECTOR_SUMS` of the force of each mount; `SIGNAL_SUMS` of the six numbers of
            the resultant wrench; number of samples in bounds.
    """
    align_stack()
    x_numbers = np.empty(size * WIDTH)
    wrench_numbers = np.empty(count * WRENCH_SIZE * WIDTH)
    x, states, numbers = lane_array(x_numbers), lane_array(samples), lane_array(p)
    wrenches, resultant, total = lane_array(wrench_numbers), lane_array(cabinet), lane_array(sums)
    zero = 0.0 * numbers[0]
    good, samples_in_bounds = zero + 1.0, zero
    of_cabinet, keeps = count * VECTOR_SIZE, len(cabinet) > 0
    for row in range(rows):
        for k in range(size):
            x[k] = states[row * size + k]
        good = good * in_bounds(x, bounds[0], bounds[1])
        samples_in_bounds = samples_in_bounds + good
        write_mount_wrenches(x, numbers, mounts, wrenches)
        for i in range(count):
            at = i * WRENCH_SIZE
            force = (wrenches[at + 3], wrenches[at + 4], wrenches[at + 5])
            add_vector(total, i * VECTOR_SIZE, force, row == 0, good)
        for k in range(WRENCH_SIZE):
            value = zero
            for i in range(count):
                value = value + wrenches[i * WRENCH_SIZE + k]
            add_signal(total, of_cabinet + k * SIGNAL_SIZE, value, row == 0, good)
            if keeps:
                resultant[row * WRENCH_SIZE + k] = value
    total[of_cabinet + WRENCH_SIZE * SIGNAL_SIZE] = samples_in_bounds
    keep(x_numbers)
    keep(wrench_numbers)


@long_running
def sum_mounts_history(forces, wrenches, sums):
    """Sum up the forces of the mounts of one run, as `measure_mounts_lanes` does.

    Args:
        forces: (n, 3 mounts) force of each mount on the cabinet. [N]
        wrenches: (n, 6) resultant wrench on the cabinet: moment and force. [N m, N]
        sums: Written, as by `measure_mounts_lanes`.
    """
    count = forces.shape[1] // 3
    of_cabinet, good = count * VECTOR_SIZE, 1.0
    for row in range(len(forces)):
        for i in range(count):
            force = (forces[row, 3 * i], forces[row, 3 * i + 1], forces[row, 3 * i + 2])
            add_vector(sums, i * VECTOR_SIZE, force, row == 0, good)
        for k in range(WRENCH_SIZE):
            add_signal(sums, of_cabinet + k * SIGNAL_SIZE, wrenches[row, k], row == 0, good)
    sums[of_cabinet + WRENCH_SIZE * SIGNAL_SIZE] = len(forces)
