"""The classical fourth-order Runge-Kutta scheme at fixed steps, for one machine or for several side by side."""

from wm_drake.kernel.mechanics import mass_properties, state_derivative, state_size
from wm_drake.laws.compilation import law, long_running
from wm_drake.laws.lanes import align_stack, lane_array, number_array


@law
def integrate(steps, begin, end, p, elements, x, work, history):
    """Steps a state from the begin of step `begin` to the begin of step `end`.

    Args:
        steps: Length, drum acceleration, drum motion and sample number of each step: four fields of a `Schedule`.
        begin, end: Numbers of steps.
        p, elements: As for `state_derivative`.
        x: State, which is advanced.
        work: Three arrays of the size of the state, to work in, and `state_derivative`'s scratch.
        history: States at the samples, one after the other; written at the end of steps that have a sample.
    """
    length, acceleration, drum, row = steps
    y, dx, total, scratch = work
    size = state_size(elements)
    masses = mass_properties(p, drum[2 * begin, 1], drum[2 * begin, 2])
    for k in range(size):
        y[k] = total[k] = x[k]
    for i in range(begin, end):
        h = length[i]
        for stage in range(4):
            node = 2 * i + (stage + 1) // 2
            if stage == 1 or stage == 3:
                masses = mass_properties(p, drum[node, 1], drum[node, 2])
            state_derivative(y, dx, masses, drum[node, 0], acceleration[i], p, elements, scratch)
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
        if row[i] >= 0:
            at = row[i] * size
            for k in range(size):
                history[at + k] = x[k]


@long_running
def integrate_alone(steps, begin, end, p, elements, x, work, history):
    """`integrate` of one machine; flat arrays of floats."""
    numbers_of_work = (number_array(work[0]), number_array(work[1]), number_array(work[2]), number_array(work[3]))
    integrate(steps, begin, end, number_array(p), elements, number_array(x), numbers_of_work, number_array(history))


@long_running
def integrate_lanes(steps, begin, end, p, elements, x, work, history):
    """`integrate` of `lanes.WIDTH` machines side by side: each array holds, for each number, that of every machine."""
    align_stack()
    lanes_of_work = (lane_array(work[0]), lane_array(work[1]), lane_array(work[2]), lane_array(work[3]))
    integrate(steps, begin, end, lane_array(p), elements, lane_array(x), lanes_of_work, lane_array(history))
