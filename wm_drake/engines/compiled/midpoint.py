"""The midpoint rule for machines with telescopic dampers: one evaluation of the derivative a step.

The tubes of a damper are light bodies between stiff bushings: their own motions are much faster
than the tub, so that explicit steps must be short. The implicit midpoint rule has no such limit.
With positions q, velocities v, accelerations a(q, v) and q' = E(q) v, a step of length h has the
acceleration A that solves

    A = a(q + h/2 E (v + h/2 A), v + h/2 A)

Own derivation: one Newton step from the A of the step before, with a Jacobian that stays the same
for the whole run, of each damper for itself:

    A = A_before + R (a(q + h/2 E (v + h/2 A_before), v + h/2 A_before) - A_before)
    R = inverse of 1 - h/2 da/dv - h^2/4 da/dq E

The tub and the drum's carrier move slowly and have R = 1. A slow motion has the same A as with the
exact solution, to second order in h, whatever R is: R acts on the change of A only. Friction that
is steeper in R than at the moment does not act like additional mass. A sponge takes a midpoint step
under the predicted velocities.

The step needs no step before it but for A, so the corners of a profile need no start.
"""

from collections import namedtuple

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.lane_memory import aligned
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array
from wm_drake.compiler.matrices import solve
from wm_drake.elements.motion import BODY_STATE, TREE_STATE, rpy_rates
from wm_drake.elements.telescopic_damper import DEFORMATION, TUBES_STATE_SIZE
from wm_drake.engines.compiled.local_error import (
    DIFFERENCED,
    add_inner_peaks,
    add_peaks,
    add_second_difference,
    alike_before,
    steps_alike,
)
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    mass_properties,
    state_derivative,
    write_sample,
)
from wm_drake.engines.compiled.water import hold_masses

BODY, TUBES = 6, 7
"""Degrees of freedom of a floating body, and of the tubes of a damper."""
VELOCITIES = TREE_STATE.offsets["angular_velocity"]
"""Where the velocities of a `TREE_STATE` begin; its positions are before them, in this order."""
MOVING = (*range(TUBES), *range(VELOCITIES, VELOCITIES + TUBES))
"""Indices of the positions and velocities of the tubes of a damper, from where its state begins."""
CARRIER_VELOCITIES = BODY_STATE.offsets["angular_velocity"]

MidpointWork = namedtuple("MidpointWork", ("rate", "inputs", "middle", "past", "earlier", "change"))
"""Arrays to work in. `past` must stay from call to call: at the index of each velocity its A, at
that of each sponge the rate of its deformation; and `earlier`, the same of the step before it where
differences are taken."""


def midpoint_work(size, inputs):
    """Return the `MidpointWork` for states and inputs of these sizes."""
    sizes = (size, inputs, size, size, size, TUBES)
    return MidpointWork(*(aligned(count * WIDTH) for count in sizes))


@long_running
def integrate_midpoint_lanes(steps, begin, end, p, elements, relaxation, x, work, sums, history):
    """Advance `lanes.WIDTH` machines by steps of the midpoint rule.

    Args:
        steps: Length, drum acceleration, drum motion and sample number of each step, four fields
            of a `Schedule`; no arrays of lanes.
        begin, end: Numbers of steps.
        p: Packed numbers.
        elements: `Elements`, which all machines have in common; tubes is not None.
        relaxation: R of each telescopic damper, by rows.
        x: States; they are advanced.
        work: `MidpointWork`, the same from the first step to the last.
        sums: `wm_drake.engines.compiled.local_error.Sums` of the runs, advanced.
        history: Samples, as in `wm_drake.engines.compiled.integration`.
    """
    align_stack()
    numbers, state, samples = lane_array(p), lane_array(x), lane_array(history)
    rate, inputs, middle = lane_array(work.rate), lane_array(work.inputs), lane_array(work.middle)
    past, change, earlier = (
        lane_array(work.past), lane_array(work.change), lane_array(work.earlier)
    )  # fmt: skip
    matrices, errors = lane_array(relaxation), lane_array(sums)
    length, acceleration, drum, row = steps
    zero, alike = 0.0 * state[0], alike_before(begin, length, acceleration)
    for i in range(begin, end):
        alike = steps_alike(alike, i, length, acceleration)
        hold_masses(numbers, state, elements.begins.water, elements.water)
        if row[i] >= 0 or i == 0:
            masses = mass_properties(numbers, zero + drum[2 * i, 1], zero + drum[2 * i, 2])
            speed, speed_rate = zero + drum[2 * i, 0], zero + acceleration[i]
            state_derivative(state, rate, inputs, masses, speed, speed_rate, numbers, elements)
            if row[i] >= 0:
                write_sample(samples, row[i], state, rate, elements)
                add_peaks(errors, state, rate, True)
            if i == 0:
                for k in range(elements.begins.size):
                    past[k] = rate[k]
        h = length[i]
        predict_middle(state, middle, past, h, elements)
        node = 2 * i + 1
        masses = mass_properties(numbers, zero + drum[node, 1], zero + drum[node, 2])
        speed, speed_rate = zero + drum[node, 0], zero + acceleration[i]
        state_derivative(middle, rate, inputs, masses, speed, speed_rate, numbers, elements)
        add_peaks(errors, middle, rate, False)
        add_inner_peaks(errors, middle, h, elements.inner)
        add_second_difference(
            errors, rate, past, earlier, h, alike >= DIFFERENCED, elements.inner
        )  # fmt: skip
        advance(state, middle, rate, past, change, h, matrices, elements)
        state[DRUM_ANGLE] = zero + drum[2 * i + 2, 3]
        state[DRUM_RATE] = zero + drum[2 * i + 2, 0]


@law
def write_newton_matrix(jacobian, h, newton):
    """Write the inverse of R of a damper, 1 - h/2 da/dv - h^2/4 da/dq E, by rows.

    Args:
        jacobian: Of the states `MOVING`, by rows. (196,) [1/s]
        h: Length of a step. [s]
        newton: Written. (49,)
    """
    for row in range(TUBES):
        a = 2 * TUBES * (TUBES + row)
        for column in range(TUBES):
            total = (1.0 if row == column else 0.0) - 0.5 * h * jacobian[a + TUBES + column]
            for k in range(TUBES):
                e = jacobian[2 * TUBES * k + TUBES + column]
                total = total - 0.25 * h * h * jacobian[a + k] * e
            newton[TUBES * row + column] = total


@law
def write_relaxation(jacobian, h, newton, right, relaxation, at):
    """Write R of a damper by rows: its columns solve linear equations.

    Args:
        jacobian, h: As for `write_newton_matrix`.
        newton, right: Arrays to work in. (49,), (7,)
        relaxation, at: Array that is written, and where R begins.
    """
    for column in range(TUBES):
        write_newton_matrix(jacobian, h, newton)
        for row in range(TUBES):
            right[row] = 1.0 if row == column else 0.0
        solve(newton, right, TUBES)
        for row in range(TUBES):
            relaxation[at + TUBES * row + column] = right[row]


@law
def predict_middle(state, middle, past, h, elements):
    """Write the state in the middle of a step, with the accelerations of the step before.

    Args:
        state: State at the start of the step.
        middle: State, written.
        past: See `MidpointWork`.
        h: Length of the step. [s]
        elements: `Elements`.
    """
    predict_body(state, middle, past, 0, VELOCITIES, BODY, h)
    middle[DRUM_ANGLE], middle[DRUM_RATE] = state[DRUM_ANGLE], state[DRUM_RATE]
    begins = elements.begins
    for k in range(begins.sponges, begins.tubes):
        middle[k] = state[k] + 0.5 * h * past[k]
    for k in range(begins.elements, begins.size):
        middle[k] = state[k] + 0.5 * h * past[k]
    for i in range(len(elements.tubes)):
        at = begins.tubes + TUBES_STATE_SIZE * i
        predict_body(state, middle, past, at, VELOCITIES, TUBES, h)
        sponge = at + DEFORMATION
        middle[sponge] = state[sponge] + 0.5 * h * past[sponge]
    if elements.bearing is not None:
        at = begins.carrier
        predict_body(state, middle, past, at, CARRIER_VELOCITIES, BODY, h)


@law
def predict_body(state, middle, past, at, velocities, count, h):
    """Write the part of `predict_middle` of the body whose state begins at index `at`.

    Args:
        state, middle, past, h: As for `predict_middle`.
        at, velocities: Index where the body begins, and of its velocities from there.
        count: Number of its velocities.
    """
    for k in range(at, at + count):
        middle[velocities + k] = state[velocities + k] + 0.5 * h * past[velocities + k]
    move_body(state, middle, state, middle, at, velocities, count, 0.5 * h)


@law
def move_body(state, moved, angles, velocity, at, velocities, count, time):
    """Write the positions of a body after some time with constant velocities.

    Args:
        state: Positions before.
        moved: Positions after it, written.
        angles: State whose roll, pitch and yaw give the rates of the angles.
        velocity: State with the velocities.
        at, velocities, count: See `predict_body`.
        time: Time. [s]
    """
    first = at + velocities
    w = (velocity[first], velocity[first + 1], velocity[first + 2])
    rates = rpy_rates(w, sine_cosine(angles[at + 1]), sine_cosine(angles[at + 2]))
    for k in range(3):
        moved[at + k] = state[at + k] + time * rates[k]
    for k in range(3, count):
        moved[at + k] = state[at + k] + time * velocity[first + k]


@law
def advance(state, middle, rate, past, change, h, relaxation, elements):
    """Advance the state by a step and keep its accelerations.

    Args:
        state: State at the start of the step, advanced.
        middle, rate: Predicted state in the middle of the step, and its time derivative there.
        past: See `MidpointWork`; written.
        change: Array to work in.
        h: Length of the step. [s]
        relaxation: R of each telescopic damper, by rows.
        elements: `Elements`.
    """
    keep(past, rate, VELOCITIES, BODY)
    advance_body(state, middle, past, 0, VELOCITIES, BODY, h)
    begins = elements.begins
    for k in range(begins.sponges, begins.tubes):
        past[k] = rate[k]
        state[k] = state[k] + h * rate[k]
    for k in range(begins.elements, begins.size):
        past[k] = rate[k]
        state[k] = state[k] + h * rate[k]
    for i in range(len(elements.tubes)):
        at = begins.tubes + TUBES_STATE_SIZE * i
        relax(past, rate, change, at + VELOCITIES, relaxation, TUBES * TUBES * i)
        advance_body(state, middle, past, at, VELOCITIES, TUBES, h)
        sponge = at + DEFORMATION
        past[sponge] = rate[sponge]
        state[sponge] = state[sponge] + h * rate[sponge]
    if elements.bearing is not None:
        at = begins.carrier
        keep(past, rate, at + CARRIER_VELOCITIES, BODY)
        advance_body(state, middle, past, at, CARRIER_VELOCITIES, BODY, h)


@law
def keep(past, rate, first, count):
    """Keep the accelerations from index `first` as they were evaluated."""
    for k in range(first, first + count):
        past[k] = rate[k]


@law
def relax(past, rate, change, first, relaxation, at):
    """Take the Newton step of the accelerations of a damper, from index `first`.

    Args:
        past, rate, change: As for `advance`.
        first: Index of the first velocity.
        relaxation, at: Array that holds R, and where it begins.
    """
    for k in range(TUBES):
        change[k] = rate[first + k] - past[first + k]
    for row in range(TUBES):
        total = past[first + row]
        for column in range(TUBES):
            total = total + relaxation[at + TUBES * row + column] * change[column]
        past[first + row] = total


@law
def advance_body(state, middle, past, at, velocities, count, h):
    """Advance a body by a step with the accelerations in `past`; arguments as `predict_body`.

    The velocities in `middle` are replaced by those in the middle of the step.
    """
    for k in range(at + velocities, at + velocities + count):
        middle[k] = state[k] + 0.5 * h * past[k]
        state[k] = state[k] + h * past[k]
    move_body(state, state, middle, middle, at, velocities, count, h)
