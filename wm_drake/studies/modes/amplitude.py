"""Modes that depend on the amplitude, by harmonic balance of the free motion.

With friction, frequency and damping depend on the amplitude. The extended periodic motion concept
(Krack, Nonlinear modal analysis of nonconservative systems, Computers and Structures 154, 2015)
makes the free motion periodic with a negative damping in proportion to the mass, which balances the
dissipation of a cycle:

    x' = f(x) + 2 beta v        omega: frequency,  beta / omega: damping ratio

v: all velocities. Harmonic balance gives the periodic motion with the forces of all elements
themselves, over a cycle; equivalent stiffness and damping are what they do in it. For a linear
machine with damping in proportion to mass and stiffness it is the natural mode.
"""

import warnings
from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve

from wm_drake.model.machine import Setup
from wm_drake.parameters.types import ComplexArray, FloatArray
from wm_drake.report.labelled import rows_of
from wm_drake.studies.modes import quantities as q
from wm_drake.studies.modes.data import oscillation
from wm_drake.studies.modes.linearisation import Spectrum
from wm_drake.studies.response.balance import HarmonicBalance
from wm_drake.studies.response.series import Series
from wm_drake.studies.threads import on_one_thread

SMALLEST_AMPLITUDE = 1e-5
"""Amplitude at which a mode is followed from its linearisation with stuck friction. [m]"""

ORDER, SAMPLES = 5, 64
"""Number of harmonics and samples of a cycle."""

TOLERANCE = 1e-6
"""Largest last correction, as part of the amplitude."""

FIRST_FACTOR, LEAST_FACTOR = 1.5, 1.05
"""First and smallest ratio of two amplitudes of a step."""


@on_one_thread
def amplitude_modes(
    setup: Setup, stuck: Spectrum, names: Sequence[str], amplitudes: FloatArray
) -> xr.Dataset:
    """Follow each stuck mode over its amplitude.

    Args:
        names: Names of the modes.
        amplitudes: Rising amplitudes at which values are wanted; steps between them are as short as
            convergence needs. [m]

    Returns:
        Over `row`, with the label `mode`: `amplitude`, root of the sum of squares of the first
        harmonics of the coordinates of To, with angles times 0.25 m [m]; it rises and ends where
        the mode cannot be followed any further. `frequency` [Hz] and `damping_ratio` there.
    """
    balance = HarmonicBalance(setup, Series(ORDER, SAMPLES))
    every = [
        _follow(balance, value, vector, amplitudes)
        for value, vector in zip(stuck.values, stuck.right.T, strict=True)
    ]
    amplitude, omega, beta = np.concatenate([np.empty((0, 3)), *every]).T
    return rows_of(
        {"mode": [name for name, points in zip(names, every, strict=True) for _ in points]},
        amplitude=q.AMPLITUDE.variable("row", amplitude),
        **oscillation("row", omega / (2.0 * np.pi), beta / omega),
    )


class _Free:
    """Residual of the free periodic motion, with frequency and negative damping as unknowns."""

    def __init__(self, balance: HarmonicBalance) -> None:
        self.balance = balance
        self.velocity = balance.derivative.is_velocity.astype(float)
        weight = np.zeros(balance.size)
        weight[:6] = balance.scale[:6]
        self.weights = np.zeros((balance.series.size, balance.size))
        self.weights[1:3] = weight**2

    def turned(self, coefficients: FloatArray) -> FloatArray:
        """Return the first harmonic a quarter of a cycle later."""
        turned = np.zeros_like(coefficients)
        turned[1], turned[2] = -coefficients[2], coefficients[1]
        return turned

    def states(self, coefficients: FloatArray) -> FloatArray:
        states = np.tile(self.balance.derivative.rest, (self.balance.series.samples, 1))
        states[:, self.balance.derivative.free] = self.balance.series.synthesis @ coefficients
        return states

    def correction(
        self,
        coefficients: FloatArray,
        omega: float,
        beta: float,
        amplitude: float,
        reference: FloatArray,
    ) -> FloatArray:
        """Return the Newton step of coefficients, frequency and damping."""
        balance, series = self.balance, self.balance.series
        rates, slopes = balance.derivative.with_slopes(self.states(coefficients))
        damping = 2.0 * beta * coefficients * self.velocity
        moved = series.slope @ coefficients
        residual = omega * moved - series.analysis @ rates - damping
        residual = balance.with_hold(residual, coefficients)
        size = coefficients.size
        matrix = balance.matrix(series.factors(slopes), omega).reshape(size, size)
        matrix[np.arange(size), np.arange(size)] -= 2.0 * beta * np.tile(self.velocity, series.size)
        bordered = np.zeros((size + 2, size + 2))
        bordered[:size, :size] = matrix
        bordered[:size, size] = moved.ravel()
        bordered[:size, size + 1] = -(2.0 * coefficients * self.velocity).ravel()
        bordered[size, :size] = (2.0 * self.weights * coefficients).ravel()
        turned = self.weights * self.turned(reference)
        bordered[size + 1, :size] = turned.ravel()
        right = np.concatenate(
            [
                residual.ravel(),
                [np.sum(self.weights * coefficients**2) - amplitude**2],
                [np.sum(turned * coefficients)],
            ]
        )
        return np.asarray(
            lu_solve(lu_factor(bordered, check_finite=False), -right, check_finite=False)
        )

    def solve(
        self, coefficients: FloatArray, omega: float, beta: float, amplitude: float
    ) -> tuple[FloatArray, float, float] | None:
        """Return the motion of an amplitude from a guess; None if Newton's method fails."""
        reference, shape = coefficients.copy(), coefficients.shape
        for _ in range(15):
            with warnings.catch_warnings():  # a singular matrix gives no finite step
                warnings.simplefilter("ignore", LinAlgWarning)
                step = self.correction(coefficients, omega, beta, amplitude, reference)
            if not np.all(np.isfinite(step)):
                return None
            change = step[:-2].reshape(shape)
            coefficients = coefficients + change
            omega, beta = omega + float(step[-2]), beta + float(step[-1])
            if omega <= 0.0:
                return None
            extent = self.balance.extent(change)
            if extent < TOLERANCE * amplitude and abs(step[-2]) < TOLERANCE * omega:
                return coefficients, omega, beta
        return None


def _follow(
    balance: HarmonicBalance, value: complex, vector: ComplexArray, amplitudes: FloatArray
) -> FloatArray:
    """Return amplitude, angular frequency and negative damping along a mode. (points, 3)"""
    free = _Free(balance)
    amplitude = min(SMALLEST_AMPLITUDE, float(amplitudes[0]))
    motion = balance.rest()
    motion[1], motion[2] = vector.real, -vector.imag
    size = float(np.sqrt(np.sum(free.weights * motion**2)))
    motion[1:3] *= amplitude / size
    here = free.solve(motion, float(abs(value)), float(-value.real), amplitude)
    points = list[tuple[float, float, float]]()
    factor, before = FIRST_FACTOR, None
    while here is not None:
        points.append((amplitude, *here[1:]))
        target = next((a for a in amplitudes if a > amplitude * (1.0 + 1e-9)), None)
        if target is None:
            break
        moved = None
        while moved is None and factor > LEAST_FACTOR:
            ahead = min(target, amplitude * factor)
            moved = free.solve(*_guess(balance, amplitude, here, before, ahead), ahead)
            if moved is None or abs(moved[1] / here[1] - 1.0) > 0.15:
                moved, factor = None, np.sqrt(factor)
        if moved is None:
            break
        before, here, amplitude = (amplitude, here), moved, ahead
        factor = min(factor * 1.3, 2.0)
    return np.reshape(points, (-1, 3))


def _guess(
    balance: HarmonicBalance,
    amplitude: float,
    here: tuple[FloatArray, float, float],
    before: tuple[float, tuple[FloatArray, float, float]] | None,
    ahead: float,
) -> tuple[FloatArray, float, float]:
    """Return a guess of the motion at a larger amplitude, extrapolated from the last two."""
    if before is None:
        rest = balance.rest()
        return rest + (here[0] - rest) * (ahead / amplitude), here[1], here[2]
    share = (ahead - amplitude) / (amplitude - before[0])
    share = min(share, 2.0)
    first = here[0] + share * (here[0] - before[1][0])
    return (
        first,
        here[1] + 0.5 * share * (here[1] - before[1][1]),
        here[2] + 0.5 * share * (here[2] - before[1][2]),
    )
