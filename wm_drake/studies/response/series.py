"""Truncated Fourier series, their samples over a period, and products with them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Series:
    """Fourier series of some order, sampled at equal distances over a period.

    The coefficients are in the order mean, cosine and sine of the first harmonic, of the second...

    Attributes:
        order: Number of harmonics N, >= 1.
        samples: Number of samples, > 2 N.
    """

    order: int
    samples: int

    @property
    def size(self) -> int:
        """Return the number of coefficients, 2 N + 1."""
        return 2 * self.order + 1

    @cached_property
    def phase(self) -> FloatArray:
        """Return the phases of the samples, from 0. (samples,) [rad]"""
        return 2.0 * np.pi * np.arange(self.samples) / self.samples

    @cached_property
    def synthesis(self) -> FloatArray:
        """Return the matrix that takes coefficients to samples. (samples, 2 N + 1)"""
        return self.at(self.phase)

    def at(self, phase: FloatArray) -> FloatArray:
        """Return the matrix that takes coefficients to values at phases. (n, 2 N + 1)"""
        angles = np.outer(phase, np.arange(1, self.order + 1))
        matrix = np.ones((len(phase), self.size))
        matrix[:, 1::2], matrix[:, 2::2] = np.cos(angles), np.sin(angles)
        return matrix

    @cached_property
    def analysis(self) -> FloatArray:
        """Return the matrix that takes samples to coefficients. (2 N + 1, samples)"""
        matrix = 2.0 / self.samples * self.synthesis.T
        matrix[0] *= 0.5
        return np.ascontiguousarray(matrix)

    @cached_property
    def slope(self) -> FloatArray:
        """Return the matrix that takes coefficients to those of the derivative by the phase."""
        matrix = np.zeros((self.size, self.size))
        for harmonic in range(1, self.order + 1):
            cosine, sine = 2 * harmonic - 1, 2 * harmonic
            matrix[cosine, sine], matrix[sine, cosine] = harmonic, -harmonic
        return matrix

    @cached_property
    def double(self) -> FloatArray:
        """Return the analysis of twice as many harmonics, which products need. (4 N + 1, samples)

        With no more than 4 N samples, harmonics above half of the samples are those below it.
        """
        return Series(2 * self.order, self.samples).analysis

    def factors(self, samples: FloatArray) -> FloatArray:
        """Return the coefficients of the factors of products, of twice the order. (4 N + 1, n, k)

        Args:
            samples: (samples, k, n) samples of the factor of each number k in each sum n.
        """
        flat = np.ascontiguousarray(samples).reshape(self.samples, -1)
        coefficients = (self.double @ flat).reshape(-1, *samples.shape[1:])
        return np.ascontiguousarray(coefficients.transpose(0, 2, 1))


@long_running
def write_derivative(
    slopes: FloatArray,
    rows: np.ndarray,
    columns: np.ndarray,
    speed: float,
    held: np.ndarray,
    hold: float,
    matrix: FloatArray,
) -> None:
    """Write the derivative of residuals by coefficients: Omega D less the products with slopes.

    Args:
        slopes: (4 N + 1, n, n) coefficients of the slope of the time derivative of each number by
            each number: mean, cosine, sine...
        rows, columns: Numbers whose residuals are wanted (r,), and by which (c,).
        speed: Omega. [rad/s]
        held: Whether each number is held. (n,)
        hold: Rate at which held numbers return. [1/s]
        matrix: The first (2 N + 1) r rows and (2 N + 1) c columns are written: number by number
            for each coefficient.
    """
    size, n, k = (len(slopes) + 1) // 2, len(rows), len(columns)
    for h in range(size):
        for c in range(size):
            first, weight, second, weight_high = product_weights(h, c)
            for row in range(n):
                for column in range(k):
                    matrix[h * n + row, c * k + column] = (
                        -weight * slopes[first, rows[row], columns[column]]
                        - weight_high * slopes[second, rows[row], columns[column]]
                    )
    for row in range(n):
        for column in range(k):
            if rows[row] == columns[column]:
                matrix[row, column] += hold * held[rows[row]]
                for i in range(1, (size + 1) // 2):
                    matrix[(2 * i - 1) * n + row, 2 * i * k + column] += i * speed
                    matrix[2 * i * n + row, (2 * i - 1) * k + column] -= i * speed


@long_running
def product_weights(h: int, c: int) -> tuple[int, float, int, float]:
    """Return which harmonics of a factor multiply a coefficient, and with which weights.

    A product of the factor g and a series X has the coefficients G X. With g = A_0 / 2 + sum of
    A_m cos(m t) + B_m sin(m t), the entries of G are, own derivation:

        cos i, cos j: (A_|i-j| + A_i+j) / 2        sin i, sin j: (A_|i-j| - A_i+j) / 2
        cos i, sin j: (B_i+j - B_i-j) / 2          sin i, cos j: (B_i+j + B_i-j) / 2

    with B_-m = -B_m. The row of the mean has half of these, for cos 0.

    Args:
        h, c: Row and column of G.

    Returns:
        Index of the lower harmonic among the coefficients of g, its weight, and the same of the
        higher one. The coefficient of index 0 is the mean A_0 / 2.
    """
    i, j = (h + 1) // 2, (c + 1) // 2
    sine_row, sine_column = h > 0 and h % 2 == 0, c > 0 and c % 2 == 0
    low, high = abs(i - j), i + j
    if sine_row != sine_column:
        first, second, weight_high = 2 * low, 2 * high, 0.5
        weight = 0.0 if i == j else 0.5 if (i > j) == sine_row else -0.5
    else:
        first, second = max(2 * low - 1, 0), max(2 * high - 1, 0)
        weight = 1.0 if low == 0 else 0.5
        weight_high = 1.0 if high == 0 else -0.5 if sine_row else 0.5
    half = 0.5 if h == 0 else 1.0
    return first, half * weight, second, half * weight_high
