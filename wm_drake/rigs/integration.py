"""Steady motion of massless sponges on the bench: adaptive integration of many benches.

Each bench is an equation of one state over the phase of its motion, in units of its amplitude. An
explicit method integrates it (`wm_drake.rigs.explicit_steps`), in threads. Stiff ones, few, are one
system for LSODA, with a diagonal Jacobian. A sponge with mass is integrated by
`wm_drake.rigs.heavy_sponge`.
"""

import itertools
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.integrate import ODEintWarning, odeint

from wm_drake.compiler.compilation import long_running
from wm_drake.errors import WmDrakeError
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.explicit_steps import explicit_periods, sponge_rate

POINTS = 1440
"""Points of a period, equally spaced; reversals fall on points."""

PHASE = 2.0 * np.pi * np.arange(POINTS + 1) / POINTS
PIECES = (
    slice(0, POINTS // 4 + 1),
    slice(POINTS // 4, 3 * POINTS // 4 + 1),
    slice(3 * POINTS // 4, POINTS + 1),
)
"""Pieces of `PHASE` from reversal to reversal of the driven end, where friction has a corner: the
integrator begins anew there."""

MOST_PERIODS = 200
STEADY = 1e-7
"""A period repeats the one before if no state differs by more, in amplitudes."""

EXPLICIT_TOLERANCES = (2e-10, 2e-11)
"""Relative and absolute tolerance of the explicit method, in amplitudes. It steps over the corners
of friction, where the error of a step is larger than its estimate: these keep it below 2e-8."""

LONGEST_STEP = 0.05
"""Longest step: no stretch of slip is stepped over. [rad]"""

LSODA = {"rtol": 2e-8, "atol": 2e-9, "hmax": LONGEST_STEP, "mxstep": 200_000, "ml": 0, "mu": 0}
"""Options of LSODA: tolerances in amplitudes, longest step, most steps, diagonal Jacobian."""

MOST_STIFF = 32
"""Stiff benches that are one system: all step as the stiffest one needs."""

FEWEST_ROWS = 8
"""Fewest benches that are worth a thread."""


class NotSteadyError(WmDrakeError):
    """Error of a bench whose motion does not become steady, or cannot be integrated."""


def steady_states(packed: FloatArray, amplitude: FloatArray, omega: FloatArray) -> FloatArray:
    """Return the deformations of massless sponges over one steady period.

    Args:
        packed: Law number and parameters of a damper with sponge (r, s).
        amplitude, omega: Amplitude and angular frequency of each motion (r,). [m, rad/s]

    Returns:
        (POINTS + 1, r), in amplitudes.

    Raises:
        NotSteadyError: The motion is not steady within `MOST_PERIODS`, or cannot be integrated.
    """
    count = len(packed)
    motion = np.stack([amplitude, omega], axis=1)
    states, stiff = np.full((count, POINTS + 1), np.nan), np.zeros(count, dtype=bool)
    reversals = np.array([piece.stop - 1 for piece in PIECES])
    control = np.array([*EXPLICIT_TOLERANCES, LONGEST_STEP])
    threads = min(os.cpu_count() or 1, -(-count // FEWEST_ROWS))
    ends = np.linspace(0, count, threads + 1, dtype=int)

    def integrate(begin: FloatArray, rows: tuple[int, int]) -> None:
        explicit_periods(rows, begin, packed, motion, reversals, PHASE, control, states, stiff)

    with ThreadPoolExecutor(threads) as pool:

        def period(begin: FloatArray) -> FloatArray:
            list(pool.map(lambda rows: integrate(begin, rows), itertools.pairwise(ends)))
            left = np.flatnonzero(stiff & (states[:, 0] != begin))
            for at in range(0, len(left), MOST_STIFF):
                rows = left[at : at + MOST_STIFF]
                states[rows] = stiff_period(begin[rows], packed[rows], motion[rows]).T
            return states.T

        return closed_loop(period, np.zeros(count), STEADY, leaps=True)


def stiff_period(begin: FloatArray, packed: FloatArray, motion: FloatArray) -> FloatArray:
    """Return the deformations of sponges over a period by LSODA (POINTS + 1, r), in amplitudes.

    Args:
        begin: At its beginning (r,).
        packed, motion: As for `explicit_periods`.

    Raises:
        NotSteadyError: They cannot be integrated.
    """
    rates = np.empty(len(packed))

    def derivative(phase: float, state: FloatArray) -> FloatArray:
        deformation_rates(phase, state, packed, motion, rates)
        return rates

    parts = [begin[None]]
    for piece in PIECES:
        with warnings.catch_warnings():
            warnings.simplefilter("error", ODEintWarning)
            try:
                begin_of_piece = parts[-1][-1]
                solution = odeint(derivative, begin_of_piece, PHASE[piece], tfirst=True, **LSODA)
            except ODEintWarning as warning:
                raise NotSteadyError(
                    f"a sponge on the bench cannot be integrated: {warning}"
                ) from None
        if not np.all(np.isfinite(solution)):
            raise NotSteadyError("a sponge on the bench runs away")
        parts.append(solution[1:])
    return np.concatenate(parts)


def closed_loop(
    period: Callable[[FloatArray], FloatArray],
    state: FloatArray,
    tolerance: float,
    *,
    leaps: bool | np.ndarray,
) -> FloatArray:
    """Repeat periods until one ends where it began, and return its states (points, n).

    States that creep leap to where the secant through their last two periods closes (Aitken's
    delta-squared): a sponge that creeps towards its steady place over hundreds of periods is there
    in a few. The ends of a scalar equation keep the order of its beginnings, so the secant has a
    slope of 0 to 1.

    Args:
        period: Function of the state at the beginning of a period that returns all of its states.
        state: First state (n,).
        tolerance: Largest change of a state in a steady period.
        leaps: Which states leap: those that no other state acts on.

    Raises:
        NotSteadyError: The motion is not steady within `MOST_PERIODS`.
    """
    before: tuple[FloatArray, FloatArray] | None = None
    for _ in range(MOST_PERIODS):
        states = period(state)
        end = states[-1].copy()
        slope = np.zeros(len(state))
        if before is not None:
            moved = state - before[0]
            safe = np.where(np.abs(moved) > 0.0, moved, 1.0)
            slope = np.where(
                leaps & (np.abs(moved) > tolerance),
                np.clip((end - before[1]) / safe, 0.0, 1.0 - 1e-3),
                0.0,
            )
        change = end - state
        step = np.where(
            np.abs(change) > tolerance, change / (1.0 - slope), change
        )  # below it, a change is that of integration
        if np.max(np.abs(step)) <= tolerance:
            return states
        # a state that is closed stays, so that its period need not be computed again
        moving = np.logical_not(leaps) | (np.abs(step) > tolerance)
        before, state = (state, end), np.where(moving, state + step, state)
    raise NotSteadyError(f"no steady loop within {MOST_PERIODS} periods")


@long_running
def deformation_rates(phase, deformation, packed, motion, rates):  # type: ignore[no-untyped-def]
    """Write the rates by phase of the deformations of massless sponges, both in amplitudes."""
    for i in range(len(motion)):
        amplitude = motion[i, 0]
        rates[i] = sponge_rate(
            phase, deformation[i], packed[i], amplitude, amplitude * motion[i, 1]
        )
