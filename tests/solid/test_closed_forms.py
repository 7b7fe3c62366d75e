"""Rubber against closed forms: patch test, tube, bonded bush; convergence, locking, derivatives."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rubber_walls import C1, SHEAR, antisymmetric, bush, drawing

from wm_drake.solid import curves, equilibrium
from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST, Gasket, Mesh, curve
from wm_drake.solid.deformed import deformed, wrinkles
from wm_drake.solid.element import UNKNOWNS, element_energy, write_element
from wm_drake.solid.equilibrium import Solver
from wm_drake.solid.mesh import half_ring, wedge

YEOH = np.array([0.3e6, 0.05e6, 0.02e6])


def cube(rng, size=0.01):
    """Return the nodes of an element: a distorted cube. (27, 3) [m]"""
    places = np.stack(np.meshgrid(*3 * [[-1.0, 0.0, 1.0]], indexing="ij"), axis=-1).reshape(-1, 3)
    return size * (places + 0.08 * rng.uniform(-1.0, 1.0, places.shape))


def test_force_and_stiffness_are_derivatives_of_the_energy():
    rng = np.random.default_rng(1)
    X, bulk, h = cube(rng), 300e6, 1e-7
    u = 1e-3 * rng.uniform(-1.0, 1.0, X.shape)
    f, K = np.zeros(UNKNOWNS), np.zeros((UNKNOWNS, UNKNOWNS))
    assert write_element(X, u, YEOH, bulk, f, K)
    K = K.copy()
    assert np.abs(K - K.T).max() < 1e-9 * np.abs(K).max()
    for _ in range(4):
        way = rng.standard_normal(X.shape)
        energies = [element_energy(X, u + side * h * way, YEOH, bulk) for side in (1.0, -1.0)]
        force = [np.zeros(UNKNOWNS), np.zeros(UNKNOWNS)]
        for side, written in zip((1.0, -1.0), force, strict=True):
            write_element(X, u + side * h * way, YEOH, bulk, written, K.copy())
        assert (energies[0] - energies[1]) / (2.0 * h) == pytest.approx(
            f @ way.ravel(), rel=1e-5, abs=1e-6 * np.abs(f).sum()
        )
        change = (force[0] - force[1]) / (2.0 * h)
        assert np.abs(change - K @ way.ravel()).max() < 1e-5 * np.abs(change).max()


def test_patch_of_distorted_elements_has_one_stress():
    """A homogeneous stretch without change of volume has no force at the inner node."""
    rng = np.random.default_rng(2)
    X = cube(rng)
    stretch = 1.3
    F = np.diag([stretch, stretch**-0.5, stretch**-0.5])
    F[0, 1] = 0.2
    u = X @ (F - np.eye(3)).T
    f, K = np.zeros(UNKNOWNS), np.zeros((UNKNOWNS, UNKNOWNS))
    assert write_element(X, u, YEOH, 300e6, f, K)
    forces = f.reshape(27, 3)
    assert np.abs(forces[13]).max() < 1e-10 * np.abs(forces).max()
    invariant = float(np.sum(F * F)) - 3.0
    exact = _volume(X) * float(np.polyval([*YEOH[::-1], 0.0], invariant))
    assert element_energy(X, u, YEOH, 300e6) == pytest.approx(exact, rel=1e-12)


def _volume(X):
    from wm_drake.solid.element import GRADIENTS, WEIGHTS

    return float(WEIGHTS @ np.linalg.det(np.einsum("qna,nb->qab", GRADIENTS, X)))


def test_a_turned_element_has_no_energy_and_an_inverted_one_is_refused():
    X = cube(np.random.default_rng(3))
    c, s = math.cos(1.0), math.sin(1.0)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    f, K = np.zeros(UNKNOWNS), np.zeros((UNKNOWNS, UNKNOWNS))
    assert write_element(X, X @ (R - np.eye(3)).T, YEOH, 300e6, f, K)
    assert np.abs(f).max() < 1e-9 * np.abs(K).max() * 0.01
    assert not write_element(X, X @ np.diag([-2.0, 0.0, 0.0]), YEOH, 300e6, f, K)


@pytest.mark.parametrize("angle", [0.05, 0.6])
def test_bonded_bush_in_torsion(angle):
    """T = 4 pi mu L angle / (1/a^2 - 1/b^2), exact for a Neo-Hookean bush (Rivlin 1949)."""
    a, b, length = 0.01, 0.02, 0.03
    solved = curve(Solver(wedge(bush(a, b, length), 8), bush(a, b, length).rubber), TWIST,
                   [0.5 * angle, angle], lambda _: None)  # fmt: skip
    exact = 4.0 * math.pi * SHEAR * length * angle / (a**-2.0 - b**-2.0)
    assert solved.stopped == ""
    assert solved.wrench()[-1] == pytest.approx(exact, rel=0.012)  # free faces bulge a little


def test_bonded_bush_in_torsion_converges_with_the_order_of_its_elements():
    """Half the size: the error of the energy falls by 2^4 in small deformation."""
    a, b, length, angle = 0.01, 0.02, 0.03, 1e-5
    exact = 4.0 * math.pi * SHEAR * length * angle / (a**-2.0 - b**-2.0)
    errors = []
    for elements in (2, 4, 8):
        whole = bush(a, b, length)
        solved = curve(Solver(wedge(whole, elements), whole.rubber), TWIST, [angle], lambda _: None)
        errors.append(solved.wrench()[-1] / exact - 1.0)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert abs(errors[-1]) < 2e-4
    assert np.all(orders > 3.5)


@pytest.mark.parametrize("bulk", [50.0, 5000.0, 500000.0])
def test_bonded_bush_in_axial_shear_does_not_lock(bulk):
    """F = 2 pi mu L d / ln(b/a) of a long bush; the faces of this one bend, which softens it."""
    a, b, length, d = 0.04, 0.05, 0.1, 1e-5
    whole = bush(a, b, length, bulk * SHEAR)
    solved = curve(Solver(wedge(whole, 6), whole.rubber), AXIAL, [d], lambda _: None)
    exact = 2.0 * math.pi * SHEAR * length * d / math.log(b / a)
    assert solved.wrench()[-1] == pytest.approx(exact, rel=0.04)


def test_stretched_tube_is_uniaxial_tension():
    """A long thin tube: F = A mu (s - 1/s^2) away from its rims; its rims are stiffer."""
    radius, thickness, length = 0.02, 0.001, 0.2
    whole = drawing((radius, 0.0, thickness), (radius, length, thickness))
    stretch = 1.25
    solved = curve(
        Solver(wedge(whole, 24), whole.rubber),
        AXIAL,
        [0.125 * length, 0.25 * length],
        lambda _: None,
    )
    area = 2.0 * math.pi * radius * thickness
    exact = area * SHEAR * (stretch - stretch**-2.0)
    assert exact < solved.wrench()[-1] < 1.04 * exact
    # rims that cannot contract: pure shear, s - 1/s^3, bounds the force from above
    assert solved.wrench()[-1] < area * SHEAR * (stretch - stretch**-3.0)


def test_thin_tube_in_torsion_and_shear():
    """K_Ty = 2 pi R^3 t mu / L, and the radial force of a ring of membranes, pi R t mu / L."""
    radius, thickness, length = 0.16, 0.002, 0.05
    whole = drawing((radius, 0.0, thickness), (radius, length, thickness))
    gasket = Gasket(whole, Mesh(4, 8))
    twist = gasket.curve(TWIST, [1e-4], lambda _: None).slope_at_rest()
    assert twist == pytest.approx(2.0 * math.pi * radius**3 * thickness * SHEAR / length, rel=2e-3)
    radial = gasket.curve(RADIAL, [1e-5], lambda _: None).slope_at_rest()
    membrane = math.pi * radius * thickness * SHEAR / length
    assert 0.85 * membrane < radial < 1.1 * membrane


@pytest.fixture(scope="module")
def wave():
    """Return a coarse bellows with its gasket."""
    wavy = drawing((0.16, 0.0, 0.0025), (0.162, 0.015, 0.0025), (0.16, 0.03, 0.0025))
    return wavy, Gasket(wavy, Mesh(4, 4))


@pytest.mark.parametrize("motion", [AXIAL, RADIAL, TWIST, TILT])
def test_work_of_the_rim_is_the_energy(wave, motion):
    largest = 0.02 if motion.rotates else 0.003
    solved = wave[1].curve(motion, (largest * np.array([0.25, 0.5, 0.75, 1.0])).tolist(),
                           lambda _: None)  # fmt: skip
    assert solved.work_error() < 1e-3
    if motion.is_mirrored:
        assert solved.wrench()[::-1] == pytest.approx(-solved.wrench(), rel=1e-12)
        assert solved.wrench(1)[::-1] == pytest.approx(solved.wrench(1), rel=1e-12)


def test_mirror_image_is_an_equilibrium(wave):
    """Check that what is taken as the opposite motion is what the solver finds there."""
    ring = half_ring(wave[0], 4, 4)
    solver = Solver(ring, wave[0].rubber)
    for motion, largest in ((RADIAL, 0.002), (TILT, 0.01)):
        backward = curve(solver, motion, [largest], lambda _: None).points[0]
        solved = solver.solve(motion.of_rim(ring, -largest), solver.at_rest())
        assert np.abs(solved.u - backward.u).max() < 1e-7
        assert curves._wrench(ring, motion, -largest, solved) == pytest.approx(
            backward.wrench, rel=1e-5, abs=1e-6
        )


def test_x_and_z_are_alike_and_the_coupling_has_a_potential(wave):
    """A ring turned by 90 degrees: same stiffness; moment per displacement is force per angle."""
    gasket = wave[1]
    radial = gasket.curve(RADIAL, [1e-5], lambda _: None)
    tilt = gasket.curve(TILT, [1e-4], lambda _: None)
    assert radial.slope_at_rest(TILT.component) == pytest.approx(
        tilt.slope_at_rest(RADIAL.component), rel=1e-5
    )
    ring = half_ring(wave[0], 4, 4)
    across = replace(ring, locked=antisymmetric(ring))  # displacement along z, plane z = 0
    solver, along_z = Solver(across, wave[0].rubber), np.zeros((len(ring.moved), 3))
    along_z[:, 2] = 1e-5
    solved = solver.solve(along_z, solver.at_rest())
    force = 2.0 * solved.forces[ring.moved, 2].sum()
    assert force / 1e-5 == pytest.approx(radial.slope_at_rest(), rel=1e-6)


def test_axial_and_twist_of_a_wedge_are_those_of_half_a_ring(wave):
    ring = half_ring(wave[0], 4, 6)
    whole = curve(Solver(ring, wave[0].rubber), AXIAL, [1e-4], lambda _: None)
    thin = curve(Solver(wedge(wave[0], 4), wave[0].rubber), AXIAL, [1e-4], lambda _: None)
    assert whole.slope_at_rest() == pytest.approx(thin.slope_at_rest(), rel=3e-3)


def test_shift_finds_the_way_down_where_the_stiffness_is_not_positive():
    band = np.array([[2.0, -1.0, 3.0], [0.0, 0.0, 0.0]])
    rhs = np.array([1.0, 1.0, 1.0])
    solution, is_stable = equilibrium._downhill(band.copy(), rhs)
    assert not is_stable
    assert solution @ rhs > 0.0
    assert equilibrium._downhill(np.abs(band), rhs)[1]


def test_stretch_and_stress_of_a_tube_and_wrinkles():
    whole = drawing((0.1, 0.0, 0.001), (0.1, 0.1, 0.001))
    ring = wedge(whole, 4)
    y = ring.positions[:, 1]
    u = np.zeros_like(ring.positions)
    u[:, 1] = 0.2 * y  # stretched by 1.2 with its radius kept
    state = deformed(ring, whole.rubber, u)
    assert state.stretch == pytest.approx(1.2, rel=1e-9)
    b = np.diag([1.0, 1.44, 1.0]) * 1.2 ** (-2.0 / 3.0)
    deviator = 2.0 * C1 / 1.2 * (b - np.trace(b) / 3.0 * np.eye(3))
    assert state.stress == pytest.approx(math.sqrt(1.5 * np.sum(deviator**2)), rel=1e-9)
    half = half_ring(whole, 2, 8)
    waves = np.zeros_like(half.positions)
    angle = np.arctan2(half.positions[:, 2], half.positions[:, 0])
    waves[:, 1] = np.cos(angle) + 0.2 * np.cos(6.0 * angle)
    assert wrinkles(half, waves) == pytest.approx(0.2 / 1.2, rel=1e-6)
