"""What a run loses by its steps, summed while it is integrated; see docs/theory/integrator.md.

Own derivation. A step of length h adds an error of velocity that the differences of the
accelerations a at the starts of the last steps show, whatever made them rough:

    multistep      c h (a_0 - 4 a_1 + 6 a_2 - 4 a_3 + a_4),    c = 0.15, the constant of its error
    Runge-Kutta    the same with c = 0.05: a corner of a force within a step has an error of this
                   size; smooth motions have less (1/2880 to 1/120)
    midpoint       h/8 (A_0 - 2 A_1 + A_2), of a corner; smooth motions have h/24

Friction that passes its transition, a stop that is met and a spring that goes slack each make such
errors of either sign. They add up as squares over the time in which the motion forgets, `MEMORY`.
The error of a run is the largest root of these sums, by its largest velocity. Rotations count with
`LEVER`. Steps after a corner of the profile or of another length have no differences.
"""

from collections import namedtuple

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import where
from wm_drake.compiler.lanes import WIDTH
from wm_drake.elements.motion import TREE_STATE
from wm_drake.engines.trajectory import Estimates
from wm_drake.parameters.types import FloatArray

MEMORY = 0.5
"""Time in which a motion forgets a disturbance: damping ratios of some percent at 2 to 4 Hz. [s]"""

LEVER = 0.25
"""Distance from the drum axis at which a rotation is seen, the radius of a usual drum. [m]"""

OF_MULTISTEP, OF_RUNGE_KUTTA, OF_MIDPOINT = 0.15, 0.05, 0.125
"""Local errors by step and difference of accelerations."""

DIFFERENCED = 4
"""Number of steps of the same length that must lie before one whose differences are taken."""

Sums = namedtuple("Sums", ("recent", "worst", "speed", "in_steps", "in_samples", "past"))
"""Places of the sums of a run, one number a lane each: squares of local errors that are not yet
forgotten, and their largest sum [m^2/s^2]; largest square of the velocity at samples [m^2/s^2], and
of the acceleration at steps and at samples [m^2/s^4]; then accelerations of the last two steps of
the midpoint rule."""

SUMS = Sums(0, 1, 2, 3, 4, 5)
MOVING = 6
SUMS_SIZE = SUMS.past + 2 * MOVING
VELOCITIES = TREE_STATE.offsets["angular_velocity"]
"""Index in the state of the first of the `MOVING` velocities of the tub, rotations first."""


@law
def weighted_square(values, first):
    """Return the sum of squares of six components from an index on, rotations with `LEVER`."""
    total = 0.0 * values[first]
    for k in range(3):
        total = total + (LEVER * LEVER) * values[first + k] * values[first + k]
        total = total + values[first + 3 + k] * values[first + 3 + k]
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
def add_local_error(sums, square, h):
    """Add the square of a local error of velocity [m^2/s^2] of a step of length h [s]."""
    recent = sums[SUMS.recent] * (1.0 - h / MEMORY) + square
    sums[SUMS.recent] = recent
    sums[SUMS.worst] = larger(recent, sums[SUMS.worst])


@law
def add_fourth_difference(sums, rates, i, h, factor, size, count):
    """Add the local error of step i from the accelerations at the starts of the last steps.

    Args:
        sums: `Sums`.
        rates, size, count: Time derivatives of the last `count` steps, each of this size.
        i, h: Number of the step and its length. [s]
        factor: One of the constants above.
    """
    total = 0.0 * sums[SUMS.recent]
    for k in range(VELOCITIES, VELOCITIES + MOVING):
        a_0, a_1 = rates[i % count * size + k], rates[(i - 1) % count * size + k]
        a_2, a_3 = rates[(i - 2) % count * size + k], rates[(i - 3) % count * size + k]
        a_4 = rates[(i - 4) % count * size + k]
        difference = (a_0 + a_4) - 4.0 * (a_1 + a_3) + 6.0 * a_2
        weight = LEVER * LEVER if k < VELOCITIES + 3 else 1.0
        total = total + weight * difference * difference
    add_local_error(sums, (factor * h) * (factor * h) * total, h)


@law
def add_second_difference(sums, rate, i, h, is_counted):
    """Add the local error of step i of the midpoint rule, and keep its accelerations."""
    total = 0.0 * sums[SUMS.recent]
    for k in range(MOVING):
        before, earlier = SUMS.past + (i - 1) % 2 * MOVING + k, SUMS.past + i % 2 * MOVING + k
        difference = rate[VELOCITIES + k] - 2.0 * sums[before] + sums[earlier]
        weight = LEVER * LEVER if k < 3 else 1.0
        total = total + weight * difference * difference
        sums[earlier] = rate[VELOCITIES + k]
    if is_counted:
        add_local_error(sums, (OF_MIDPOINT * h) * (OF_MIDPOINT * h) * total, h)


@law
def steps_alike(before, i, begin, length, acceleration):
    """Return how many steps just before step i, from step `begin` on, are like it.

    Args:
        before: The same of the step before it.
        i, begin: Numbers of steps.
        length, acceleration: Of each step. [s, rad/s^2]
    """
    if i == begin or abs(length[i] - length[i - 1]) > 1e-9 * length[i]:
        return 0
    return before + 1 if acceleration[i] == acceleration[i - 1] else 0


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
