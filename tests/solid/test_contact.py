"""Contact between folds: derivatives of the energy, plates, a bellows that is pressed together."""

import math

import numpy as np
import pytest
from rubber_walls import C1, drawing

from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.solid.contact import SOFT, STIFFNESS, add_contact, contact_energy
from wm_drake.solid.curves import AXIAL, curve
from wm_drake.solid.equilibrium import Solver
from wm_drake.solid.mesh import half_ring, wedge
from wm_drake.solid.touching import AREA, DEPTH, Faces

EPSILON = STIFFNESS * 2.0 * C1
"""Stiffness of the contact times the thickness. [Pa]"""


@pytest.fixture(scope="module")
def bellows():
    """Return the shipped bellows."""
    return load_gasket_drawing("bellows")


def pressed(ring, share):
    """Return displacements that move all parts of a wall along y towards each other. (nodes, 3)"""
    u = np.zeros_like(ring.positions)
    u[:, 1] = -share * ring.positions[:, 1]
    return u


def forces_of(ring, u):
    """Return forces and stiffness of the contact on all nodes. (unknowns,), (unknowns, unknowns)"""
    faces, size = Faces(ring), u.size
    touching = faces.touching(u)
    band, rhs, forces = np.zeros((size, size)), np.zeros(size), np.zeros_like(u)
    free = np.arange(size).reshape(u.shape)
    add_contact(touching.rows, touching.curves, faces.numbers, ring.positions + u,
                np.zeros_like(u), free, EPSILON, band, rhs, forces)  # fmt: skip
    assert rhs == pytest.approx(-forces.ravel(), abs=1e-12)
    lower = np.zeros((size, size))
    for shift in range(size):
        np.fill_diagonal(lower[shift:], band[shift, : size - shift])
    return forces.ravel(), lower + np.tril(lower, -1).T


def test_force_and_stiffness_are_derivatives_of_the_energy(bellows):
    """Also where the wall is twisted, which turns the radii of its nodes."""
    ring, rng = wedge(bellows, 10), np.random.default_rng(1)
    u = pressed(ring, 0.62) + 2e-4 * rng.standard_normal(ring.positions.shape)
    u[:, 2] += 0.1 * ring.positions[:, 1]
    faces, h = Faces(ring), 1e-9
    assert 6 < len(faces.touching(u).rows) < 40
    f, K = forces_of(ring, u)
    for _ in range(4):
        way = rng.standard_normal(u.shape)
        ends = [u + side * h * way for side in (1.0, -1.0)]
        energies = [contact_energy(faces.touching(at).rows, EPSILON) for at in ends]
        rise = (energies[0] - energies[1]) / (2.0 * h)
        assert rise == pytest.approx(f @ way.ravel(), rel=1e-4, abs=1e-6 * np.abs(f).sum())
        change = (forces_of(ring, ends[0])[0] - forces_of(ring, ends[1])[0]) / (2.0 * h)
        assert np.abs(change - K @ way.ravel()).max() < 1e-4 * np.abs(change).max()


def test_forces_are_in_balance(bellows):
    """A point and the opposite face push each other: no force along y, no power of a turn."""
    ring = wedge(bellows, 10)
    f, _ = forces_of(ring, pressed(ring, 0.62))
    forces = f.reshape(-1, 3)
    assert np.abs(forces).max() > 0.0
    assert forces[:, 1].sum() == pytest.approx(0.0, abs=1e-12 * np.abs(forces).sum())
    assert np.abs(forces[:, 2]).max() == 0.0


def test_two_plates_are_pressed_by_the_law_of_the_depth():
    """Compare the energy of two parallel washers with that of their depth times their area."""
    t, gap, inner, outer = 0.002, 0.008, 0.1, 0.14
    whole = drawing((inner, 0.0, t), (outer, 0.0, t), (outer, gap, t), (inner, gap, t), fillet=3e-3)
    ring = wedge(whole, 40)
    for depth in (0.005 * t, 0.05 * t):
        u = np.zeros_like(ring.positions)
        u[ring.positions[:, 1] > 0.5 * gap, 1] = -(gap - t + depth)
        touching = Faces(ring).touching(u)
        flat = touching.places[:, 0] < outer - 0.006
        rows = touching.rows[flat]
        assert rows[:, DEPTH] == pytest.approx(depth, rel=1e-6)
        area = math.pi * ((outer - 0.006) ** 2 - inner**2)
        assert ring.copies * rows[:, AREA].sum() == pytest.approx(area, rel=0.02)
        e, d0 = EPSILON / t, SOFT * t
        exact = e * (0.5 * depth**2 - 0.5 * depth * d0 + d0**2 / 6.0)
        if depth < d0:
            exact = e * depth**3 / (6.0 * d0)
        assert contact_energy(rows, EPSILON) == pytest.approx(exact * rows[:, AREA].sum(), rel=1e-5)


def test_half_a_ring_has_the_contact_of_a_wedge(bellows):
    rings = wedge(bellows, 10), half_ring(bellows, 10, 3)
    parts = [Faces(ring).touching(pressed(ring, 0.62)) for ring in rings]
    energies = [ring.copies * contact_energy(part.rows, EPSILON)
                for ring, part in zip(rings, parts, strict=True)]  # fmt: skip
    assert energies[0] > 0.0
    assert energies[1] == pytest.approx(energies[0], rel=1e-9)
    assert len(parts[1].in_column(2).rows) == len(parts[0].rows)


def test_equilibrium_of_half_a_ring_with_contact_is_that_of_a_wedge(bellows):
    """Also the unknowns that are numbered cut by cut while folds touch."""
    ends = []
    for ring in (wedge(bellows, 12), half_ring(bellows, 12, 3)):
        solver, solved = Solver(ring, bellows.rubber, True), None
        for value in (-0.01, -0.02, -0.03, -0.035, -0.04):
            rim = AXIAL.of_rim(ring, value)
            start = solved or solver.at_rest()
            for part in np.linspace(0.25, 1.0, 4):
                between = start.u[ring.moved] + part * (rim - start.u[ring.moved])
                solved = solver.solve(between, solved or start)
        assert solver.touching(solved.u) is not None
        ends.append((ring.copies * solved.forces[ring.moved, 1].sum(), solved.energy))
    assert ends[1] == pytest.approx(ends[0], rel=5e-3)


def test_a_bellows_stiffens_as_its_folds_touch(bellows):
    """Work is energy, the folds stay apart within 5 % of the wall, both halves are alike."""
    ring = wedge(bellows, 16)
    fine, coarse = 1e-3 * np.arange(1.0, 41.0), 1e-3 * np.array([10.0, 20.0, 30.0, 39.0, 40.0])
    held, free = (
        curve(Solver(ring, bellows.rubber, contact), AXIAL, values.tolist(), lambda _: None)
        for contact, values in ((True, fine), (False, coarse))
    )
    faces = Faces(ring)
    apart, overlapping = (faces.touching(each.points[0].u) for each in (held, free))
    assert held.stopped == free.stopped == ""
    assert overlapping.depth > 0.2
    assert 0.0 < apart.depth < 0.05
    slopes = [np.diff(each.wrench())[0] / np.diff(each.values)[0] for each in (held, free)]
    assert slopes[0] > 4.0 * slopes[1]
    assert held.work_error() < 5e-4
    assert held.wrench()[-1] == pytest.approx(free.wrench()[-1], rel=1e-6)
    u = held.points[0].u[ring.grid[:, 0]]
    mirrored = u[::-1]
    assert u[..., 0] == pytest.approx(mirrored[..., 0], abs=1e-6)
    assert u[..., 1] + mirrored[..., 1] == pytest.approx(held.values[0], abs=1e-6)
