"""Periods of massless sponges by an explicit Runge-Kutta method, compiled.

The formula is that of Dormand and Prince of order 5 with an error estimate of order 4 and a
continuation of order 4 between the steps (Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I, II.5 and II.6); scipy holds its numbers. Each row steps as its own motion needs. A
stiff row is left to an implicit method.
"""

import numpy as np
from scipy.integrate import RK45

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.damper_law import damper_response

NODES, STAGES, WEIGHTS = RK45.C, RK45.A, RK45.B
ERROR, CONTINUATION = RK45.E, RK45.P
STAGE_COUNT = len(WEIGHTS)

MOST_STEPS = 1200
"""Most steps between two reversals; a row that needs more is stiff."""

FIRST_STEP = 1e-4
"""First step after a reversal. [rad]"""


@long_running
def sponge_rate(phase, deformation, packed, amplitude, speed):  # type: ignore[no-untyped-def]
    """Return the rate by phase of the deformation of a massless sponge, both in amplitudes.

    Args:
        phase: Of the motion. [rad]
        deformation: In amplitudes.
        packed: Packed law.
        amplitude, speed: Largest displacement and rate of the motion. [m, m/s]
    """
    return damper_response(speed * np.cos(phase), amplitude * deformation, packed, 0)[1] / speed


@long_running
def explicit_periods(rows, begin, packed, motion, reversals, phases, control, states, stiff):  # type: ignore[no-untyped-def]
    """Integrate rows over a period, except those that begin where they began before.

    Args:
        rows: First row, and the one after the last.
        begin: Deformation at the beginning of the period (r,), in amplitudes.
        packed: Packed laws (r, s).
        motion: Amplitude and angular frequency of each motion (r, 2). [m, rad/s]
        reversals: Indices of phases between which a piece is integrated, without the first.
        phases: Phases of the points of a period (n,). [rad]
        control: Relative and absolute tolerance, in amplitudes, and longest step. [-, -, rad]
        states: Deformations of the period before (r, n), in amplitudes; all are written.
        stiff: Whether a row needs too many steps (r,); such rows are not integrated.
    """
    slopes = np.empty(STAGE_COUNT + 1)
    for row in range(rows[0], rows[1]):
        if stiff[row] or states[row, 0] == begin[row]:
            continue
        states[row, 0] = begin[row]
        first = 0
        for last in reversals:
            stiff[row] = _is_stiff_piece(
                first, last, packed[row], motion[row], phases, control, states[row], slopes
            )
            if stiff[row]:
                states[row, 0] = np.nan  # this period is not integrated yet
                break
            first = last


@long_running
def _is_stiff_piece(first, last, packed, motion, phases, control, states, slopes):  # type: ignore[no-untyped-def]
    """Integrate from one point to another; return whether that takes too many steps."""
    amplitude, speed = motion[0], motion[0] * motion[1]
    phase, end, x = phases[first], phases[last], states[first]
    slopes[0] = sponge_rate(phase, x, packed, amplitude, speed)
    point, step = first + 1, FIRST_STEP
    for _ in range(MOST_STEPS):
        step = min(step, control[2], end - phase)
        new, error = _trial(phase, x, step, packed, amplitude, speed, slopes)
        error = abs(step * error) / (control[1] + control[0] * max(abs(x), abs(new)))
        if not error < np.inf:
            return True
        if error <= 1.0:
            while point < last and phases[point] <= phase + step:
                states[point] = x + step * _continued((phases[point] - phase) / step, slopes)
                point += 1
            if phase + step >= end:
                states[last] = new
                return False
            phase, x, slopes[0] = phase + step, new, slopes[STAGE_COUNT]
        step *= min(5.0, max(0.2, 0.9 * max(error, 1e-6) ** -0.2))
    return True


@long_running
def _trial(phase, x, step, packed, amplitude, speed, slopes):  # type: ignore[no-untyped-def]
    """Take a step from a phase; return the new state and the error of the step, by its length.

    Args:
        phase, x, step: Phase, state there, and step. [rad, amplitudes, rad]
        packed, amplitude, speed: As for `sponge_rate`.
        slopes: Rates of all stages; the first is given, the others are written.
    """
    for stage in range(1, STAGE_COUNT):
        moved = 0.0
        for k in range(stage):
            moved += STAGES[stage, k] * slopes[k]
        slopes[stage] = sponge_rate(
            phase + NODES[stage] * step, x + step * moved, packed, amplitude, speed
        )
    moved, error = 0.0, 0.0
    for k in range(STAGE_COUNT):
        moved += WEIGHTS[k] * slopes[k]
        error += ERROR[k] * slopes[k]
    new = x + step * moved
    slopes[STAGE_COUNT] = sponge_rate(phase + step, new, packed, amplitude, speed)
    return new, error + ERROR[STAGE_COUNT] * slopes[STAGE_COUNT]


@long_running
def _continued(part, slopes):  # type: ignore[no-untyped-def]
    """Return the change of the state after a part of a step, by the step."""
    value = 0.0
    for k in range(STAGE_COUNT + 1):
        c = CONTINUATION[k]
        value += slopes[k] * (((c[3] * part + c[2]) * part + c[1]) * part + c[0]) * part
    return value
