"""Truncated Fourier series and their samples over a period."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
