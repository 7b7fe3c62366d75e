"""Bonded bushes against exact solutions: radial and axial shear, an inflated tube, the tangent."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rubber_walls import SHEAR, bush

from wm_drake.solid.curves import AXIAL, RADIAL, curve
from wm_drake.solid.equilibrium import Solved, Solver
from wm_drake.solid.mesh import half_ring, wedge
from wm_drake.solid.rubber import determinant, energy, inverse_of, write_stress

YEOH = np.array([0.3e6, 0.05e6, 0.02e6])


def radial_stiffness(a, b, length, kappa):
    """Return the radial stiffness of a bush between radii a and b. [N/m]

    K = 2 pi mu L k (k + 1) / (k^2 ln(b/a) - (b^2 - a^2)/(b^2 + a^2)), with Muskhelishvili's number
    k: 3 - 4 nu in plane strain, (3 - nu)/(1 + nu) in plane stress. For nu = 1/2 these are the long
    and the short bush of Adkins and Gent, British Journal of Applied Physics 5 (1954) 354.
    """
    ratio = (b**2 - a**2) / (b**2 + a**2)
    whole = kappa * (kappa + 1.0) / (kappa**2 * math.log(b / a) - ratio)
    return 2.0 * math.pi * SHEAR * length * whole


def locked(ring, *directions):
    """Return a ring whose nodes do not move in some directions."""
    without = ring.locked.copy()
    without[:, directions] = True
    return replace(ring, locked=without)


@pytest.mark.slow
@pytest.mark.parametrize("bulk", [500.0, 5000.0, 500000.0])
def test_long_bush_in_radial_shear_does_not_lock(bulk):
    """Poisson's ratio 0.499, 0.4999, 0.499999: rubber that cannot give way but around."""
    a, b, length = 0.01, 0.02, 0.005
    whole = bush(a, b, length, bulk * SHEAR)
    ring = locked(half_ring(whole, 4, 5), 1)
    solved = curve(Solver(ring, whole.rubber), RADIAL, [1e-6], lambda _: None)
    poisson = (3.0 * bulk - 2.0) / (6.0 * bulk + 2.0)
    exact = radial_stiffness(a, b, length, 3.0 - 4.0 * poisson)
    assert solved.slope_at_rest() == pytest.approx(exact, rel=1e-3)


def test_short_bush_in_radial_shear():
    """Plane stress of a bush that is short against its rubber, whose rims keep their thickness."""
    a, b, length = 0.01, 0.02, 0.0001
    whole = bush(a, b, length, 5000.0 * SHEAR)
    solved = curve(Solver(half_ring(whole, 16, 5), whole.rubber), RADIAL, [1e-7], lambda _: None)
    exact = radial_stiffness(a, b, length, 5.0 / 3.0)
    assert exact < solved.slope_at_rest() < 1.01 * exact


def test_axial_shear_is_linear_in_large_deformation():
    """F = 2 pi mu L d / ln(b/a) of a Neo-Hookean bush, exact for any d while radii are kept."""
    a, b, length = 0.01, 0.02, 0.005
    whole = bush(a, b, length, 5000.0 * SHEAR)
    ring = locked(wedge(whole, 6), 0, 2)
    solved = curve(Solver(ring, whole.rubber), AXIAL, [1e-4, 5e-3, 1e-2], lambda _: None)
    exact = 2.0 * math.pi * SHEAR * length / math.log(b / a)
    assert solved.stopped == ""
    assert solved.wrench()[4:] == pytest.approx(exact * solved.values[4:], rel=1e-4)


def test_inflated_tube():
    """A thick tube whose inner radius grows by half, in plane strain; any pressure may be added.

    s_r(b) - s_r(a) = ∫ mu (l^2 - 1/l^2) dr/r,   l = r/R,  r^2 = R^2 + a^2 - A^2    (Rivlin 1949)
    """
    A, B, length = 0.01, 0.02, 0.005
    whole = bush(A, B, length, 5000.0 * SHEAR)
    ring = locked(wedge(whole, 8), 1, 2)
    a = 1.5 * A
    R = ring.positions[:, 0]
    u = np.zeros_like(ring.positions)
    u[:, 0] = np.sqrt(R**2 + a**2 - A**2) - R
    disturbed = u.copy()
    inside = ~np.isin(np.arange(len(u)), [*ring.clamped, *ring.moved])
    disturbed[inside, 0] *= 0.98
    solver = Solver(ring, whole.rubber)
    solved = solver.solve(u[ring.moved], Solved(disturbed, u, 0.0))
    assert solved.u == pytest.approx(u, abs=2e-6)
    b = math.sqrt(B**2 + a**2 - A**2)
    stresses = [
        sign * ring.copies * solved.forces[rim, 0].sum() / (2.0 * math.pi * radius * length)
        for rim, radius, sign in ((ring.clamped, a, -1.0), (ring.moved, b, 1.0))
    ]
    r, weights = np.polynomial.legendre.leggauss(40)
    r = 0.5 * (a + b) + 0.5 * (b - a) * r
    stretch = r / np.sqrt(r**2 - a**2 + A**2)
    exact = 0.5 * (b - a) * weights @ (SHEAR * (stretch**2 - stretch**-2.0) / r)
    assert stresses[1] - stresses[0] == pytest.approx(exact, rel=2e-3)


def test_stress_and_tangent_by_complex_step():
    """Without differences: imaginary parts of the energy and of the stress are the derivatives."""
    rng = np.random.default_rng(4)
    F, h = np.eye(3) + 0.3 * rng.uniform(-1.0, 1.0, (3, 3)), 1e-30
    real = np.zeros((3, 3)), np.zeros((3, 3, 3, 3))
    write_stress(F, inverse_of(F), determinant(F), YEOH, *real)
    for i, j in np.ndindex(3, 3):
        moved = F.astype(complex)
        moved[i, j] += 1j * h
        assert energy.py_func(moved, YEOH).imag / h == pytest.approx(real[0][i, j], rel=1e-12)
        inverse = np.linalg.inv(moved)
        P, A = np.zeros((3, 3), dtype=complex), np.zeros((3, 3, 3, 3), dtype=complex)
        write_stress.py_func(moved, inverse, np.linalg.det(moved), YEOH, P, A)
        largest = np.abs(real[1]).max()
        assert P.imag / h == pytest.approx(real[1][:, :, i, j], rel=1e-11, abs=1e-12 * largest)
