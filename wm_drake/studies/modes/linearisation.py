"""Linearisation of a machine about its equilibrium, and its modes.

A small motion d of the free numbers of the state obeys d' = A d. A is the slope of the compiled
right-hand side by central differences (`SlopedDerivative.jacobian`).

With a load the right-hand side changes with the drum angle. A and the equilibrium are then means
over a revolution: what remains is the part of the motion that does not follow the rotation.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wm_drake.elements.rubber import FRICTION, MAXWELL
from wm_drake.engines.compiled.mechanics import DRUM_ANGLE, DRUM_RATE
from wm_drake.engines.compiled.slopes import SlopedDerivative
from wm_drake.errors import input_error
from wm_drake.model.machine import Setup
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import ComplexArray, FloatArray

STUCK, SLIDING, AMPLITUDE = "stuck", "sliding", "amplitude"
"""Linearisations.

stuck: slope of all laws at rest. Friction holds, so that the sponges of dampers are springs.
sliding: dry friction is saturated. Its force is constant and its slope zero; dashpots remain.
amplitude: harmonic balance of a free motion of a given amplitude."""

SLOWEST = 2.0 * np.pi * 0.01
"""Least angular frequency of a mode. [rad/s]

Slower eigenvalues result from rounding only: nothing holds the rotation of a damper's tubes about
its axis."""

ANGLES = 12
"""Number of drum angles of a mean over a revolution: exact up to the eleventh harmonic."""

MODES = 6
"""Number of modes: the six motions of the suspended tub.

Overdamped motions are not included; damper tubes on their bushings and a drum in a compliant
bearing have faster modes."""


@dataclass(frozen=True)
class Spectrum:
    """Oscillating eigenvalues of a matrix A in rising order of size, one of each conjugate pair.

    Attributes:
        values: Eigenvalues. (m,) [1/s]
        right: Right eigenvectors as columns. (n, m)
        left: Left eigenvectors as rows; row i times column j of `right` is 1 if i is j, else 0.
            (m, n)
    """

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray

    def first(self, count: int) -> "Spectrum":
        """Return the slowest motions."""
        return Spectrum(self.values[:count], self.right[:, :count], self.left[:count])

    @property
    def frequency_hz(self) -> FloatArray:
        """Return the natural frequencies |lambda| / (2 pi). (m,) [Hz]"""
        return np.abs(self.values) / (2.0 * np.pi)

    @property
    def damping_ratio(self) -> FloatArray:
        """Return the damping ratios -Re(lambda) / |lambda|. (m,)"""
        return -self.values.real / np.abs(self.values)


def spectrum_of(matrix: FloatArray) -> Spectrum:
    """Return the oscillating eigenvalues of a matrix."""
    values, vectors = np.linalg.eig(matrix)
    is_invertible = np.linalg.cond(vectors) < 1e13
    left = np.linalg.inv(vectors) if is_invertible else np.linalg.pinv(vectors)
    oscillating = np.flatnonzero(values.imag > max(SLOWEST, 1e-6 * np.abs(values).max()))
    order = oscillating[np.argsort(np.abs(values[oscillating]))]
    return Spectrum(values[order], vectors[:, order], left[order])


class Linearisation:
    """A machine as it is set up, linearised about its equilibrium at any speed of the drum.

    Attributes:
        derivative: Compiled right-hand side.
        equilibrium: State at equilibrium.
        names: Name of each element on the tub: springs, dampers, bushings, telescopic dampers.
    """

    def __init__(self, setup: Setup, *, loaded: bool = False) -> None:
        """Pack a machine.

        Args:
            loaded: Whether there is a load, which moves the equilibrium.

        Raises:
            InputError: the machine has something that the compiled engine does not represent.
        """
        self.derivative = SlopedDerivative(setup)
        kinds: tuple[Mapping[str, object], ...] = (
            setup.springs,
            setup.dampers,
            setup.bushings,
            setup.telescopes,
            setup.elements.others,
        )
        words = ("spring", "damper", "bushing", "damper", "element")
        self.names = [
            name if name == "gasket" else f"{word} {name}"
            for word, kind in zip(words, kinds, strict=True)
            for name in kind
        ]
        self.equilibrium = self._equilibrium_at() if loaded else self.derivative.rest

    def matrix(self, speed: float = 0.0) -> FloatArray:
        """Return A of the free numbers of the state at a speed of the drum [rad/s]. (n, n)"""
        return np.asarray(self.derivative.jacobian(self._revolution(speed)).mean(axis=0))

    def spectrum(self, speed: float = 0.0) -> Spectrum:
        """Return the oscillating eigenvalues at a speed of the drum. [rad/s]"""
        return spectrum_of(self.matrix(speed))

    def wrench_slopes(self) -> FloatArray:
        """Return the slopes of the wrench of each element on the tub. (elements, 6, n)"""
        return self.derivative.wrench_slopes(self.equilibrium)

    def _revolution(self, speed: float) -> FloatArray:
        states = np.tile(self.equilibrium, (ANGLES, 1))
        states[:, DRUM_ANGLE] = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
        states[:, DRUM_RATE] = speed
        return states

    def _equilibrium_at(self) -> FloatArray:
        """Return the state in which the mean force over a revolution vanishes, by Newton's method.

        A step is a least-squares solution, so that a tube that can spin freely stays where it is.
        The branches of rubber stay relaxed: vibration takes the mean of their friction away.
        """
        self.equilibrium = self.derivative.rest
        free, still = self.derivative.free, ~self.derivative.is_velocity
        still &= ~np.isin(free, self.derivative.layout.states.indices(FRICTION, MAXWELL))
        for _ in range(20):
            states = self._revolution(0.0)
            rates = self.derivative(states).mean(axis=0)[free]
            slopes = self.derivative.jacobian(states).mean(axis=0)[:, still]
            change = np.linalg.lstsq(slopes, -rates, rcond=1e-12)[0]
            self.equilibrium = self.equilibrium.copy()
            self.equilibrium[free[still]] += change
            if np.max(np.abs(change)) < 1e-12:
                break
        return self.equilibrium


def check_fixed_cabinet(parameters: MachineParameters) -> None:
    """Raise InputError if the cabinet of a machine moves."""
    if parameters.cabinet_moves:
        raise input_error(
            f"the cabinet of machine '{parameters.name}' moves; modes and steady states are those "
            "of a machine on a fixed cabinet: set it to false",
            key="cabinet.moves",
        )
