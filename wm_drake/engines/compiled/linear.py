"""The linearised machine: its Jacobian, and its growth under the multistep integrator.

The integrator of `wm_drake.engines.compiled.multistep` treats the parts of the state in different
ways, so a region of h lambda in the complex plane does not tell whether it is stable. Here the
linearised machine takes the same steps, from numbers at random: whatever the coupling of the parts,
an unstable step makes the numbers grow. `WIDTH` Jacobians go side by side in the lanes.
"""

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import decay_factor, sine_cosine, where
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    mass_properties,
    state_derivative,
    wanted_speed,
)
from wm_drake.engines.compiled.multistep import (
    PAST_INPUTS,
    PAST_RATES,
    explicit_multistep,
    extrapolated,
    remember,
)
from wm_drake.engines.compiled.packing import Layout, aligned, fill_lanes
from wm_drake.parameters.types import FloatArray

SMOOTH, SPONGE, PATH = 0, 1, 2
"""How the multistep integrator treats a state: with the explicit formula; as an internal state, by
a step of the Runge-Kutta scheme of it alone; in closed form along its path."""

STEPS = 1000
"""Steps of the linearised machine: growth of 0.2 % a step is seen."""

LARGEST_GROWTH = 3.0
"""Largest growth from the second to the last quarter of the steps. A motion without a restoring
force, such as the spin of a damper tube, grows by 2."""


def jacobians(
    packed: FloatArray, layout: Layout, states: FloatArray, free: list[int], difference: float
) -> FloatArray:
    """Return the Jacobians of a machine at several states, by central differences.

    Args:
        packed, layout: From `pack`.
        states: (WIDTH, size)
        free: Indices of the states that are differentiated.
        difference: Half of the difference. [m, rad, m/s, rad/s]

    Returns:
        (WIDTH, n, n) [1/s]
    """
    p = fill_lanes(aligned(len(packed) * WIDTH), [packed])
    x = fill_lanes(aligned(states.size), list(states))
    n = len(free)
    found, work = aligned(n * n * WIDTH), aligned((states.shape[1] + layout.inputs_size) * WIDTH)
    jacobian_lanes(x, work, np.array(free), difference, p, layout.elements, found)
    return found.reshape(n, n, WIDTH).transpose(2, 0, 1)


def is_followed(jacobians: FloatArray, internal: np.ndarray, step: float) -> bool:
    """Return whether steps with one derivative keep linearised machines from growing.

    Args:
        jacobians: (WIDTH, n, n) [1/s]
        internal: (n,) `SMOOTH`, `SPONGE` or `PATH`: how each state is treated.
        step: Step size. [s]
    """
    if not np.all(np.isfinite(jacobians)):
        return False
    n = len(internal)
    start = np.random.default_rng(0).uniform(-1.0, 1.0, (n * (2 + PAST_RATES + PAST_INPUTS), 1))
    numbers = aligned(start.size * WIDTH)
    numbers.reshape(-1, WIDTH)[:] = start
    jacobian = aligned(n * n * WIDTH)
    jacobian[:] = jacobians.transpose(1, 2, 0).ravel()
    largest = aligned(4 * WIDTH)
    growth_lanes(jacobian, internal, step, STEPS, numbers, largest)
    quarters = largest.reshape(4, WIDTH)
    if not np.all(np.isfinite(numbers)):  # also where no number was seen on the way to it
        return False
    return bool(np.all(quarters[3] <= LARGEST_GROWTH * quarters[1]))


@long_running
def jacobian_lanes(x, work, free, difference, p, elements, jacobian):
    """Write the Jacobians of `lanes.WIDTH` states, by rows.

    Args:
        x: States.
        work: Array for a time derivative and the inputs of internal states.
        free: Indices of the states that are differentiated.
        difference: Half of the difference.
        p: Packed numbers.
        elements: `Elements`.
        jacobian: Square matrices, written.
    """
    align_stack()
    state, numbers, found = lane_array(x), lane_array(p), lane_array(jacobian)
    size = len(x) // WIDTH
    rate, inputs = lane_array(work[: size * WIDTH]), lane_array(work[size * WIDTH :])
    sine, cosine = sine_cosine(state[DRUM_ANGLE])
    masses = mass_properties(numbers, cosine, sine)
    n, reference = len(free), state[DRUM_RATE]
    for column in range(n):
        at_rest = state[free[column]]
        for row in range(n):
            found[row * n + column] = 0.0 * at_rest
        for side in (-1.0, 1.0):
            state[free[column]] = at_rest + side * difference
            wanted = wanted_speed(state, reference, elements.motor)
            state_derivative(state, rate, inputs, masses, wanted, 0.0, numbers, elements)
            for row in range(n):
                change = side * rate[free[row]] / (2.0 * difference)
                found[row * n + column] = found[row * n + column] + change
        state[free[column]] = at_rest


@long_running
def growth_lanes(jacobian, internal, h, steps, numbers, largest):
    """Take the steps of the multistep integrator with linear machines.

    Args:
        jacobian: Square matrices, by rows.
        internal: How each state is treated: `SMOOTH`, `SPONGE` or `PATH`.
        h: Step size. [s]
        steps: Number of steps.
        numbers: Anything to start from: state, its rate, past rates, past inputs.
        largest: Largest number of the state in each quarter of the steps, written.
    """
    align_stack()
    n = len(internal)
    a, top = lane_array(jacobian), lane_array(largest)
    x, rate = lane_array(numbers[: n * WIDTH]), lane_array(numbers[n * WIDTH : 2 * n * WIDTH])
    begin, end = 2 * n * WIDTH, (2 + PAST_RATES) * n * WIDTH
    past_rates, past_inputs = lane_array(numbers[begin:end]), lane_array(numbers[end:])
    for quarter in range(4):
        top[quarter] = 0.0 * x[0]
    for i in range(steps):
        for row in range(n):
            total = 0.0 * x[0]
            for column in range(n):
                total = total + a[row * n + column] * x[column]
            rate[row] = total
        remember(past_rates, i, PAST_RATES, rate, n)
        for row in range(n):  # the rate of an internal state without its own share is its input
            own = a[row * n + row] * x[row]
            past_inputs[i % PAST_INPUTS * n + row] = rate[row] - own
        for row in range(n):
            if internal[row] == SPONGE:
                middle, ahead = extrapolated(past_inputs, i, row, n)
                x[row] = decay_after_step(x[row], rate[row], a[row * n + row], middle, ahead, h)
            elif internal[row] == PATH:
                middle, ahead = extrapolated(past_inputs, i, row, n)
                start = past_inputs[i % PAST_INPUTS * n + row]
                path = h / 6.0 * (start + 4.0 * middle + ahead)
                x[row] = path_after_step(x[row], a[row * n + row], path, h)
            else:
                x[row] = explicit_multistep(x[row], past_rates, i, row, n, h)
            quarter = 4 * i // steps
            size = abs(x[row])
            top[quarter] = where(size > top[quarter], size, top[quarter])


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
