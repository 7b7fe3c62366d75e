"""The linearised machine: its Jacobian, and its growth under the multistep integrator.

The integrator of `wm_drake.engines.compiled.multistep` treats the parts of the state in different
ways, so a region of h lambda in the complex plane does not tell whether it is stable. Here the
linearised machine takes the same steps, from numbers at random: whatever the coupling of the parts,
an unstable step makes the numbers grow. `WIDTH` Jacobians go side by side in the lanes.
"""

import functools

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import decay_factor, sine_cosine, where
from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.engines.compiled.cabinet import CABINET_STATE_SIZE, write_cabinet_jacobian
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    mass_properties,
    read_bodies,
    state_derivative,
    target_speed,
)
from wm_drake.engines.compiled.multistep import (
    PAST_INPUTS,
    PAST_RATES,
    explicit_multistep,
    extrapolated,
    remember,
)
from wm_drake.engines.compiled.packing import Layout
from wm_drake.parameters.types import FloatArray

SMOOTH, INTERNAL, PATH, CABINET = 0, 1, 2, 3
"""How the multistep integrator treats a state: with the explicit formula; as an internal state, by
a step of the Runge-Kutta scheme of it alone; in closed form along its path; with all states of the
cabinet, by a step of the Runge-Kutta scheme of them."""

STEPS = 1000
"""Steps of the linearised machine: growth of 0.2 % a step is seen."""

LARGEST_GROWTH = 3.0
"""Largest growth from the second to the last quarter of the steps. A motion without a restoring
force, such as the spin of a damper tube, grows by 2."""


def jacobians(
    packed: FloatArray, layout: Layout, states: FloatArray, free: np.ndarray, difference: float
) -> tuple[FloatArray, FloatArray]:
    """Return the Jacobians of a machine at several states, by central differences.

    Args:
        packed, layout: From `pack`.
        states: (WIDTH, size)
        free: Indices of the states that are differentiated.
        difference: Half of the difference. [m, rad, m/s, rad/s]

    Returns:
        (WIDTH, n, n), and that of a cabinet that moves under a constant wrench of its mounts
        (WIDTH, m, m), m = 0 for a fixed one. [1/s]
    """
    p = fill_lanes(aligned(len(packed) * WIDTH), [packed])
    x = fill_lanes(aligned(states.size), list(states))
    n = len(free)
    entries = aligned(n * n * WIDTH)
    work = aligned((states.shape[1] + layout.states.begins.inputs) * WIDTH)
    m = CABINET_STATE_SIZE if layout.cabinet >= 0 else 0
    cabinet_jacobian = aligned(m * m * WIDTH)
    jacobian_lanes(
        x, work, np.asarray(free), difference, p, layout.elements, entries, cabinet_jacobian
    )
    of_all, of_cabinet = (
        part.reshape(size, size, WIDTH).transpose(2, 0, 1)
        for part, size in ((entries, n), (cabinet_jacobian, m))
    )
    return of_all, of_cabinet


def is_followed(
    jacobians: FloatArray,
    internal: np.ndarray,
    step: float,
    cabinet: FloatArray | None = None,
    *,
    may_grow: bool = False,
) -> bool:
    """Return whether steps with one derivative keep linearised machines from growing.

    One with a cabinet that moves may grow as fast as it does by itself.

    Args:
        jacobians: (WIDTH, n, n) [1/s]
        internal: (n,) `SMOOTH`, `INTERNAL`, `PATH` or `CABINET`: how each state is treated.
        step: Step size. [s]
        cabinet: (WIDTH, m, m) Jacobians of the m states `CABINET` under a constant wrench of the
            mounts; None without any. [1/s]
        may_grow: Whether a machine with a fixed cabinet may do so too, as one with liquid that lies
            at the top of a drum at rest.
    """
    if not np.all(np.isfinite(jacobians)):
        return False
    n = len(internal)
    start = _start(n * (2 + PAST_RATES + PAST_INPUTS))
    numbers = aligned(len(start) * WIDTH)
    numbers.reshape(-1, WIDTH)[:] = start[:, None]
    jacobian = aligned(n * n * WIDTH)
    jacobian[:] = jacobians.transpose(1, 2, 0).ravel()
    largest = aligned(4 * WIDTH)
    m = int(np.count_nonzero(internal == CABINET))
    cabinet_jacobian = work = None
    if m and cabinet is not None:
        cabinet_jacobian, work = aligned(m * m * WIDTH), aligned(3 * m * WIDTH)
        cabinet_jacobian[:] = cabinet.transpose(1, 2, 0).ravel()
    block = int(np.argmax(internal == CABINET)), m
    growth_lanes(jacobian, internal, step, STEPS, numbers, cabinet_jacobian, block, work, largest)
    quarters = largest.reshape(4, WIDTH)
    if not np.all(np.isfinite(numbers)):  # also where no number was seen on the way to it
        return False
    grown = quarters[3] > LARGEST_GROWTH * quarters[1]
    if (m or may_grow) and np.any(grown):
        motion_growth = np.exp(0.5 * STEPS * step * _fastest_growth(jacobians[grown]))
        return bool(
            np.all(quarters[3, grown] <= LARGEST_GROWTH * motion_growth * quarters[1, grown])
        )
    return not np.any(grown)


@functools.cache
def _start(count: int) -> FloatArray:
    """Return the same numbers at random between -1 and 1 for all machines of a size. (count,)"""
    return np.random.default_rng(0).uniform(-1.0, 1.0, count)


def _fastest_growth(jacobians: FloatArray) -> FloatArray:
    """Return the largest real part of the eigenvalues of each matrix, at least 0. (n,) [1/s]

    A cabinet that slides fast under a drum that spins grows by itself: friction that stays the same
    does not brake it, and the floor tips it.
    """
    return np.maximum(np.linalg.eigvals(jacobians).real.max(axis=1), 0.0)


@long_running
def jacobian_lanes(x, work, free, difference, p, elements, jacobian, cabinet_jacobian):
    """Write the Jacobians of `lanes.WIDTH` states, by rows.

    Args:
        x: States.
        work: Array for a time derivative and the inputs of internal states.
        free: Indices of the states that are differentiated.
        difference: Half of the difference.
        p: Packed numbers.
        elements: `Elements`.
        jacobian: Square matrices, written.
        cabinet_jacobian: The same of a cabinet that moves under a constant wrench of its mounts.
    """
    align_stack()
    state, numbers, entries = lane_array(x), lane_array(p), lane_array(jacobian)
    cabinet_entries = lane_array(cabinet_jacobian)
    size = len(x) // WIDTH
    rate, inputs = lane_array(work[: size * WIDTH]), lane_array(work[size * WIDTH :])
    sine, cosine = sine_cosine(state[DRUM_ANGLE])
    masses = mass_properties(numbers, cosine, sine)
    n, reference, zero = len(free), state[DRUM_RATE], 0.0 * state[DRUM_RATE]
    begins = elements.begins
    for column in range(n):
        at_rest = state[free[column]]
        for row in range(n):
            entries[row * n + column] = 0.0 * at_rest
        for side in (-1.0, 1.0):
            state[free[column]] = at_rest + side * difference
            target = target_speed(state, reference, elements.motor)
            state_derivative(state, rate, inputs, masses, target, zero, numbers, elements)
            for row in range(n):
                change = side * rate[free[row]] / (2.0 * difference)
                entries[row * n + column] = entries[row * n + column] + change
        state[free[column]] = at_rest
    write_cabinet_jacobian(
        state, rate, inputs, begins.wrench_input, difference, read_bodies(numbers, 0).gravity,
        numbers, elements.cabinet, begins.cabinet, cabinet_entries
    )  # fmt: skip


@long_running
def growth_lanes(jacobian, internal, h, steps, numbers, cabinet_jacobian, block, work, largest):
    """Take the steps of the multistep integrator with linear machines.

    Args:
        jacobian: Square matrices, by rows.
        internal: How each state is treated: `SMOOTH`, `INTERNAL`, `PATH` or `CABINET`.
        h: Step size. [s]
        steps: Number of steps.
        numbers: Anything to start from: state, its rate, past rates, past inputs.
        cabinet_jacobian, block: Matrices of the states `CABINET` alone, by rows, None without such
            states; the first of them and their number.
        work: Array to work in, for three numbers of each of these states; None without them.
        largest: Largest number of the state in each quarter of the steps, written.
    """
    align_stack()
    n = len(internal)
    a, top = lane_array(jacobian), lane_array(largest)
    x, rate = lane_array(numbers[: n * WIDTH]), lane_array(numbers[n * WIDTH : 2 * n * WIDTH])
    begin, end = 2 * n * WIDTH, (2 + PAST_RATES) * n * WIDTH
    past_rates, past_inputs = lane_array(numbers[begin:end]), lane_array(numbers[end:])
    b, stage, (first, m) = as_lanes(cabinet_jacobian), as_lanes(work), block
    for quarter in range(4):
        top[quarter] = 0.0 * x[0]
    for i in range(steps):
        write_product(a, x, 0, n, rate, 0)
        remember(past_rates, i, PAST_RATES, rate, n)
        for row in range(n):  # the rate of an internal state without its own share is its input
            share = a[row * n + row] * x[row]
            past_inputs[i % PAST_INPUTS * n + row] = rate[row] - share
        block_after_step(x, rate, past_inputs, i, n, h, b, first, m, stage)
        quarter = 4 * i // steps
        most = top[quarter]
        for row in range(n):
            if internal[row] == INTERNAL:
                middle, ahead = extrapolated(past_inputs, i, row, n)
                x[row] = decay_after_step(x[row], rate[row], a[row * n + row], middle, ahead, h)
            elif internal[row] == PATH:
                middle, ahead = extrapolated(past_inputs, i, row, n)
                start = past_inputs[i % PAST_INPUTS * n + row]
                path = h / 6.0 * (start + 4.0 * middle + ahead)
                x[row] = path_after_step(x[row], a[row * n + row], path, h)
            elif internal[row] == SMOOTH:
                x[row] = explicit_multistep(x[row], past_rates, i, row, n, h)
            size = abs(x[row])
            most = where(size > most, size, most)
        top[quarter] = most


@law
def as_lanes(array):
    """Return an array as an array of lanes; None stays."""
    if array is None:
        return None
    return lane_array(array)


@law
def write_product(a, x, first, size, product, at):
    """Write the product of a square matrix, by rows, with the part of x from `first` on.

    It begins at index `at` of `product`.
    """
    whole = size - size % 4
    for row in range(0, whole, 4):  # four rows side by side: one sum would wait for itself
        r = row * size
        s_0 = s_1 = s_2 = s_3 = 0.0 * x[first]
        for column in range(size):
            number = x[first + column]
            s_0 = s_0 + a[r + column] * number
            s_1 = s_1 + a[r + size + column] * number
            s_2 = s_2 + a[r + 2 * size + column] * number
            s_3 = s_3 + a[r + 3 * size + column] * number
        product[at + row], product[at + row + 1] = s_0, s_1
        product[at + row + 2], product[at + row + 3] = s_2, s_3
    for row in range(whole, size):
        total = 0.0 * x[first]
        for column in range(size):
            total = total + a[row * size + column] * x[first + column]
        product[at + row] = total


@law
def block_after_step(x, rate, inputs, i, n, h, b, first, m, work):
    """Advance some states by a Runge-Kutta step of x' = u + B x, as `cabinet_after_step` does.

    Args:
        x, rate: State of a linear machine, of which these states are advanced, and its rate.
        inputs, i, n: Past inputs u, those of this step written; number of the step, size of the
            state.
        h: Length of the step. [s]
        b: Matrix B, by rows; None without such states.
        first, m: The first of these states and their number.
        work: Array to work in; None without such states.
    """
    if b is None:
        return
    write_product(b, x, first, m, work, 0)
    for row in range(m):
        inputs[i % PAST_INPUTS * n + first + row] = rate[first + row] - work[row]
    for k in range(m):
        work[m + k] = x[first + k] + h / 6.0 * rate[first + k]
        work[k] = x[first + k] + 0.5 * h * rate[first + k]
    for number in range(1, 4):
        write_product(b, work, 0, m, work, 2 * m)
        weight = h / 6.0 if number == 3 else h / 3.0
        ahead = h if number == 2 else 0.5 * h
        for k in range(m):
            middle, end = extrapolated(inputs, i, first + k, n)
            total = work[2 * m + k] + (end if number == 3 else middle)
            work[m + k] = work[m + k] + weight * total
            work[k] = x[first + k] + ahead * total
    for k in range(m):
        x[first + k] = work[m + k]


@law
def path_after_step(x, a, path, h):
    """Return the solution of x' = u + a x, a <= 0, after a step with the mean input path / h."""
    decay = where(a < 0.0, -a * h, 0.0 * a)
    factor, small = decay_factor(decay), decay < 1e-6
    mean = where(small, 1.0 - 0.5 * decay, (1.0 - factor) / where(small, 1.0, decay))
    return x * factor + path * mean


@law
def decay_after_step(x, rate, a, middle, end, h):
    """Return the solution of x' = u + a x after a step, as `sponge_after_step` computes it."""
    second = middle + a * (x + 0.5 * h * rate)
    third = middle + a * (x + 0.5 * h * second)
    fourth = end + a * (x + h * third)
    return x + h / 6.0 * ((rate + fourth) + 2.0 * (second + third))
