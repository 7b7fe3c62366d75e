"""The classical fourth-order Runge-Kutta scheme at fixed steps, for one machine or for several side by side."""

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.lanes import align_stack, lane_array, number_array, quad_array
from wm_drake.engines.compiled.mechanics import (
    DRUM_RATE,
    mass_properties,
    rates_size,
    state_derivative,
    state_size,
    write_rates,
)


@law
def integrate(steps, begin, end, p, struts, elements, x, work, history):
    """Steps a state from the begin of step `begin` to the begin of step `end`.

    Args:
        steps: Length, drum acceleration, drum motion and sample number of each step: four fields of a `Schedule`.
        begin, end: Numbers of steps.
        p, struts, elements: As for `state_derivative`.
        x: State, which is advanced.
        work: Three arrays of the size of the state, to work in, and `state_derivative`'s scratch.
        history: Samples, one after the other: the state, then `rates_size` numbers of its derivative; written at the begin of
            steps that have one.
    """
    length, acceleration, drum, row = steps
    y, dx, total, scratch = work
    size = state_size(elements)
    masses = mass_properties(p, drum[2 * begin, 1], drum[2 * begin, 2])
    for k in range(size):
        y[k] = total[k] = x[k]
    for i in range(begin, end):
        h = length[i]
        sample = row[i] * (size + rates_size(elements))  # below 0 for none
        if sample >= 0:
            for k in range(size):
                history[sample + k] = x[k]
        for stage in range(4):
            node = 2 * i + (stage + 1) // 2
            if stage == 1 or stage == 3:
                masses = mass_properties(p, drum[node, 1], drum[node, 2])
            state_derivative(
                y, dx, masses, drum[node, 0], acceleration[i], p, struts, elements, scratch
            )
            if stage == 0 and sample >= 0:
                write_rates(history, sample + size, dx, elements)
            inner = stage == 1 or stage == 2
            weight = h / 3.0 if inner else h / 6.0
            ahead = h if stage == 2 else 0.5 * h
            for k in range(size):
                total[k] = total[k] + weight * dx[k]
                y[k] = x[k] + ahead * dx[k]
        zero = 0.0 * x[0]
        total[6] = zero + drum[2 * i + 2, 3]
        total[13] = zero + drum[2 * i + 2, 0]
        for k in range(size):
            x[k] = total[k]
            y[k] = total[k]


@long_running
def integrate_alone(steps, begin, end, p, struts, elements, x, work, history):
    """`integrate` of one machine, springs and dampers side by side; flat arrays of floats.

    The arrays to work in have room for `lanes.QUAD` numbers more than the state.
    """
    of_work = (
        number_array(work[0]),
        number_array(work[1]),
        number_array(work[2]),
        quad_array(work[3]),
    )
    numbers = number_array(p), quad_array(struts), elements, number_array(x)
    integrate(steps, begin, end, *numbers, of_work, number_array(history))


@long_running
def derivative_alone(x, dx, acceleration, p, struts, elements, scratch):
    """`state_derivative` of one machine at an acceleration of the drum [rad/s^2]; arrays as in `integrate_alone`."""
    numbers, state = number_array(p), number_array(x)
    sine, cosine = sine_cosine(state[6])
    drum = mass_properties(numbers, cosine, sine), state[DRUM_RATE], acceleration
    state_derivative(
        state, number_array(dx), *drum, numbers, quad_array(struts), elements, quad_array(scratch)
    )


@long_running
def integrate_lanes(steps, begin, end, p, elements, x, work, history):
    """`integrate` of `lanes.WIDTH` machines side by side: each array holds, for each number, that of every machine."""
    align_stack()
    of_work = (lane_array(work[0]), lane_array(work[1]), lane_array(work[2]), lane_array(work[3]))
    integrate(
        steps,
        begin,
        end,
        lane_array(p),
        lane_array(p),
        elements,
        lane_array(x),
        of_work,
        lane_array(history),
    )
