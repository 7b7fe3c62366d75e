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
        self._kinematics, self.at = balance.kinematics, at
        self._slope = at.speed * balance.series.slope
        size, n = at.residual.shape
        turned, shifted = balance.kinematics.turns, balance.kinematics.shifts
        self._positions = np.concatenate([turned[0].ravel(), shifted[0]])
        self._velocities = np.concatenate([turned[1].ravel(), shifted[1]])
        self._kept = np.setdiff1d(np.arange(n), self._velocities)
        self._rows = np.setdiff1d(np.arange(n), self._positions)
        self._blocks = [
            (_block(at.matrix, angles, angles), np.linalg.inv(_block(at.matrix, angles, rates)))
            for angles, rates in zip(*turned, strict=True)
        ]
        borders = np.zeros((size, n, len(at.spins) + 1))
        borders[0, :, :-1], borders[..., -1] = at.spins.T, at.by_speed
        self._borders = borders[:, self._positions]
        dynamic = at.matrix[:, self._rows]
        by_velocity = np.ascontiguousarray(dynamic[..., self._velocities])
        self._by_velocity = by_velocity.reshape(size * len(self._rows), -1)
        self._factors = self._factored(dynamic, borders[:, self._rows], row, row_speed)

    def _factored(
        self, dynamic: FloatArray, borders: FloatArray, row: FloatArray, row_speed: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the factors of the condensed system."""
        size, m, k = len(dynamic), len(self._rows), len(self._kept)
        condensed = dynamic[..., self._kept]
        shifts = 3 * len(self._blocks)
        by_velocity = self._by_velocity.reshape(size, m, size, -1)
        along = np.tensordot(by_velocity[..., shifts:], self._slope, axes=(2, 0))
        condensed[..., np.searchsorted(self._kept, self._positions[shifts:])] += along.swapaxes(
            2, 3
        )
        for i, (by_angles, inverse) in enumerate(self._blocks):
            where = slice(3 * i, 3 * i + 3)
            rates = by_velocity[..., where].reshape(size * m, -1) @ (inverse @ by_angles)
            columns = np.searchsorted(self._kept, self._positions[where])
            condensed[..., columns] -= rates.reshape(size, m, size, 3)
        spins = self._borders.shape[2]
        matrix = np.zeros((size * m + spins, size * k + spins))
        matrix[: size * m, : size * k] = condensed.reshape(size * m, size * k)
        flat = borders.reshape(size * m, spins)
        matrix[: size * m, size * k :] = flat - self._by_velocity @ self._rates(self._borders)
        matrix[size * m : -1, :k] = self.at.spins[:, self._kept]
        matrix[-1, : size * k] = row[:, self._kept].ravel()
        matrix[-1, -1] = row_speed
        with warnings.catch_warnings():  # a singular matrix gives no finite correction
            warnings.simplefilter("ignore", LinAlgWarning)
            factors, pivots = lu_factor(matrix, overwrite_a=True, check_finite=False)
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
        m, k, spins = len(self._rows), len(self._kept), self._borders.shape[2]
        right = np.zeros(size * m + spins)
        right[-1] = last
        values = np.zeros((size, len(self._positions), 1))
        if residual is not None:
            values[..., 0] = residual[:, self._positions]
            right[:-spins] = self._by_velocity @ self._rates(values)[:, 0]
            right[:-spins] -= residual[:, self._rows].ravel()
        solved = lu_solve(self._factors, right, check_finite=False)
        change = np.zeros((size, n))
        change[:, self._kept] = solved[: size * k].reshape(size, k)
        shifts = 3 * len(self._blocks)
        values[..., 0] += self._borders @ solved[size * k :]
        values[:, shifts:, 0] += self._slope @ change[:, self._positions[shifts:]]
        for i, (by_angles, _) in enumerate(self._blocks):
            where = slice(3 * i, 3 * i + 3)
            moved = by_angles @ change[:, self._positions[where]].ravel()
            values[:, where, 0] += moved.reshape(size, 3)
        change[:, self._velocities] = -self._rates(values).reshape(size, -1)
        return change, float(solved[-1])


def _block(matrix: FloatArray, rows: np.ndarray, columns: np.ndarray) -> FloatArray:
    """Return the part of a matrix (2 N + 1, n, 2 N + 1, n) of some rows and columns."""
    size = len(matrix)
    return matrix[:, rows][..., columns].reshape(size * len(rows), size * len(columns))
