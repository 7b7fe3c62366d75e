"""Contact between folds: points of the faces of the wall are held off opposite faces.

Own derivation. The energy per area is a polynomial of the depth d = -g > 0 (gap g of `touching`)
with a stiffness ε that grows from zero over the depth d0, so that the force has no corner where a
point begins to touch:

    E = ε d^3 / (6 d0),  d < d0;    E = ε (d^2/2 - d d0/2 + d0^2/6) beyond

Force and stiffness are its exact derivatives. With r = x_s - x(σ), t = x'/|x'|, κ = n · x'',

    δg  = n · δr,   δr = δx_s - δx(σ)
    δ²g = -(κ (t·δr)² + 2 |x'| (t·δr)(n·δx') + g (n·δx')²) / (|x'|² - g κ)

because σ makes the distance stationary. Each face is held off the other, with half of the energy
for each. Sliding has no friction.
"""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.solid.touching import (
    AREA,
    COLUMN,
    DEPTH,
    FACE,
    OTHER_FACE,
    OTHER_PLACE,
    PLACE,
    THICKNESS,
    on_curve,
    outward_normal,
    write_spline,
)

STIFFNESS = 20.0
"""Stiffness ε, in shear moduli by the thickness (assumption): walls that press each other with half
the shear modulus sink in by 3 % of the thickness."""

SOFT = 0.01
"""Depth d0 in thicknesses (assumption): a fifth of what is allowed in the checks."""


@long_running
def _law(depth, stiffness, wall):
    """Return energy per area, pressure and stiffness at a depth. [J/m^2], [Pa], [Pa/m]"""
    e, soft = stiffness / wall, SOFT * wall
    if depth < soft:
        return e * depth**3 / (6.0 * soft), e * depth**2 / (2.0 * soft), e * depth / soft
    energy = e * (0.5 * depth**2 - 0.5 * depth * soft + soft**2 / 6.0)
    return energy, e * (depth - 0.5 * soft), e


@long_running
def contact_energy(touching, stiffness):
    """Return the energy of touching points; the stiffness ε times the thickness is in Pa. [J]"""
    total = 0.0
    for row in touching:
        total += row[AREA] * _law(row[DEPTH], stiffness, row[THICKNESS])[0]
    return total


@long_running
def _write_touching(row, curve, other, stiffness, values, f, K):
    """Write force and stiffness of a touching point on its four nodes and the four opposite ones.

    Args:
        row: The touching point.
        curve, other: Nodes of its face and of the opposite one. (n, 2) [m]
        stiffness: Stiffness ε times the thickness. [Pa]
        values: Scratch of two splines. (2, 3, 4)
        f: Receives the forces along radius and y. (8, 2) [N]
        K: Receives the stiffness. (8, 2, 8, 2) [N/m]

    Returns:
        First node of the point, and of the opposite one.
    """
    points = np.zeros((3, 2))
    first = write_spline(row[PLACE], len(curve), values[0])
    second = write_spline(row[OTHER_PLACE], len(other), values[1])
    on_curve(other, row[OTHER_PLACE], values[1], points)
    size = np.sqrt(points[1] @ points[1])
    n, t, gap = outward_normal(int(row[OTHER_FACE]), points[1]), points[1] / size, -row[DEPTH]
    curvature = n @ points[2]
    along, across, turned = np.zeros((8, 2)), np.zeros((8, 2)), np.zeros((8, 2))
    for k in range(4):
        for i in range(2):
            across[k, i], across[4 + k, i] = values[0, 0, k] * n[i], -values[1, 0, k] * n[i]
            along[k, i], along[4 + k, i] = values[0, 0, k] * t[i], -values[1, 0, k] * t[i]
            turned[4 + k, i] = values[1, 1, k] * n[i]
    _, pressure, slope = _law(row[DEPTH], stiffness, row[THICKNESS])
    pressure, slope = row[AREA] * pressure, row[AREA] * slope
    by = pressure / (size**2 - gap * curvature)
    for a in range(8):
        for i in range(2):
            f[a, i] = -pressure * across[a, i]
            for b in range(8):
                for k in range(2):
                    K[a, i, b, k] = slope * across[a, i] * across[b, k] + by * (
                        curvature * along[a, i] * along[b, k]
                        + size * (along[a, i] * turned[b, k] + turned[a, i] * along[b, k])
                        + gap * turned[a, i] * turned[b, k]
                    )
    return first, second


@long_running
def _write_in_space(places, f, K, force, stiffness):
    """Write force and stiffness of eight nodes along x, y, z from those along radius and y.

    Args:
        places: Places of the nodes. (8, 3) [m]
        f, K: As in `_write_touching`.
        force: Receives the forces. (24,) [N]
        stiffness: Receives the stiffness, with that from the turn of the radius. (24, 24) [N/m]
    """
    axes = np.zeros((8, 2, 3))
    force[:], stiffness[:] = 0.0, 0.0
    for a in range(8):
        x, z = places[a, 0], places[a, 2]
        radius = np.hypot(x, z)
        axes[a, 0, 0], axes[a, 0, 2], axes[a, 1, 1] = x / radius, z / radius, 1.0
        turn, at = f[a, 0] / radius**3, 3 * a
        stiffness[at, at], stiffness[at + 2, at + 2] = turn * z * z, turn * x * x
        stiffness[at, at + 2] = stiffness[at + 2, at] = -turn * x * z
    for p in range(24):
        a, i = p // 3, p % 3
        for m in range(2):
            force[p] += f[a, m] * axes[a, m, i]
            for q in range(24):
                b, k = q // 3, q % 3
                for n in range(2):
                    stiffness[p, q] += K[a, m, b, n] * axes[a, m, i] * axes[b, n, k]


@long_running
def add_contact(touching, curves, numbers, places, change, free, stiffness, band, rhs, forces):
    """Add force and stiffness of touching points to the equations of a Newton step.

    Args:
        touching: Touching points. (n, 8)
        curves: Radius and y of the nodes of the faces. (columns, 2, n, 2) [m]
        numbers: Numbers of these nodes. (columns, 2, n)
        places: Places of all nodes now. (nodes, 3) [m]
        change, free, band, rhs, forces: As in `equilibrium.write_system`.
        stiffness: Stiffness ε times the thickness. [Pa]
    """
    values, f, K = np.zeros((2, 3, 4)), np.zeros((8, 2)), np.zeros((8, 2, 8, 2))
    force, whole, nodes = np.zeros(24), np.zeros((24, 24)), np.zeros(8, dtype=np.int64)
    for row in touching:
        column, face, opposite = int(row[COLUMN]), int(row[FACE]), int(row[OTHER_FACE])
        curve, other = curves[column, face], curves[column, opposite]
        first, second = _write_touching(row, curve, other, stiffness, values, f, K)
        nodes[:4] = numbers[column, face, first : first + 4]
        nodes[4:] = numbers[column, opposite, second : second + 4]
        _write_in_space(places[nodes], f, K, force, whole)
        for p in range(24):
            node, i = nodes[p // 3], p % 3
            forces[node, i] += force[p]
            at = free[node, i]
            if at < 0:
                continue
            rhs[at] -= force[p]
            for q in range(24):
                rhs[at] -= whole[p, q] * change[nodes[q // 3], q % 3]
                below = free[nodes[q // 3], q % 3]
                if 0 <= below <= at:
                    band[at - below, below] += whole[p, q]
