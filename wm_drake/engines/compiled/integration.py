"""The classical fourth-order Runge-Kutta scheme at fixed steps, for `WIDTH` machines."""

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.lanes import align_stack, lane_array
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    mass_properties,
    rates_size,
    state_derivative,
    state_size,
    write_rates,
)


@long_running
def integrate_lanes(steps, begin, end, p, elements, x, work, history):
    """Advance the states of `lanes.WIDTH` machines from the start of step `begin` to that of `end`.

    All arrays of floats are flat arrays of lanes: they hold one number of every machine, then the
    next one of every machine.

    Args:
        steps: Length, drum acceleration, drum motion and sample number of each step: four fields
            of a `Schedule`, no arrays of lanes.
        begin, end: Numbers of steps.
        p: Packed numbers.
        elements: `Elements`, which all machines have in common.
        x: States; they are advanced.
        work: Three arrays of the size of the state, to work in.
        history: Samples, one after the other: the state, then `rates_size` accelerations. A sample
            is written at the start of each step that has a sample number.
    """
    align_stack()
    numbers, state, samples = lane_array(p), lane_array(x), lane_array(history)
    y, dx, total = lane_array(work[0]), lane_array(work[1]), lane_array(work[2])
    length, acceleration, drum, row = steps
    size = state_size(elements)
    masses = mass_properties(numbers, drum[2 * begin, 1], drum[2 * begin, 2])
    for k in range(size):
        y[k] = total[k] = state[k]
    for i in range(begin, end):
        h = length[i]
        sample = row[i] * (size + rates_size(elements))  # below 0 for none
        if sample >= 0:
            for k in range(size):
                samples[sample + k] = state[k]
        for stage in range(4):
            node = 2 * i + (stage + 1) // 2
            if stage == 1 or stage == 3:
                masses = mass_properties(numbers, drum[node, 1], drum[node, 2])
            state_derivative(y, dx, masses, drum[node, 0], acceleration[i], numbers, elements)
            if stage == 0 and sample >= 0:
                write_rates(samples, sample + size, dx, elements)
            inner = stage == 1 or stage == 2
            weight = h / 3.0 if inner else h / 6.0
            ahead = h if stage == 2 else 0.5 * h
            for k in range(size):
                total[k] = total[k] + weight * dx[k]
                y[k] = state[k] + ahead * dx[k]
        zero = 0.0 * state[0]
        total[DRUM_ANGLE] = zero + drum[2 * i + 2, 3]
        total[DRUM_RATE] = zero + drum[2 * i + 2, 0]
        for k in range(size):
            state[k] = total[k]
            y[k] = total[k]


@long_running
def derivative_lanes(x, dx, acceleration, p, elements):
    """Evaluate `state_derivative` for `lanes.WIDTH` machines.

    Args:
        x: States; the drum's angle and rate are read from them.
        dx: Time derivatives, written.
        acceleration: Acceleration of the drum, the same for all machines. [rad/s^2]
        p: Packed numbers.
        elements: `Elements`, which all machines have in common.
    """
    align_stack()
    state, numbers = lane_array(x), lane_array(p)
    sine, cosine = sine_cosine(state[DRUM_ANGLE])
    masses = mass_properties(numbers, cosine, sine)
    state_derivative(
        state, lane_array(dx), masses, state[DRUM_RATE], acceleration, numbers, elements
    )
