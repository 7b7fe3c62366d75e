"""Stress and stiffness of rubber: the strain energy of Yeoh without change of volume.

    W = c1 (I - 3) + c2 (I - 3)^2 + c3 (I - 3)^3,    I = J^(-2/3) tr(F^T F)

Yeoh, Rubber Chemistry and Technology 66 (1993) 754; with c2 = c3 = 0 it is the Neo-Hookean energy,
whose shear modulus is 2 c1. The change of volume is the matter of the element.
"""

import numpy as np

from wm_drake.compiler.compilation import long_running


@long_running
def determinant(A):
    """Return the determinant of a matrix. (3, 3)"""
    return (
        A[0, 0] * (A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1])
        - A[0, 1] * (A[1, 0] * A[2, 2] - A[1, 2] * A[2, 0])
        + A[0, 2] * (A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0])
    )


@long_running
def inverse_of(A):
    """Return the inverse of a matrix. (3, 3)"""
    inverse, scale = np.empty((3, 3)), 1.0 / determinant(A)
    for i in range(3):
        for k in range(3):
            a, b, c, d = (k + 1) % 3, (k + 2) % 3, (i + 1) % 3, (i + 2) % 3
            inverse[i, k] = scale * (A[a, c] * A[b, d] - A[a, d] * A[b, c])
    return inverse


@long_running
def energy(F, c):
    """Return the strain energy per volume. [J/m^3]

    Args:
        F: Deformation gradient. (3, 3)
        c: Constants of Yeoh. (3,) [Pa]
    """
    x = determinant(F) ** (-2.0 / 3.0) * np.sum(F * F) - 3.0
    return x * (c[0] + x * (c[1] + x * c[2]))


@long_running
def write_stress(F, inverse, J, c, P, A):
    """Write the first Piola-Kirchhoff stress and its derivative.

    With D = dI/dF = 2 J^(-2/3) (F - tr(F^T F)/3 F^-T):  P = W' D,  A = W'' D D + W' dD/dF.

    Args:
        F: Deformation gradient, J its determinant, above 0. (3, 3)
        inverse: Inverse of F. (3, 3)
        J: Determinant of F.
        c: Constants of Yeoh. (3,) [Pa]
        P: Receives the stress. (3, 3) [Pa]
        A: Receives dP_iJ / dF_kL. (3, 3, 3, 3) [Pa]
    """
    m, first = J ** (-2.0 / 3.0), np.sum(F * F)
    x = m * first - 3.0
    slope = c[0] + x * (2.0 * c[1] + 3.0 * x * c[2])
    curvature = 2.0 * c[1] + 6.0 * x * c[2]
    for i in range(3):
        for j in range(3):
            P[i, j] = 2.0 * m * (F[i, j] - first / 3.0 * inverse[j, i])
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for n in range(3):
                    change = (
                        first * inverse[n, i] * inverse[j, k] / 3.0
                        - 2.0 / 3.0 * F[k, n] * inverse[j, i]
                    )
                    if i == k and j == n:
                        change += 1.0
                    A[i, j, k, n] = (
                        curvature * P[i, j] * P[k, n]
                        + slope * 2.0 * m * change
                        - slope * 2.0 / 3.0 * inverse[n, k] * P[i, j]
                    )
    for i in range(3):
        for j in range(3):
            P[i, j] *= slope
