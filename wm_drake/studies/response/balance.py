"""Harmonic balance of a machine whose drum turns at a constant speed.

The state x of the machine obeys x' = f(x, phi), with the drum angle phi = Omega t. A periodic
motion is a Fourier series X of the drum angle. With D the derivative by the angle and A the
analysis of samples, it satisfies

    R(X, Omega) = Omega D X - A f(S X, phi) = 0      alternating frequency/time method

(Cameron and Griffin 1989; Krack and Gross, Harmonic Balance for Nonlinear Vibration Problems,
2019). f is evaluated at the samples of a period by the compiled right-hand side: rigid bodies and
the laws of all elements. Deformations of sponges and motions of damper tubes are unknowns too.

A telescopic damper may spin about its axis, where nothing but friction acts. Its steady motion then
has a mean rate of spin c, while all else is periodic: the kinematic rows have the mean c u, with
the rates u of angles and position by the spin. c is an unknown, and the mean angle, which changes
no force, stays where it is.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.elements.rubber import FRICTION, MAXWELL
from wm_drake.elements.state_map import ANGLE, ELEMENT_STATE, SPONGE, TUBES
from wm_drake.engines.compiled.mechanics import DRUM_ANGLE, DRUM_RATE
from wm_drake.engines.compiled.slopes import SlopedDerivative
from wm_drake.model.machine import Setup
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.modes.linearisation import check_fixed_cabinet
from wm_drake.studies.modes.shapes import ANGLE_ARM
from wm_drake.studies.response.kinematics import kinematics_of
from wm_drake.studies.response.series import Series, write_derivative

HARMONICS = 11
"""Default number of harmonics.

Against 31 harmonics, at 20 speeds from 60 to 400 rpm with the loads back and middle of the
reference machine, displacements deviate by up to 0.29, 0.08, 0.04, 0.016 and 0.009 mm with 3, 5,
7, 9 and 11 harmonics, and amplitudes by up to 3.9, 1.2, 1.0, 0.7 and 0.5 %."""

SAMPLES = 128
"""Default number of samples of a period."""

HOLD = 1e-6
"""Rate at which held numbers of the state return to their values at rest. [1/s]

Held are the angles of damper tubes, the deformations of sponges and the stretches of rubber.
Nothing holds the spin of a tube about its axis in a free motion, nor a sponge within its free
stroke, nor the friction of rubber along an axis that does not move, so that their mean would be
undetermined. Other motions change by this rate over their angular frequency, less than one part
in a million."""


@dataclass(frozen=True)
class Linearised:
    """Residual of the harmonic balance and its derivatives at a motion.

    Attributes:
        speed: Omega. [rad/s]
        residual: (2 N + 1, n)
        slopes: Fourier coefficients of the slope of each time derivative by each number, from which
            `HarmonicBalance.matrix` follows. (4 N + 1, n, n)
        by_speed: Derivative by the speed. (2 N + 1, n)
        spins: Rates of the numbers by the spin of each damper tube that turns freely. (spins, n)
    """

    speed: float
    residual: FloatArray
    slopes: FloatArray
    by_speed: FloatArray
    spins: FloatArray


class HarmonicBalance:
    """Residual of the periodic motions of a machine.

    Attributes:
        derivative: Compiled right-hand side.
        series: Order and samples.
        scale: Factor of each number in the size of a motion: 1 for positions, `ANGLE_ARM` for
            angles, 0 for velocities, so that a size is in m. (n,)
        held: Indices of the numbers that `HOLD` is about.
        is_held: Whether each number is one of them. (n,)
        kinematics: Positions, velocities and free spins among the numbers.
    """

    def __init__(self, setup: Setup, series: Series) -> None:
        """Pack a machine.

        Raises:
            InputError: the machine has something that the compiled engine does not represent.
        """
        check_fixed_cabinet(setup.parameters)
        derivative = SlopedDerivative(setup)
        self.derivative, self.series = derivative, series
        self.scale = np.where(derivative.is_velocity, 0.0, 1.0)
        angles = np.isin(derivative.free, derivative.layout.states.indices(ANGLE))
        self.scale[angles] = ANGLE_ARM
        self.held = _held(self.derivative)
        self.is_held = np.isin(np.arange(self.size), self.held)
        self.kinematics = kinematics_of(self.derivative, setup)

    @property
    def size(self) -> int:
        """Return the number of free numbers of the state."""
        return len(self.derivative.free)

    def rest(self) -> FloatArray:
        """Return the coefficients of the state of rest."""
        coefficients = np.zeros((self.series.size, self.size))
        coefficients[0] = self.derivative.rest[self.derivative.free]
        return coefficients

    def states(
        self, coefficients: FloatArray, speed: float, phase: FloatArray | None = None
    ) -> FloatArray:
        """Return the states over a period, at the samples or at given phases. (samples, size)"""
        synthesis = self.series.synthesis if phase is None else self.series.at(phase)
        states = np.empty((len(synthesis), len(self.derivative.rest)))
        states[:, self.derivative.free] = synthesis @ coefficients
        states[:, DRUM_ANGLE] = self.series.phase if phase is None else phase
        states[:, DRUM_RATE] = speed
        return states

    def residual(self, coefficients: FloatArray, speed: float) -> FloatArray:
        """Return R(X, Omega). (2 N + 1, n)"""
        rates = self.derivative(self.states(coefficients, speed))[:, self.derivative.free]
        return self._residual(coefficients, speed, rates)

    def _residual(self, coefficients: FloatArray, speed: float, rates: FloatArray) -> FloatArray:
        series = self.series
        residual = speed * (series.slope @ coefficients) - series.analysis @ rates
        return self.with_hold(residual, coefficients)

    def with_hold(self, residual: FloatArray, coefficients: FloatArray) -> FloatArray:
        """Return a residual with the hold of the numbers that nothing else may hold."""
        moved = coefficients[0] - self.derivative.rest[self.derivative.free]
        residual[0, self.held] += HOLD * moved[self.held]
        return residual

    def linearised(self, coefficients: FloatArray, speed: float) -> Linearised:
        """Return the residual and its derivatives."""
        states = self.states(coefficients, speed)
        rates, slopes = self.derivative.with_slopes(states, drum_rate=True)
        by_speed = self.series.slope @ coefficients - self.series.analysis @ slopes[:, -1]
        residual = self._residual(coefficients, speed, rates)
        factors = self.series.factors(slopes[:, :-1])
        spins = [spin.direction(coefficients[0]) for spin in self.kinematics.spins]
        return Linearised(
            speed, residual, factors, by_speed, np.reshape(spins, (len(spins), self.size))
        )

    def matrix(self, slopes: FloatArray, speed: float) -> FloatArray:
        """Return the derivative of the residual by the coefficients. (2 N + 1, n, 2 N + 1, n)

        Args:
            slopes: Fourier coefficients as in `Linearised`. (4 N + 1, n, n)
            speed: Omega. [rad/s]
        """
        size, every = self.series.size * self.size, np.arange(self.size)
        matrix = np.empty((size, size))
        write_derivative(slopes, every, every, speed, self.is_held, HOLD, matrix)
        return matrix.reshape(self.series.size, self.size, self.series.size, self.size)

    def extent(self, coefficients: FloatArray) -> float:
        """Return the size of a change of the coefficients. [m]"""
        return float(np.linalg.norm(coefficients * self.scale))


def _held(derivative: SlopedDerivative) -> np.ndarray:
    """Return the indices among the free numbers of tube angles and of own states of elements."""
    states = derivative.layout.states
    held = [
        *states.indices(ANGLE, kinds=[TUBES]),
        *states.indices(SPONGE, FRICTION, MAXWELL, ELEMENT_STATE),
    ]
    return np.flatnonzero(np.isin(derivative.free, held))
