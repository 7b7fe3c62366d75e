"""Steady motion of sponges on the bench: adaptive, stiff integration of many benches at once.

All benches of a call are one system of equations over the phase of their motion, states in units of
their amplitudes: one pass of LSODA in C instead of one per bench, which makes a fit to many loops
short. The Jacobian is a band.
"""

import warnings
from collections.abc import Callable

import numpy as np
from scipy.integrate import ODEintWarning, odeint

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.damper_law import damper_response, sponge_with_mass
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

TOLERANCES = {1: {"rtol": 2e-8, "atol": 2e-9}, 2: {"rtol": 1e-6, "atol": 1e-6}}
"""Tolerances by the number of states of a bench, in amplitudes. With a mass, MSTV friction jumps by
f_max epsilon / |u| as the sponge begins to slip: integrators chatter or break down at tighter
ones."""


class NotSteadyError(WmDrakeError):
    """Error of a bench whose motion does not become steady, or cannot be integrated."""


def steady_states(
    packed: FloatArray, mass: FloatArray, amplitude: FloatArray, omega: FloatArray, size: int
) -> FloatArray:
    """Return the states of benches over one steady period.

    Args:
        packed: Law number and parameters of a damper with sponge (r, s).
        mass: Mass of each sponge (r,). [kg]
        amplitude, omega: Amplitude and angular frequency of each motion (r,). [m, rad/s]
        size: States of each bench: 1, the deformation, or with mass 2, position and velocity of the
            sponge.

    Returns:
        (POINTS + 1, r, size); deformation and position in amplitudes, velocity in amplitude times
        omega.

    Raises:
        NotSteadyError: The motion is not steady within `MOST_PERIODS`, or cannot be integrated.
    """
    rows = len(packed)
    rates = np.empty(rows * size)

    def derivative(phase: float, state: FloatArray) -> FloatArray:
        if size == 1:
            deformation_rates(phase, state, packed, amplitude, omega, rates)
        else:
            sponge_rates(phase, state, packed, mass, amplitude, omega, rates)
        return rates

    def integrate(state: FloatArray, phases: FloatArray) -> FloatArray:
        with warnings.catch_warnings():
            warnings.simplefilter("error", ODEintWarning)
            try:
                found = odeint(
                    derivative,
                    state,
                    phases,
                    ml=size - 1,
                    mu=size - 1,
                    tfirst=True,
                    mxstep=200_000,
                    hmax=0.05,  # no stretch of slip is stepped over
                    **TOLERANCES[size],
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

    closed = _closed_loop(
        period, np.zeros(rows * size), max(STEADY, 10.0 * TOLERANCES[size]["atol"]), leap=size == 1
    )
    return closed.reshape(POINTS + 1, rows, size)


def _closed_loop(
    period: Callable[[FloatArray], FloatArray], state: FloatArray, tolerance: float, *, leap: bool
) -> FloatArray:
    """Repeat periods until one ends where it began.

    With `leap`, for states that do not act on each other, each leaps to where the secant through
    its last two periods closes (Aitken's delta-squared): a sponge that creeps towards its steady
    place over hundreds of periods is there in a few. The ends of a scalar equation keep the order
    of its beginnings, so the secant has a slope of 0 to 1.
    """
    before: tuple[FloatArray, FloatArray] | None = None
    for _ in range(MOST_PERIODS):
        states = period(state)
        end = states[-1]
        slope = np.zeros(len(state))
        if leap and before is not None:
            moved = state - before[0]
            safe = np.where(np.abs(moved) > 0.0, moved, 1.0)
            slope = np.where(
                np.abs(moved) > tolerance, np.clip((end - before[1]) / safe, 0.0, 1.0 - 1e-3), 0.0
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


@long_running
def sponge_rates(phase, state, packed, mass, amplitude, omega, rates):  # type: ignore[no-untyped-def]
    """Write the rates by phase of position and velocity of sponges with mass."""
    for i in range(len(amplitude)):
        speed = amplitude[i] * omega[i]
        y, v = amplitude[i] * np.sin(phase), speed * np.cos(phase)
        x, w = amplitude[i] * state[2 * i], speed * state[2 * i + 1]
        _, force = sponge_with_mass(y - x, v - w, w, packed[i], 0)
        rates[2 * i] = state[2 * i + 1]
        rates[2 * i + 1] = force / (mass[i] * speed * omega[i])
