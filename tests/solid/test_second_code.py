"""The same elements in a second code, felupe: force and displacement of each motion agree.

felupe (GPL) is a tool of this test only. Its three fields are displacement, pressure and change of
volume; with polynomials of degree one for the last two, it has the elements of `wm_drake.solid`.
"""

from dataclasses import replace

import numpy as np
import pytest
from rubber_walls import SHEAR, antisymmetric, drawing

from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST
from wm_drake.solid.equilibrium import Solver
from wm_drake.solid.mesh import half_ring

fem = pytest.importorskip("felupe")

WAVE = drawing((0.16, 0.0, 0.0025), (0.162, 0.015, 0.0025), (0.16, 0.03, 0.0025))


def second_solution(ring, rim, bulk):
    """Return displacements and forces of the nodes in felupe. (nodes, 3) [m], [N]"""
    order = ((fem.TriQuadraticHexahedron().points + 1.0) @ [9, 3, 1]).astype(int)
    mesh = fem.Mesh(ring.positions, ring.nodes[:, order], "hexahedron27")
    region = fem.RegionTriQuadraticHexahedron(mesh)
    linear = fem.Region(
        mesh.dual(points_per_cell=4, disconnect=True), fem.Tetra(), region.quadrature, grad=False
    )
    fields = fem.FieldContainer(
        [fem.Field(region, dim=3), fem.Field(linear), fem.Field(linear, values=1.0)]
    )
    rubber = fem.ThreeFieldVariation(fem.NeoHooke(mu=SHEAR, bulk=bulk))
    body = fem.SolidBody(rubber, fields)
    given = ring.locked.copy()
    given[ring.clamped] = given[ring.moved] = True
    target = np.zeros_like(ring.positions)
    target[ring.moved] = rim
    unknown, known = np.flatnonzero(~given.ravel()), np.flatnonzero(given.ravel())
    rest = np.arange(target.size, sum(field.values.size for field in fields.fields))
    fem.newtonraphson(
        items=[body],
        dof0=known,
        dof1=np.concatenate([unknown, rest]),
        ext0=target.ravel()[known],
        verbose=0,
        tol=1e-10,
    )
    forces = body.assemble.vector().toarray()[: target.size].reshape(-1, 3)
    return fields[0].values, forces


@pytest.mark.parametrize(
    ("motion", "value"), [(AXIAL, 2e-3), (RADIAL, 2e-3), (TILT, 0.01), (TWIST, 1e-3)]
)
def test_force_and_displacement_agree(motion, value):
    ring = half_ring(WAVE, 4, 4)
    if motion is TWIST:  # mirrored with the other sign: right for small angles
        ring = replace(ring, locked=antisymmetric(ring))
    rim = motion.of_rim(ring, value)
    solver = Solver(ring, WAVE.rubber)
    ours = solver.solve(rim, solver.at_rest())
    u, forces = second_solution(ring, rim, WAVE.rubber.bulk)
    assert np.abs(ours.u - u).max() < 1e-5 * np.abs(rim).max()
    assert ours.forces[ring.moved].ravel() == pytest.approx(
        forces[ring.moved].ravel(), abs=1e-5 * np.abs(forces).max()
    )
