"""Corrections of periodic motions: linear systems of the harmonic balance without velocities.

Rows of positions hold the velocities and the rates of free spins only. With changes p of positions
and deformations, v of velocities, y of spin rates and drum speed, a correction obeys, own
derivation,

    K_p p + K_v v + B y = -r            rows of positions
    J_p p + J_v v + b y = -r_d          other rows
    C p + c y           = -r_c          no spin; a given speed, or a plane across the tangent

K_v consists of a block for each body, so that v = -K_v^-1 (r + K_p p + B y) is cheap. What remains
has little more than half the size. No term is left out.
"""

import warnings

import numpy as np
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.steady.balance import HarmonicBalance, Linearised


class Corrections:
    """Factors of the linear system at a motion, for corrections and for the tangent."""

    def __init__(
        self, balance: HarmonicBalance, at: Linearised, row: FloatArray, row_speed: float
    ) -> None:
        """Factor the system.

        Args:
            balance: The machine.
            at: Its balance at a motion.
            row: Coefficients of the last equation, 0 for velocities. (2 N + 1, n)
            row_speed: Coefficient of the speed in it.

        Raises:
            numpy.linalg.LinAlgError: a body is turned so far that its angles are not defined.
        """
        self.at, self._numbers = at, balance.kinematics
        self._turn = _quarter_turns(balance.series.order, at.speed)
        size, numbers = len(at.residual), balance.kinematics
        self._blocks = [
            (
                balance.matrix(at.slopes, at.speed, angles, angles).reshape(3 * size, 3 * size),
                np.linalg.inv(
                    balance.matrix(at.slopes, at.speed, angles, rates).reshape(3 * size, 3 * size)
                ),
            )
            for angles, rates in zip(*numbers.turns, strict=True)
        ]
        borders = np.zeros((size, numbers.count, len(at.spins) + 1))
        borders[0, :, :-1], borders[..., -1] = at.spins.T, at.by_speed
        self._borders = borders[:, numbers.positions]
        by_velocity = balance.matrix(at.slopes, at.speed, numbers.dynamic, numbers.velocities)
        self._by_velocity = by_velocity.reshape(size * len(numbers.dynamic), -1)
        condensed = balance.matrix(at.slopes, at.speed, numbers.dynamic, numbers.others)
        self._condense(condensed, by_velocity)
        self._factors = self._factored(condensed, borders, row, row_speed)

    def _condense(self, condensed: FloatArray, by_velocity: FloatArray) -> None:
        """Add what the velocities do, as they follow from positions, to a matrix of positions."""
        size, m = condensed.shape[:2]
        places, shifts = self._numbers.places, 3 * len(self._blocks)
        partner, factor = self._turn
        moved = by_velocity[:, :, partner, shifts:] * factor[partner, None]
        condensed[..., places[shifts:]] += moved
        for i, (by_angles, inverse) in enumerate(self._blocks):
            where = slice(3 * i, 3 * i + 3)
            rates = by_velocity[..., where].reshape(size * m, -1) @ (inverse @ by_angles)
            condensed[..., places[where]] -= rates.reshape(size, m, size, 3)

    def _factored(
        self, condensed: FloatArray, borders: FloatArray, row: FloatArray, row_speed: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the factors of the transpose of the condensed system, with its borders."""
        size, m, _, k = condensed.shape
        numbers, spins = self._numbers, borders.shape[2]
        matrix = np.zeros((size * m + spins, size * k + spins))
        matrix[: size * m, : size * k] = condensed.reshape(size * m, size * k)
        flat = borders[:, numbers.dynamic].reshape(size * m, spins)
        matrix[: size * m, size * k :] = flat - self._by_velocity @ self._rates(self._borders)
        matrix[size * m : -1, :k] = self.at.spins[:, numbers.others]
        matrix[-1, : size * k] = row[:, numbers.others].ravel()
        matrix[-1, -1] = row_speed
        with warnings.catch_warnings():  # a singular matrix gives no finite correction
            warnings.simplefilter("ignore", LinAlgWarning)
            # the transpose has the order in memory that the factors need
            factors, pivots = lu_factor(matrix.T, overwrite_a=True, check_finite=False)
        return factors, pivots

    def _rates(self, values: FloatArray) -> FloatArray:
        """Return K_v^-1 times values of the rows of positions. (2 N + 1, positions, right sides)"""
        size = len(values)
        rates = -values
        for i, (_, inverse) in enumerate(self._blocks):
            where = slice(3 * i, 3 * i + 3)
            right = values[:, where].reshape(3 * size, -1)
            rates[:, where] = (inverse @ right).reshape(size, 3, -1)
        return rates.reshape(size * values.shape[1], -1)

    def __call__(self, residual: FloatArray | None, last: float) -> tuple[FloatArray, float]:
        """Return the correction of the coefficients (2 N + 1, n) and of the speed.

        Args:
            residual: Of the balance; None for zero.
            last: Value that the left side of the last equation takes.
        """
        size, n = self.at.residual.shape
        numbers, spins = self._numbers, self._borders.shape[2]
        m, k = len(numbers.dynamic), len(numbers.others)
        right = np.zeros(size * m + spins)
        right[-1] = last
        values = np.zeros((size, len(numbers.positions), 1))
        if residual is not None:
            values[..., 0] = residual[:, numbers.positions]
            right[:-spins] = self._by_velocity @ self._rates(values)[:, 0]
            right[:-spins] -= residual[:, numbers.dynamic].ravel()
        solved = lu_solve(self._factors, right, trans=1, check_finite=False)
        change = np.zeros((size, n))
        change[:, numbers.others] = solved[: size * k].reshape(size, k)
        shifts = 3 * len(self._blocks)
        values[..., 0] += self._borders @ solved[size * k :]
        partner, factor = self._turn
        moved = change[:, numbers.positions[shifts:]]
        values[:, shifts:, 0] += factor[:, None] * moved[partner]
        for i, (by_angles, _) in enumerate(self._blocks):
            where = slice(3 * i, 3 * i + 3)
            turned = by_angles @ change[:, numbers.positions[where]].ravel()
            values[:, where, 0] += turned.reshape(size, 3)
        change[:, numbers.velocities] = -self._rates(values).reshape(size, -1)
        return change, float(solved[-1])


def _quarter_turns(order: int, speed: float) -> tuple[np.ndarray, FloatArray]:
    """Return how the coefficients of a time derivative follow from those of a series.

        v_cos k = k Omega p_sin k,     v_sin k = -k Omega p_cos k

    Args:
        order: Number of harmonics.
        speed: Omega. [rad/s]

    Returns:
        Index of the coefficient that each one follows from, and the factor. (2 N + 1,)
    """
    harmonic = np.arange(1, order + 1)
    partner, factor = np.zeros(2 * order + 1, dtype=int), np.zeros(2 * order + 1)
    partner[1::2], partner[2::2] = 2 * harmonic, 2 * harmonic - 1
    factor[1::2], factor[2::2] = speed * harmonic, -speed * harmonic
    return partner, factor
