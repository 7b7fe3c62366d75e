"""Integrate `WIDTH` machines at fixed steps, each with one derivative or with four.

A step with four derivatives is one of the classical fourth-order Runge-Kutta scheme. A step with
one uses the steps before it (`wm_drake.engines.compiled.multistep`).
"""

from collections import namedtuple

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.lane_memory import aligned
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.engines.compiled.drum import sample_controller
from wm_drake.engines.compiled.local_error import (
    DIFFERENCED,
    EVERY,
    OF_MULTISTEP,
    OF_RUNGE_KUTTA,
    add_fourth_difference,
    add_inner_peaks,
    add_peaks,
    alike_before,
    steps_alike,
)
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    follow_profile,
    mass_properties,
    state_derivative,
    target_speed,
    write_sample,
)
from wm_drake.engines.compiled.multistep import PAST_INPUTS, PAST_RATES, multistep_step, remember
from wm_drake.engines.compiled.rubber import follow_paths, write_paths
from wm_drake.engines.compiled.water import hold_masses

Work = namedtuple("Work", ("rate", "inputs", "stage", "total", "past_rates", "past_inputs"))
"""Arrays to work in. The past of a step with one derivative must stay from call to call."""
Past = namedtuple("Past", ("rates", "inputs"))
"""Time derivatives and inputs at the start of the last steps, as arrays of lanes."""


def work_arrays(size, inputs):
    """Return the `Work` for states and inputs of these sizes."""
    sizes = (size, inputs, size, size, PAST_RATES * size, PAST_INPUTS * inputs)
    return Work(*(aligned(count * WIDTH) for count in sizes))


@long_running
def integrate_lanes(steps, begin, end, p, elements, x, work, sums, history):
    """Advance the states of `lanes.WIDTH` machines from the start of step `begin` to that of `end`.

    All arrays of floats are flat arrays of lanes: they hold one number of every machine, then the
    next one of every machine.

    Args:
        steps: Length, drum acceleration, drum motion and sample number of each step, and whether a
            sampled controller acts at its start, five fields of a `Schedule`; and whether it takes
            one derivative; no arrays of lanes.
        begin, end: Numbers of steps.
        p: Packed numbers.
        elements: `Elements`, which all machines have in common.
        x: States; they are advanced.
        work: `Work`, the same from the first step to the last.
        sums: `wm_drake.engines.compiled.local_error.Sums` of the runs, advanced.
        history: Samples, one after the other: the state, then `Begins.rates` accelerations. One is
            written at the start of each step that has a sample number.
    """
    align_stack()
    numbers, state, samples = lane_array(p), lane_array(x), lane_array(history)
    rate, inputs = lane_array(work.rate), lane_array(work.inputs)
    stage, total = lane_array(work.stage), lane_array(work.total)
    past, errors = Past(lane_array(work.past_rates), lane_array(work.past_inputs)), lane_array(sums)
    length, acceleration, drum, row, controls, one_derivative = steps
    zero, begins, inner = 0.0 * state[0], elements.begins, elements.inner
    alike = alike_before(begin, length, acceleration)
    for i in range(begin, end):
        sample_controller(state, drum[2 * i, 0], controls[i], numbers, elements.motor, begins.motor)
        hold_masses(numbers, state, begins.water, elements.water)
        masses = mass_properties(numbers, zero + drum[2 * i, 1], zero + drum[2 * i, 2])
        speed, speed_rate = zero + drum[2 * i, 0], zero + acceleration[i]
        state_derivative(state, rate, inputs, masses, speed, speed_rate, numbers, elements)
        if row[i] >= 0:
            write_sample(samples, row[i], state, rate, elements)
        remember(past.rates, i, PAST_RATES, rate, begins.size)
        remember(past.inputs, i, PAST_INPUTS, inputs, begins.inputs)
        add_peaks(errors, state, rate, row[i] >= 0)
        add_inner_peaks(errors, state, length[i], inner)
        alike = steps_alike(alike, i, length, acceleration)
        if alike >= DIFFERENCED and i % EVERY == 0:
            factor = OF_MULTISTEP if one_derivative[i] else OF_RUNGE_KUTTA
            add_fourth_difference(
                errors, past.rates, i, length[i], factor, begins.size, PAST_RATES, inner
            )  # fmt: skip
        if one_derivative[i]:
            multistep_step(state, rate, past, stage, total, i, length[i], numbers, elements)
        else:
            runge_kutta_step(
                state, rate, inputs, stage, total, drum, i, length[i], speed_rate, numbers, elements
            )  # fmt: skip
        angle, speed = zero + drum[2 * i + 2, 3], zero + drum[2 * i + 2, 0]
        follow_profile(state, angle, speed, elements.motor)


@law
def runge_kutta_step(
    state, rate, inputs, stage, total, drum, i, h, acceleration, numbers, elements
):
    """Advance the state by a step of the classical Runge-Kutta scheme of fourth order.

    Args:
        state, rate: State at the start of the step, advanced, and its time derivative there.
        inputs: Inputs of internal states at the start of the step; an array to work in.
        stage, total: Arrays to work in.
        drum, i: Motion of the drum, a field of a `Schedule`, and number of the step.
        h: Length of the step. [s]
        acceleration, numbers, elements: See `state_derivative`.
    """
    branches, begins = elements.mounts.branches, elements.begins
    size, first = begins.size, begins.stretch_inputs
    zero = 0.0 * acceleration
    masses = mass_properties(numbers, zero + drum[2 * i + 1, 1], zero + drum[2 * i + 1, 2])
    write_paths(rate, inputs, first, numbers, branches)
    for k in range(size):
        total[k] = state[k] + h / 6.0 * rate[k]
        stage[k] = state[k] + 0.5 * h * rate[k]
    for number in range(1, 4):
        node = 2 * i + (number + 1) // 2
        if number == 3:
            masses = mass_properties(numbers, zero + drum[node, 1], zero + drum[node, 2])
        follow_paths(stage, state, numbers, branches, None, first, h)
        state_derivative(
            stage, rate, inputs, masses, zero + drum[node, 0], acceleration, numbers, elements
        )
        write_paths(rate, inputs, first, numbers, branches)
        weight = h / 6.0 if number == 3 else h / 3.0
        ahead = h if number == 2 else 0.5 * h
        for k in range(size):
            total[k] = total[k] + weight * rate[k]
            stage[k] = state[k] + ahead * rate[k]
    follow_paths(total, state, numbers, branches, inputs, first, h)
    for k in range(size):
        state[k] = total[k]


@long_running
def derivative_lanes(x, dx, inputs, reference, acceleration, p, elements):
    """Evaluate `state_derivative` for `lanes.WIDTH` machines.

    Args:
        x: States; the drum's angle and rate are read from them.
        dx, inputs: Time derivatives and inputs of internal states, written.
        reference: Speed that the controller of a motor wants, the same for all machines. [rad/s]
        acceleration: Acceleration of a prescribed drum, the same for all machines. [rad/s^2]
        p: Packed numbers.
        elements: `Elements`, which all machines have in common.
    """
    align_stack()
    state, numbers = lane_array(x), lane_array(p)
    hold_masses(numbers, state, elements.begins.water, elements.water)
    sine, cosine = sine_cosine(state[DRUM_ANGLE])
    masses, zero = mass_properties(numbers, cosine, sine), 0.0 * state[0]
    state_derivative(
        state,
        lane_array(dx),
        lane_array(inputs),
        masses,
        target_speed(state, zero + reference, elements.motor),
        zero + acceleration,
        numbers,
        elements,
    )
