"""Element of 27 nodes for nearly incompressible rubber in large deformation.

Displacements are quadratic. The change of volume J - 1 enters by its projection on polynomials of
degree one within the element, so the pressure has four numbers, which are eliminated here: the
element Q2/P-1, which does not lock (Sussman and Bathe, Computers & Structures 26 (1987) 357). With
q the four polynomials and κ the bulk modulus:

    p = κ q^T M^-1 g,   g = ∫ q (J - 1) dV,   M = ∫ q q^T dV
    U = ∫ W dV + κ/2 g^T M^-1 g
"""

import itertools

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.parameters.types import FloatArray
from wm_drake.solid.rubber import determinant, energy, inverse_of, write_stress

NODES, UNKNOWNS = 27, 81
"""Nodes of an element, and unknowns. Node 9 i + 3 j + k is the i-th along the first direction."""

FLAT = 0.0
"""A determinant of the deformation gradient at or below this turns the element inside out."""


def _quadratic(x: float) -> tuple[FloatArray, FloatArray]:
    """Return the three quadratic polynomials of Lagrange on -1, 0, 1, and their derivatives."""
    values = np.array([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)])
    return values, np.array([x - 0.5, -2.0 * x, x + 0.5])


def _reference() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return gradients of the shape functions, weights and linear polynomials at Gauss points."""
    places, factors = np.polynomial.legendre.leggauss(3)
    gradients, weights, linear = [], [], []
    for i, j, k in itertools.product(range(3), repeat=3):
        point = places[[i, j, k]]
        (a, da), (b, db), (c, dc) = map(_quadratic, point)
        parts = [np.einsum("i,j,k", *each).ravel() for each in ((da, b, c), (a, db, c), (a, b, dc))]
        gradients.append(np.stack(parts, axis=1))
        weights.append(factors[i] * factors[j] * factors[k])
        linear.append([1.0, *point])
    return np.array(gradients), np.array(weights), np.array(linear)


GRADIENTS, WEIGHTS, LINEAR = _reference()
"""At each of 27 Gauss points: (27, 27, 3), (27,), (27, 4)."""


@long_running
def _gradient(gradients, place):
    """Return the gradient of a field at a Gauss point, whose values at the nodes are given."""
    return np.ascontiguousarray(place.T) @ gradients


@long_running
def element_energy(X, u, c, bulk_modulus):
    """Return the strain energy of an element. [J]

    Args:
        X: Places of the nodes as drawn. (27, 3) [m]
        u: Their displacements. (27, 3) [m]
        c: Constants of Yeoh. (3,) [Pa]
        bulk_modulus: Bulk modulus. [Pa]
    """
    total, g, M = 0.0, np.zeros(4), np.zeros((4, 4))
    for point in range(NODES):
        to_reference = _gradient(GRADIENTS[point], X)
        weight = WEIGHTS[point] * determinant(to_reference)
        F = np.eye(3) + _gradient(GRADIENTS[point] @ inverse_of(to_reference), u)
        total += weight * energy(F, c)
        g += weight * LINEAR[point] * (determinant(F) - 1.0)
        M += weight * np.outer(LINEAR[point], LINEAR[point])
    return total + 0.5 * bulk_modulus * g @ np.linalg.solve(M, g)


@long_running
def write_element(X, u, c, bulk_modulus, f, K):
    """Write force and stiffness of an element, the derivatives of `element_energy`.

    Args:
        X, u, c, bulk_modulus: As in `element_energy`.
        f: Receives the forces on the nodes. (81,) [N]
        K: Receives the stiffness. (81, 81) [N/m]

    Returns:
        Whether no point of the element is turned inside out; if one is, the rest is not written.
    """
    f[:], K[:] = 0.0, 0.0
    g, M = np.zeros(4), np.zeros((4, 4))
    volume_force = np.zeros((4, UNKNOWNS))
    kept_gradient, kept_inverse = np.zeros((NODES, NODES, 3)), np.zeros((NODES, 3, 3))
    kept_weight, kept_F, kept_J = np.zeros(NODES), np.zeros((NODES, 3, 3)), np.zeros(NODES)
    for point in range(NODES):
        to_reference = _gradient(GRADIENTS[point], X)
        weight = WEIGHTS[point] * determinant(to_reference)
        gradient = GRADIENTS[point] @ inverse_of(to_reference)
        F = np.eye(3) + _gradient(gradient, u)
        J = determinant(F)
        if not J > FLAT:
            return False
        inverse = inverse_of(F)
        of_volume = (J * weight) * (gradient @ inverse)
        for m in range(4):
            q = LINEAR[point, m]
            g[m] += weight * q * (J - 1.0)
            for a in range(NODES):
                for i in range(3):
                    volume_force[m, 3 * a + i] += q * of_volume[a, i]
            for n in range(4):
                M[m, n] += weight * q * LINEAR[point, n]
        kept_gradient[point], kept_inverse[point], kept_F[point] = gradient, inverse, F
        kept_weight[point], kept_J[point] = weight, J
    pressures = bulk_modulus * np.linalg.solve(M, g)
    P, A, half = np.zeros((3, 3)), np.zeros((3, 3, 3, 3)), np.zeros((3, 3, 3))
    for point in range(NODES):
        gradient, inverse, J = kept_gradient[point], kept_inverse[point], kept_J[point]
        write_stress(kept_F[point], inverse, J, c, P, A)
        _add_pressure(LINEAR[point] @ pressures, inverse, J, P, A)
        _add_point(gradient, kept_weight[point], P, A, half, f, K)
    K += bulk_modulus * volume_force.T @ np.linalg.solve(M, volume_force)
    return True


@long_running
def _add_pressure(pressure, inverse, J, P, A):
    """Add stress p J F^-T of a pressure, and its derivative at constant pressure."""
    for i in range(3):
        for j in range(3):
            P[i, j] += pressure * J * inverse[j, i]
            for k in range(3):
                for n in range(3):
                    A[i, j, k, n] += (
                        pressure
                        * J
                        * (inverse[n, k] * inverse[j, i] - inverse[n, i] * inverse[j, k])
                    )


@long_running
def _add_point(gradient, weight, P, A, half, f, K):
    """Add force and stiffness of a Gauss point; `half` is a scratch array. (3, 3, 3)"""
    for a in range(NODES):
        for i in range(3):
            force = 0.0
            for j in range(3):
                force += P[i, j] * gradient[a, j]
            f[3 * a + i] += weight * force
            for k in range(3):
                for n in range(3):
                    part = 0.0
                    for j in range(3):
                        part += gradient[a, j] * A[i, j, k, n]
                    half[i, k, n] = weight * part
        for b in range(NODES):
            for i in range(3):
                for k in range(3):
                    K[3 * a + i, 3 * b + k] += (
                        half[i, k, 0] * gradient[b, 0]
                        + half[i, k, 1] * gradient[b, 1]
                        + half[i, k, 2] * gradient[b, 2]
                    )
