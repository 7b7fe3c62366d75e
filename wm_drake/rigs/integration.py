"""Steady motion of massless sponges on the bench: adaptive, stiff integration of many benches.

All benches of a call are one system of equations over the phase of their motion, states in units of
their amplitudes: one pass of LSODA in C instead of one per bench, which makes a fit to many loops
short. The Jacobian is diagonal. A sponge with mass is integrated by `wm_drake.rigs.heavy_sponge`.
"""

import warnings
from collections.abc import Callable

import numpy as np
from scipy.integrate import ODEintWarning, odeint

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.damper_law import damper_response
from wm_drake.errors import WmDrakeError
from wm_drake.parameters.types import FloatArray

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

TOLERANCES = {"rtol": 2e-8, "atol": 2e-9}
"""Tolerances of the integrator, in amplitudes."""


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
    rates = np.empty(len(packed))

    def derivative(phase: float, state: FloatArray) -> FloatArray:
        deformation_rates(phase, state, packed, amplitude, omega, rates)
        return rates

    def integrate(state: FloatArray, phases: FloatArray) -> FloatArray:
        with warnings.catch_warnings():
            warnings.simplefilter("error", ODEintWarning)
            try:
                found = odeint(
                    derivative,
                    state,
                    phases,
                    ml=0,
                    mu=0,
                    tfirst=True,
                    mxstep=200_000,
                    hmax=0.05,  # no stretch of slip is stepped over
                    **TOLERANCES,
                )
            except ODEintWarning as told:
                raise NotSteadyError(
                    f"a sponge on the bench cannot be integrated: {told}"
                ) from None
        if not np.all(np.isfinite(found)):
            raise NotSteadyError("a sponge on the bench runs away")
        return np.asarray(found)

    def period(state: FloatArray) -> FloatArray:
        parts = [state[None]]
        for piece in PIECES:
            parts.append(integrate(parts[-1][-1], PHASE[piece])[1:])
        return np.concatenate(parts)

    return closed_loop(period, np.zeros(len(packed)), STEADY, leaps=True)


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
        end = states[-1]
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
        before, state = (state, end), state + step
    raise NotSteadyError(f"no steady loop within {MOST_PERIODS} periods")


@long_running
def deformation_rates(phase, deformation, packed, amplitude, omega, rates):  # type: ignore[no-untyped-def]
    """Write the rates by phase of the deformations of massless sponges, both in amplitudes."""
    for i in range(len(amplitude)):
        speed = amplitude[i] * omega[i]
        _, rate = damper_response(
            speed * np.cos(phase), amplitude[i] * deformation[i], packed[i], 0
        )
        rates[i] = rate / speed
