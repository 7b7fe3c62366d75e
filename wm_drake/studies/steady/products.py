"""Matrices of products of Fourier series, assembled by compiled code."""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.parameters.types import FloatArray


@long_running
def write_products(harmonics: FloatArray, factor: float, matrix: FloatArray) -> None:
    """Write the matrices that multiply Fourier series by sampled factors.

    A product of the factor g and a series X has the coefficients G X. With g = A_0 / 2 + sum of
    A_m cos(m t) + B_m sin(m t), the entries of G are, own derivation:

        cos i, cos j: (A_|i-j| + A_i+j) / 2        sin i, sin j: (A_|i-j| - A_i+j) / 2
        cos i, sin j: (B_i+j - B_i-j) / 2          sin i, cos j: (B_i+j + B_i-j) / 2

    with B_-m = -B_m. The row of the mean has half of these, for cos 0.

    Args:
        harmonics: (4 N + 1, n, k) coefficients of the factors g_nk: mean, cosine, sine...
        factor: Factor of the matrices.
        matrix: (2 N + 1, n, 2 N + 1, k), written.
    """
    size, n, k = matrix.shape[0], matrix.shape[1], matrix.shape[3]
    for h in range(size):
        i, sine_row = (h + 1) // 2, h > 0 and h % 2 == 0
        for c in range(size):
            j, sine_column = (c + 1) // 2, c > 0 and c % 2 == 0
            low, high = abs(i - j), i + j
            if sine_row != sine_column:
                first, second = 2 * low, 2 * high
                weight = 0.5 * np.sign(i - j) * (1.0 if sine_row else -1.0)
                weight_high = 0.5
            else:
                first, second = max(2 * low - 1, 0), max(2 * high - 1, 0)
                # the mean is half of A_0
                weight = 1.0 if low == 0 else 0.5
                weight_high = 1.0 if high == 0 else -0.5 if sine_row else 0.5
            if h == 0:
                weight, weight_high = 0.5 * weight, 0.5 * weight_high
            weight, weight_high = factor * weight, factor * weight_high
            for row in range(n):
                for column in range(k):
                    matrix[h, row, c, column] = (
                        weight * harmonics[first, row, column]
                        + weight_high * harmonics[second, row, column]
                    )
