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
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve

from wm_drake.compiler.compilation import long_running
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.response.balance import HOLD, HarmonicBalance, Linearised
from wm_drake.studies.response.kinematics import Partition
from wm_drake.studies.response.series import write_derivative


class Condensed(NamedTuple):
    """What compiled code needs to put the velocities back.

    Attributes:
        by_velocity: Derivative of the rows that are no positions by velocities.
            ((2 N + 1) m, (2 N + 1) p)
        by_angles, by_rates: Derivative of the rows of angles by the angles of each body, and the
            inverse of that by angular velocities. (bodies, 3 (2 N + 1), 3 (2 N + 1))
        rates: K_v^-1 B. ((2 N + 1) p, b)
    """

    by_velocity: FloatArray
    by_angles: FloatArray
    by_rates: FloatArray
    rates: FloatArray


class Corrections:
    """Factors of the linear system at a motion, for corrections and for the tangent."""

    def __init__(
        self, balance: HarmonicBalance, at: Linearised, row: FloatArray, row_speed: float
    ) -> None:
        """Factor the system.

        Args:
            row: Coefficients of the last equation, 0 for velocities. (2 N + 1, n)
            row_speed: Coefficient of the speed in it.

        Raises:
            numpy.linalg.LinAlgError: a body is turned so far that its angles are not defined.
        """
        self.at, self._partition = at, balance.kinematics.partition
        size, n = at.residual.shape
        borders = np.zeros((size, n, len(at.spins) + 1))
        borders[0, :, :-1], borders[..., -1] = at.spins.T, at.by_speed
        others = self._partition.others
        m, spins = len(others), borders.shape[2]
        matrix = np.zeros((size * m + spins, size * m + spins))
        matrix[size * m : -1, :m] = at.spins[:, others]
        matrix[-1, : size * m] = row[:, others].ravel()
        matrix[-1, -1] = row_speed
        self._condensed = condense(
            at.slopes, at.speed, balance.is_held, HOLD, self._partition, borders, matrix
        )
        with warnings.catch_warnings():  # a singular matrix gives no finite correction
            warnings.simplefilter("ignore", LinAlgWarning)
            # the transpose has the order in memory that the factors need
            self._factors = lu_factor(matrix.T, overwrite_a=True, check_finite=False)

    def __call__(self, residual: FloatArray | None, last: float) -> tuple[FloatArray, float]:
        """Return the correction of the coefficients (2 N + 1, n) and of the speed.

        Args:
            residual: Of the balance; None for zero.
            last: Value that the left side of the last equation takes.
        """
        residual = np.zeros(self.at.residual.shape) if residual is None else residual
        right = right_side(residual, last, self._partition, self._condensed)
        solved = lu_solve(self._factors, right, trans=1, check_finite=False)
        change = whole_change(solved, residual, self.at.speed, self._partition, self._condensed)
        return change, float(solved[-1])


@long_running
def condense(
    slopes: FloatArray,
    speed: float,
    held: np.ndarray,
    hold: float,
    partition: Partition,
    borders: FloatArray,
    matrix: FloatArray,
) -> Condensed:
    """Write the rows of a system that is left without velocities, but for its last rows.

    Args:
        slopes, speed, held, hold: As for `write_derivative`.
        borders: Columns of spin rates and of the speed. (2 N + 1, n, b)
        matrix: The first (2 N + 1) m rows are written, for m numbers that are no positions.

    Returns:
        `Condensed`.
    """
    size, p, m = (len(slopes) + 1) // 2, len(partition.positions), len(partition.dynamic)
    bodies = len(partition.turned)
    write_derivative(slopes, partition.dynamic, partition.others, speed, held, hold, matrix)
    by_velocity = np.empty((size * m, size * p))
    write_derivative(
        slopes, partition.dynamic, partition.velocities, speed, held, hold, by_velocity
    )
    add_shifts(by_velocity, speed, partition, matrix)
    by_angles = np.empty((bodies, 3 * size, 3 * size))
    by_rates = np.empty((bodies, 3 * size, 3 * size))
    block = np.empty((3 * size, 3 * size))
    for b in range(bodies):
        angles = partition.turned[b]
        write_derivative(slopes, angles, angles, speed, held, hold, by_angles[b])
        write_derivative(slopes, angles, partition.turning[b], speed, held, hold, block)
        by_rates[b] = np.linalg.inv(block)
        subtract_turns(by_velocity, np.dot(by_rates[b], by_angles[b]), b, partition, matrix)
    rates = np.empty((size * p, borders.shape[2]))
    for q in range(borders.shape[2]):
        rates[:, q] = rates_of(borders[:, :, q], partition, by_rates)
    by_borders = np.dot(by_velocity, rates)
    for h in range(size):
        for row in range(m):
            for q in range(borders.shape[2]):
                matrix[h * m + row, size * m + q] = (
                    borders[h, partition.dynamic[row], q] - by_borders[h * m + row, q]
                )
    return Condensed(by_velocity, by_angles, by_rates, rates)


@long_running
def add_shifts(
    by_velocity: FloatArray, speed: float, partition: Partition, matrix: FloatArray
) -> None:
    """Add the part of the velocities that are time derivatives of positions.

        v_cos i = i Omega p_sin i,     v_sin i = -i Omega p_cos i

    Args:
        speed: Omega. [rad/s]
        matrix: Changed. Columns of numbers that are no velocities.
    """
    p, m, places = len(partition.positions), len(partition.others), partition.places
    for row in range(len(by_velocity)):
        for i in range(1, (by_velocity.shape[1] // p + 1) // 2):
            cosine, sine, turn = 2 * i - 1, 2 * i, i * speed
            for s in range(partition.turned.size, p):
                matrix[row, cosine * m + places[s]] -= turn * by_velocity[row, sine * p + s]
                matrix[row, sine * m + places[s]] += turn * by_velocity[row, cosine * p + s]


@long_running
def subtract_turns(
    by_velocity: FloatArray, rates: FloatArray, b: int, partition: Partition, matrix: FloatArray
) -> None:
    """Subtract the part of the angular velocities of a body.

    Args:
        rates: Minus the angular velocities by the angles. (3 (2 N + 1), 3 (2 N + 1))
        matrix: Changed. Columns of numbers that are no velocities.
    """
    p, m, places = len(partition.positions), len(partition.others), partition.places
    of_body = np.empty((len(by_velocity), len(rates)))
    for row in range(len(of_body)):
        for c in range(len(rates) // 3):
            for k in range(3):
                of_body[row, 3 * c + k] = by_velocity[row, c * p + 3 * b + k]
    moved = np.dot(of_body, rates)
    for row in range(len(of_body)):
        for c in range(len(rates) // 3):
            for k in range(3):
                matrix[row, c * m + places[3 * b + k]] -= moved[row, 3 * c + k]


@long_running
def rates_of(values: FloatArray, partition: Partition, by_rates: FloatArray) -> FloatArray:
    """Return K_v^-1 times values of the rows of positions. ((2 N + 1) p,)

    Args:
        values: (2 N + 1, n), of which the rows of positions are read.
    """
    size, p, bodies = len(values), len(partition.positions), len(by_rates)
    rates = np.empty((size, p))
    for h in range(size):
        for s in range(3 * bodies, p):
            rates[h, s] = -values[h, partition.positions[s]]
    for b in range(bodies):
        turned = np.dot(by_rates[b], columns_of(values, partition.turned[b]).ravel())
        rates[:, 3 * b : 3 * b + 3] = turned.reshape(size, 3)
    return rates.ravel()


@long_running
def columns_of(values: FloatArray, numbers: np.ndarray) -> FloatArray:
    """Return some columns of values. (2 N + 1, numbers)"""
    columns = np.empty((len(values), len(numbers)))
    for h in range(len(values)):
        for k in range(len(numbers)):
            columns[h, k] = values[h, numbers[k]]
    return columns


@long_running
def right_side(
    residual: FloatArray, last: float, partition: Partition, condensed: Condensed
) -> FloatArray:
    """Return the right side of the condensed system.

    Args:
        residual: Residual of the balance. (2 N + 1, n)
    """
    rows = len(condensed.by_velocity)
    right = np.zeros(rows + condensed.rates.shape[1])
    answer = np.dot(condensed.by_velocity, rates_of(residual, partition, condensed.by_rates))
    right[:rows] = answer - columns_of(residual, partition.dynamic).ravel()
    right[-1] = last
    return right


@long_running
def whole_change(
    solved: FloatArray,
    residual: FloatArray,
    speed: float,
    partition: Partition,
    condensed: Condensed,
) -> FloatArray:
    """Return the change of all numbers from that of those that are no velocities. (2 N + 1, n)

    Args:
        solved: Solution of the condensed system.
        residual: Residual of the balance. (2 N + 1, n)
        speed: Omega. [rad/s]
    """
    size, m, p = len(residual), len(partition.others), len(partition.positions)
    change, values = np.empty(residual.shape), residual.copy()
    for h in range(size):
        for k in range(m):
            change[h, partition.others[k]] = solved[h * m + k]
    for s in range(partition.turned.size, p):
        at = partition.positions[s]
        for i in range(1, (size + 1) // 2):
            values[2 * i - 1, at] += i * speed * change[2 * i, at]
            values[2 * i, at] -= i * speed * change[2 * i - 1, at]
    for b in range(len(partition.turned)):
        moved = columns_of(change, partition.turned[b]).ravel()
        turned = np.dot(condensed.by_angles[b], moved).reshape(size, 3)
        for k in range(3):
            values[:, partition.turned[b, k]] += turned[:, k]
    answer = rates_of(values, partition, condensed.by_rates)
    answer += np.dot(condensed.rates, solved[size * m :])
    for h in range(size):
        for s in range(p):
            change[h, partition.velocities[s]] = -answer[h * p + s]
    return change
