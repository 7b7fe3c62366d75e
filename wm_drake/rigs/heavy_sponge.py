"""Steady motion of a sponge with mass on the bench: implicit Euler with one scalar balance a step.

The stick friction of MSTV is a dashpot f_max / |u| that grows without limit towards a reversal, and
its force jumps where the sponge begins to slip: integrators with error control chatter there.
Implicit Euler is stable at any step. Each step solves one balance in closed form. The loops of two
steps, one half of the other, are extrapolated to a step of zero.
"""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.damper_law import sponge_with_mass
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.rigs.bench import DamperBench, Harmonic
from wm_drake.rigs.integration import POINTS, STEADY, NotSteadyError, closed_loop

MASS, LENGTH = Unit("kg", "g"), Unit("m", "mm")

FEWEST_STEPS, MOST_STEPS = 8, 2048
"""Steps between two points of a loop at first, and at most."""

AGREEMENT = 2e-6
"""Root mean square difference of two extrapolated loops that agree, as a part of the largest force.
A point at a reversal, where the force nearly jumps, may differ by a hundred times as much."""


def steady_tensions(bench: DamperBench, motion: Harmonic) -> FloatArray:
    """Return the tension of a damper whose sponge has a mass over one steady period. [N]

    The number of steps is doubled until two extrapolated loops agree.

    Args:
        bench: The damper; the mass of its sponge is > 0.

    Returns:
        (POINTS,) at the phases `PHASE` without the last.

    Raises:
        NotSteadyError: The motion is not steady, or the loops do not agree.
    """
    steps = FEWEST_STEPS
    coarse, begin = _steady_loop(bench, motion, steps, np.zeros(2))
    last: FloatArray | None = None
    while steps < MOST_STEPS:
        steps *= 2
        fine, begin = _steady_loop(bench, motion, steps, begin)
        extrapolated = 2.0 * fine - coarse
        if last is not None:
            limit = AGREEMENT * float(np.max(np.abs(extrapolated)))
            if float(np.sqrt(np.mean(np.square(extrapolated - last)))) <= limit:
                return np.asarray(extrapolated)
        coarse, last = fine, extrapolated
    raise NotSteadyError(
        f"a sponge of {MASS.reading(bench.sponge_mass)} at {motion.frequency:g} Hz, "
        f"{LENGTH.reading(motion.amplitude)}: loops of {steps // 2} and {steps} steps between two "
        f"points do not agree to {AGREEMENT:g} of the largest force; take another sponge mass, or "
        "none"
    )


def _steady_loop(
    bench: DamperBench, motion: Harmonic, steps: int, begin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return tensions of a steady period [N] and the state of the sponge at its beginning.

    The state is the position in amplitudes and the velocity in amplitudes times omega. The position
    creeps, the velocity follows it at once, so the position leaps.
    """
    tension, states = np.empty(POINTS + 1), np.empty((POINTS + 1, 2))
    size = motion.amplitude, motion.angular_frequency

    def period(state: FloatArray) -> FloatArray:
        states[0] = state
        sponge_period(states, tension, bench.packed, bench.sponge_mass, *size, steps)
        if not np.all(np.isfinite(states)):
            raise NotSteadyError("a sponge on the bench runs away")
        return states.copy()

    closed = closed_loop(period, begin, STEADY, leaps=np.array([True, False]))
    return np.concatenate([tension[-1:], tension[1:-1]]), closed[0]


@long_running
def sponge_period(states, tension, packed, mass, amplitude, omega, steps):  # type: ignore[no-untyped-def]
    """Integrate a sponge with mass over a period.

    Args:
        states: Position and velocity (POINTS + 1, 2), in amplitudes and amplitudes times omega; the
            first is given, the others are written.
        tension: Tensions (POINTS + 1,), all but the first are written. [N]
        packed: Packed law.
        mass: Mass of the sponge. [kg]
        amplitude, omega: Amplitude and angular frequency of the motion. [m, rad/s]
        steps: Steps between two points.
    """
    speed = amplitude * omega
    position, velocity = amplitude * states[0, 0], speed * states[0, 1]
    count = (len(tension) - 1) * steps
    step = 2.0 * np.pi / (omega * count)
    for k in range(count):
        phase = 2.0 * np.pi * (k + 1) / count
        cosine = np.cos(phase)
        rate = 0.0 if abs(cosine) < 1e-12 else speed * cosine  # zero at a reversal
        force, velocity = sponge_with_mass(
            amplitude * np.sin(phase) - position, rate, velocity, step, mass, packed, 0
        )
        position += step * velocity
        if (k + 1) % steps == 0:
            point = (k + 1) // steps
            tension[point] = force
            states[point, 0], states[point, 1] = position / amplitude, velocity / speed
