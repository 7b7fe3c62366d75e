"""Forces of a component whose driven end moves as it was recorded.

A massless sponge is integrated by an L-stable diagonally implicit Runge-Kutta method of order 2
(SDIRK2, gamma = 1 - 1/sqrt(2)): its rate may be stiff without limit, where friction sticks. Each
stage is one balance of a scalar that grows with slope 1 or more, so its root is bracketed at once.
"""

import math

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.damper_law import damper_response
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import Bench, BushingBench, DamperBench
from wm_drake.rigs.forces import damper_tensions, recorded_loads
from wm_drake.rigs.integration import NotSteadyError, closed_loop
from wm_drake.rigs.measured import RecordedMotion

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)

RESOLVED = 1e-12
"""Width of a bracket at which a deformation is known. [m]"""

STEADY = 1e-8
"""A period repeats the one before if the deformation differs by no more, in strokes."""


def recorded_forces(bench: Bench, motion: RecordedMotion) -> FloatArray:
    """Return the force or moment at the samples of a recorded motion (n,). [N; N m]

    A sponge begins without deformation. If the motion repeats itself, it begins in the steady state
    of the first period; where none is reached, without deformation too.

    Args:
        bench: Component on the bench, without a sponge that has mass.
    """
    if isinstance(bench, BushingBench):
        return recorded_loads(bench, motion)
    deformation: FloatArray = np.zeros(len(motion.step_rate))
    if bench.state_size:
        deformation = recorded_deformation(bench, motion)
    rate = motion.step_rate[motion.samples]
    return np.asarray(damper_tensions(rate, deformation[motion.samples], bench.packed))


def recorded_deformation(bench: DamperBench, motion: RecordedMotion) -> FloatArray:
    """Return the deformation of a massless sponge at the ends of all steps (k + 1,). [m]"""
    begin = 0.0
    if motion.repeats:
        step, rate = motion.step[: motion.repeats], motion.step_rate[: motion.repeats + 1]

        def period(state: FloatArray) -> FloatArray:
            deformation = np.empty(len(rate))
            integrate_sponge(step, rate, state[0], bench.packed, deformation)
            return deformation[:, None]

        try:
            steady = closed_loop(
                period, np.zeros(1), STEADY * motion.stroke + 2.0 * RESOLVED, leaps=True
            )
            begin = float(steady[0, 0])
        except NotSteadyError:
            begin = 0.0
    deformation = np.empty(len(motion.step_rate))
    integrate_sponge(motion.step, motion.step_rate, begin, bench.packed, deformation)
    return deformation


@long_running
def integrate_sponge(step, rate, begin, packed, deformation):  # type: ignore[no-untyped-def]
    """Integrate the deformation of a massless sponge; rates are linear within a step.

    Args:
        step: Durations (k,). [s]
        rate: Rates of elongation at the ends of the steps (k + 1,). [m/s]
        begin: Deformation at the beginning. [m]
        packed: Packed law.
        deformation: Deformations at the ends of the steps (k + 1,), all are written. [m]
    """
    deformation[0] = begin
    for k in range(len(step)):
        h = GAMMA * step[k]
        here = deformation[k]
        early = rate[k] + GAMMA * (rate[k + 1] - rate[k])
        stage = implicit_deformation(here, here, h, early, packed)
        moved = (stage - here) / GAMMA
        base = here + (1.0 - GAMMA) * moved
        deformation[k + 1] = implicit_deformation(base, here + moved, h, rate[k + 1], packed)


@long_running
def implicit_deformation(base, guess, h, rate, packed):  # type: ignore[no-untyped-def]
    """Solve x = base + h x'(x) for the deformation x, by regula falsi (Illinois).

    x' falls with x, so the balance x - base - h x' grows with a slope of 1 or more: its root lies
    no farther from a point than the balance there.

    Args:
        base, guess: What is known of x, and where to begin. [m]
        h: Step. [s]
        rate: Rate of elongation. [m/s]
        packed: Packed law.
    """
    left = guess
    at_left = left - base - h * damper_response(rate, left, packed, 0)[1]
    if abs(at_left) <= RESOLVED:
        return left - at_left
    right = left - at_left
    at_right = right - base - h * damper_response(rate, right, packed, 0)[1]
    for _ in range(100):
        if abs(right - left) <= RESOLVED or at_right == 0.0:
            break
        middle = right - at_right * (right - left) / (at_right - at_left)
        value = middle - base - h * damper_response(rate, middle, packed, 0)[1]
        if value * at_right < 0.0:
            left, at_left = right, at_right
        else:
            at_left = 0.5 * at_left
        right, at_right = middle, value
        if abs(value) <= RESOLVED:
            break
    return right
