"""What a run loses by its steps, summed while it is integrated; see docs/theory/integrator.md.

Own derivation. A step of length h adds an error of velocity that the differences of the
accelerations a at the starts of the last steps show, whatever made them rough:

    multistep      c h (a_0 - 4 a_1 + 6 a_2 - 4 a_3 + a_4),    c = 0.15, the constant of its error
    Runge-Kutta    the same with c = 0.05: a corner of a force within a step has an error of this
                   size; smooth motions have less (1/2880 to 1/120)
    midpoint       h/8 (A_0 - 2 A_1 + A_2), of a corner; smooth motions have h/24

Friction that passes its transition, a stop that is met and a spring that goes slack each make such
errors of either sign. They add up as squares over the time in which the motion forgets, `MEMORY`.
The midpoint rule is of second order: its errors are errors of phase of one sign and add up as
sizes. The error of a run is the largest of these sums, by its largest velocity. Rotations count
with `LEVER`. Steps after a corner of the profile or of another length have no differences.

Inner bodies: an element may have velocities among its states, as the balls of a ring have. A share
e/s of their motion that is wrong, s their largest velocity within the memory, makes that share of
their force on the tub wrong, and at most that share of the tub's velocity v within the memory. So
each of their local errors e, from the same differences, counts as an error e v/s of the tub. Other
inner states, as deformations of sponges and rubber, have no inertia: what they lose makes the
accelerations of the bodies rough on which they act.
"""

from collections import namedtuple

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt, where
from wm_drake.compiler.lanes import WIDTH
from wm_drake.elements.motion import TREE_STATE
from wm_drake.engines.trajectory import Estimates
from wm_drake.parameters.types import FloatArray

MEMORY = 0.5
"""Time in which a motion forgets a disturbance: damping ratios of some percent at 2 to 4 Hz. [s]"""

LEVER = 0.25
"""Distance from the drum axis at which a rotation is seen, the radius of a usual drum. [m]"""

OF_MULTISTEP, OF_RUNGE_KUTTA, OF_MIDPOINT = 0.15, 0.05, 0.25
"""Local errors by step and difference of accelerations."""

OF_INNER = 2.0
"""Weight of errors of inner bodies."""

DIFFERENCED = 4
"""Number of steps of the same length that must lie before one whose differences are taken."""

EVERY = 4
"""Fourth differences are taken at every fourth step and stand for four: a contact or a transition
of friction that a step does not resolve makes the steps after it rough too."""

Sums = namedtuple(
    "Sums", ("recent", "worst", "speed", "in_steps", "in_samples", "tub_near", "inner_near")
)
"""Places of the sums of a run, one number a lane each: local errors that are not yet forgotten,
squares [m^2/s^2] or sizes [m/s], and the square of their largest sum [m^2/s^2]; largest square of
the velocity at samples [m^2/s^2], and of the acceleration at steps and at samples [m^2/s^4];
largest squares within the memory of the velocities of tub and inner bodies [m^2/s^2]."""

SUMS = Sums(*range(7))
MOVING = 6
SUMS_SIZE = len(SUMS)
InnerVelocities = namedtuple("InnerVelocities", ("at", "levers"))
"""Velocities of inner bodies: index of each in the state, and the distance in which a rate of
rotation is seen [m], 1 for a velocity."""

VELOCITIES = TREE_STATE.offsets["angular_velocity"]
"""Index in the state of the first of the `MOVING` velocities of the tub, rotations first."""


@law
def weighted_square(values, first):
    """Return the sum of squares of six components from an index on, rotations with `LEVER`."""
    total = 0.0 * values[first]
    for k in range(3):
        turned, moved = LEVER * values[first + k], values[first + 3 + k]
        total = total + (turned * turned + moved * moved)
    return total


@law
def larger(a, b):
    """Return the larger one of two numbers; the second one if one is not a number."""
    return where(a > b, a, b)


@law
def add_peaks(sums, state, rate, is_sample):
    """Add the motion at the start of a step: state and its time derivative."""
    square = weighted_square(rate, VELOCITIES)
    sums[SUMS.in_steps] = larger(square, sums[SUMS.in_steps])
    if is_sample:
        sums[SUMS.in_samples] = larger(square, sums[SUMS.in_samples])
        speed = weighted_square(state, VELOCITIES)
        sums[SUMS.speed] = larger(speed, sums[SUMS.speed])


@law
def add_inner_peaks(sums, state, h, inner):
    """Add the velocities of tub and inner bodies before a step of length h [s]."""
    if inner is None:
        return
    kept = 1.0 - h / MEMORY
    tub = weighted_square(state, VELOCITIES)
    sums[SUMS.tub_near] = larger(tub, kept * sums[SUMS.tub_near])
    for j in range(len(inner.at)):
        square = inner.levers[j] * state[inner.at[j]]
        sums[SUMS.inner_near] = larger(square * square, kept * sums[SUMS.inner_near])


@law
def add_square(sums, square, h):
    """Add the square of a local error of velocity [m^2/s^2] of a step of length h [s]."""
    recent = sums[SUMS.recent] * (1.0 - h / MEMORY) + square
    sums[SUMS.recent] = recent
    sums[SUMS.worst] = larger(recent, sums[SUMS.worst])


@law
def add_size(sums, square, h):
    """Add the size of a local error; arguments as for `add_square`."""
    recent = sums[SUMS.recent] * (1.0 - h / MEMORY) + sqrt(square)
    sums[SUMS.recent] = recent
    sums[SUMS.worst] = larger(recent * recent, sums[SUMS.worst])


@law
def fourth_difference(rates, begins, k):
    """Return the fourth difference of rate k; begins: of the last five steps, newest first."""
    begin, begin_1, begin_2, begin_3, begin_4 = begins
    outer, inner = rates[begin + k] + rates[begin_4 + k], rates[begin_1 + k] + rates[begin_3 + k]
    return (outer - 4.0 * inner) + 6.0 * rates[begin_2 + k]


@law
def as_of_tub(sums, square):
    """Return the square of an error of inner bodies as one of the tub. [m^2/s^2]"""
    near = sums[SUMS.inner_near]
    return OF_INNER * OF_INNER * square * sums[SUMS.tub_near] / where(near > 0.0, near, 1.0 + near)


@law
def add_fourth_difference(sums, rates, i, h, factor, size, count, inner):
    """Add the local error of step i from the accelerations at the starts of the last steps.

    Args:
        sums: `Sums`.
        rates, size, count: Time derivatives of the last `count` steps, each of this size.
        i, h: Number of the step and its length. [s]
        factor: One of the constants above.
        inner: `InnerVelocities`, None without any.
    """
    begins = (
        i % count * size,
        (i - 1) % count * size,
        (i - 2) % count * size,
        (i - 3) % count * size,
        (i - 4) % count * size,
    )
    total = 0.0 * sums[SUMS.recent]
    for k in range(3):
        turned = LEVER * fourth_difference(rates, begins, VELOCITIES + k)
        moved = fourth_difference(rates, begins, VELOCITIES + 3 + k)
        total = total + (turned * turned + moved * moved)
    if inner is not None:
        of_inner = 0.0 * total
        for j in range(len(inner.at)):
            difference = inner.levers[j] * fourth_difference(rates, begins, inner.at[j])
            of_inner = of_inner + difference * difference
        total = total + as_of_tub(sums, of_inner)
    add_square(sums, EVERY * (factor * h) * (factor * h) * total, EVERY * h)


@law
def add_second_difference(sums, rate, before, earlier, h, is_counted, inner):
    """Add the local error of a step of the midpoint rule, and keep its accelerations.

    Args:
        sums, h, inner: As for `add_fourth_difference`.
        rate, before, earlier: Time derivatives of this step and of the two before it; the earlier
            one is replaced by the one before.
        is_counted: Whether these steps are alike.
    """
    total = 0.0 * sums[SUMS.recent]
    for k in range(VELOCITIES, VELOCITIES + MOVING):
        difference = rate[k] - 2.0 * before[k] + earlier[k]
        weight = LEVER * LEVER if k < VELOCITIES + 3 else 1.0
        total = total + weight * difference * difference
        earlier[k] = before[k]
    if inner is not None:
        of_inner = 0.0 * total
        for j in range(len(inner.at)):
            k = inner.at[j]
            difference = inner.levers[j] * (rate[k] - 2.0 * before[k] + earlier[k])
            of_inner = of_inner + difference * difference
            earlier[k] = before[k]
        total = total + as_of_tub(sums, of_inner)
    if is_counted:
        add_size(sums, (OF_MIDPOINT * h) * (OF_MIDPOINT * h) * total, h)


@law
def steps_alike(before, i, length, acceleration):
    """Return how many steps just before step i are like it.

    Args:
        before: The same of the step before it.
        i: Number of the step.
        length, acceleration: Of each step. [s, rad/s^2]
    """
    if i == 0 or abs(length[i] - length[i - 1]) > 1e-9 * length[i]:
        return 0
    return before + 1 if acceleration[i] == acceleration[i - 1] else 0


@law
def alike_before(begin, length, acceleration):
    """Return `steps_alike` of the step before `begin`, as far as differences need it."""
    alike = 0
    for i in range(max(begin - DIFFERENCED, 0), begin):
        alike = steps_alike(alike, i, length, acceleration)
    return alike


def estimates_of(sums: FloatArray) -> list[Estimates]:
    """Return the estimated errors of runs side by side from their sums. (WIDTH)"""
    by_lane = sums.reshape(-1, WIDTH)
    with np.errstate(invalid="ignore", divide="ignore"):
        steps = np.sqrt(by_lane[SUMS.worst] / by_lane[SUMS.speed])
        samples = 1.0 - np.sqrt(by_lane[SUMS.in_samples] / by_lane[SUMS.in_steps])
    return [
        Estimates(float(of_steps), float(of_samples))
        for of_steps, of_samples in zip(
            np.nan_to_num(steps, posinf=0.0), np.nan_to_num(samples), strict=True
        )
    ]
