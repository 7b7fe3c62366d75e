"""Equilibrium of a ring under a given motion of its rim: Newton's method on a banded system."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from wm_drake.compiler.compilation import long_running
from wm_drake.parameters.gasket_drawing import Rubber
from wm_drake.parameters.types import FloatArray
from wm_drake.solid.contact import STIFFNESS, add_contact, contact_energy
from wm_drake.solid.element import UNKNOWNS, element_energy, write_element
from wm_drake.solid.mesh import Ring
from wm_drake.solid.touching import Faces, Touching

TOLERANCE = 1e-7
"""Largest residual force, in the sizes of all forces within the elements."""

MOST_ITERATIONS = 20
"""Iterations after which a step of the rim is halved."""

SHORTEST = 1.0 / 64.0
"""Shortest part of a Newton step that the search along it tries."""

ENERGY_ROUNDING = 1e-10
"""Rise of the energy that counts as rounding, in parts of the energy."""

FIRST_SHIFT = 1e-8
"""First shift of a stiffness that is not positive definite, in its mean diagonal entry."""


class NoEquilibriumError(Exception):
    """Newton's method found no equilibrium."""


@long_running
def _in_axes(frames, u):
    """Return displacements of the nodes of an element along x, y, z. (27, 3)"""
    turned = np.zeros((27, 3))
    for a in range(27):
        for i in range(3):
            for k in range(3):
                turned[a, i] += frames[a, i, k] * u[a, k]
    return turned


@long_running
def _turn_into_axes(frames, f, K):
    """Turn force and stiffness of an element into the axes of its nodes, in place."""
    block, half = np.zeros((3, 3)), np.zeros((3, 3))
    for a in range(27):
        A = frames[a]
        f[3 * a : 3 * a + 3] = _times(A, f[3 * a : 3 * a + 3])
        for b in range(27):
            B = frames[b]
            block[:] = K[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
            for i in range(3):
                for k in range(3):
                    half[i, k] = (
                        block[i, 0] * B[0, k] + block[i, 1] * B[1, k] + block[i, 2] * B[2, k]
                    )
            for i in range(3):
                for k in range(3):
                    K[3 * a + i, 3 * b + k] = (
                        A[0, i] * half[0, k] + A[1, i] * half[1, k] + A[2, i] * half[2, k]
                    )


@long_running
def _times(A, f):
    """Return A^T f. (3,)"""
    turned = np.zeros(3)
    for i in range(3):
        for k in range(3):
            turned[i] += A[k, i] * f[k]
    return turned


@long_running
def total_energy(places, nodes, frames, u, c, bulk_modulus):
    """Return the strain energy of a part of a ring. [J]"""
    energy = 0.0
    for e in range(len(nodes)):
        energy += element_energy(places[e], _in_axes(frames[e], u[nodes[e]]), c, bulk_modulus)
    return energy


@long_running
def write_system(places, nodes, frames, u, change, free, c, bulk_modulus, band, rhs, forces):
    """Write the equations of a Newton step.

    Args:
        places, nodes, frames: As in `Ring`.
        u: Displacements. (nodes, 3) [m]
        change: Change of the given displacements in this step, zero for unknown ones. [m]
        free: Number of each unknown, -1 for given displacements. (nodes, 3)
        c, bulk_modulus: Constants of the rubber. [Pa]
        band: Receives the lower band of the stiffness. (width, unknowns) [N/m]
        rhs: Receives the negative residual at the changed displacements. (unknowns,) [N]
        forces: Receives the forces on all nodes. (nodes, 3) [N]

    Returns:
        Sum of the sizes of the elements' forces [N]; -1 if an element is turned inside out.
    """
    band[:], rhs[:], forces[:], size = 0.0, 0.0, 0.0, 0.0
    f, K, turned = np.zeros(UNKNOWNS), np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros(UNKNOWNS)
    for e in range(len(nodes)):
        if not write_element(places[e], _in_axes(frames[e], u[nodes[e]]), c, bulk_modulus, f, K):
            return -1.0
        _turn_into_axes(frames[e], f, K)
        size += np.sum(np.abs(f))
        for p in range(UNKNOWNS):
            turned[p] = change[nodes[e, p // 3], p % 3]
        for p in range(UNKNOWNS):
            node, i = nodes[e, p // 3], p % 3
            forces[node, i] += f[p]
            row = free[node, i]
            if row < 0:
                continue
            rhs[row] -= f[p]
            for q in range(UNKNOWNS):
                rhs[row] -= K[p, q] * turned[q]
                column = free[nodes[e, q // 3], q % 3]
                if 0 <= column <= row:
                    band[row - column, column] += K[p, q]
    return size


@dataclass(frozen=True)
class Solved:
    """Equilibrium at a motion of the rim.

    Attributes:
        u: Displacements of the nodes. (nodes, 3) [m]
        forces: Forces of the ring on its nodes, reversed: what holds it there. (nodes, 3) [N]
        energy: Energy of strain and contact of the whole ring. [J]
    """

    u: FloatArray
    forces: FloatArray
    energy: float


@dataclass(frozen=True)
class Numbering:
    """Numbers of the unknowns.

    Attributes:
        free: Number of each unknown, -1 for given displacements. (nodes, 3)
        width: Width of the lower band of the stiffness.
        size: Number of unknowns.
    """

    free: np.ndarray
    width: int
    size: int

    @classmethod
    def of(cls, given: np.ndarray, order: np.ndarray, groups: np.ndarray) -> "Numbering":
        """Number the unknowns.

        Args:
            given: Which displacements are given. (nodes, 3)
            order: Nodes in the order of their unknowns. (nodes,)
            groups: Nodes that are coupled. (groups, n)
        """
        free = np.full(given.shape, -1)
        unknown = ~given[order]
        numbers = np.where(unknown, np.cumsum(unknown).reshape(unknown.shape) - 1, -1)
        free[order] = numbers
        coupled = free[groups].reshape(len(groups), -1)
        lowest = np.where(coupled < 0, np.iinfo(int).max, coupled).min(axis=1)
        return cls(free, int(np.max(coupled.max(axis=1) - lowest)) + 1, int(unknown.sum()))


class Solver:
    """Equilibria of a ring, with the number of Newton iterations so far."""

    def __init__(self, ring: Ring, rubber: Rubber, has_contact: bool = False) -> None:
        """Number the unknowns; both rims are given.

        Touching folds couple all nodes of a column. Only while they touch, columns are numbered
        one after the other, which has a wider band.

        Args:
            has_contact: Whether folds are held off each other.
        """
        self.ring, self.iterations = ring, 0
        self._rubber = np.array(rubber.constants), rubber.bulk
        self._faces = Faces(ring) if has_contact else None
        self._contact_stiffness = STIFFNESS * 2.0 * rubber.constants[0]
        given = ring.locked.copy()
        given[ring.clamped], given[ring.moved] = True, True
        by_column = ring.grid.transpose(1, 0, 2)
        self._apart = Numbering.of(given, ring.grid.ravel(), ring.nodes)
        whole = by_column.reshape(len(by_column), -1)
        wide = whole if len(whole) == 1 else np.hstack([whole[:-2:2], whole[1::2], whole[2::2]])
        self._together = Numbering.of(given, by_column.ravel(), wide)

    def at_rest(self) -> Solved:
        """Return the ring as drawn."""
        zero = np.zeros_like(self.ring.positions)
        return Solved(zero, zero, 0.0)

    def solve(self, rim: FloatArray, start: Solved) -> Solved:
        """Return the equilibrium at a displacement of the nodes of the moved rim.

        Args:
            rim: Displacement of each node of the rim. (nodes of the rim, 3) [m]

        Raises:
            NoEquilibriumError: there is none within the allowed number of iterations.
        """
        ring, u, energy = self.ring, start.u.copy(), np.inf
        change = np.zeros_like(u)
        change[ring.moved] = rim - u[ring.moved]
        forces = np.zeros_like(u)
        for _ in range(MOST_ITERATIONS):
            self.iterations += 1
            free, band, rhs, size = self._system(u, change, forces)
            if size < 0.0 or not np.isfinite(rhs).all():
                break
            moves = bool(np.any(change))
            if not moves and np.abs(rhs).max() <= TOLERANCE * size:
                return Solved(u, forces, ring.copies * energy)
            unknown, is_stable = _downhill(band, rhs)
            step = change + np.append(unknown, 0.0)[free]
            u, energy = self._along(u, step, np.inf if moves or is_stable else energy)
            change[:] = 0.0
        raise NoEquilibriumError

    def _system(
        self, u: FloatArray, change: FloatArray, forces: FloatArray
    ) -> tuple[np.ndarray, FloatArray, FloatArray, float]:
        """Return the equations of a Newton step: numbers of the unknowns, band, right-hand side.

        Args:
            u: Displacements. [m]
            change: Change of the given displacements in this step. [m]
            forces: Receives the forces on all nodes. [N]

        Returns:
            The three, and the sum of the sizes of the elements' forces, as `write_system`.
        """
        touching = self.touching(u)
        numbering = self._together if touching else self._apart
        band, rhs = np.zeros((numbering.width, numbering.size)), np.zeros(numbering.size)
        size = write_system(
            *self._arrays, u, change, numbering.free, *self._rubber, band, rhs, forces
        )
        if touching and self._faces is not None:
            places = self.ring.positions + u
            add_contact(
                touching.rows, touching.curves, self._faces.numbers, places, change,
                numbering.free, self._contact_stiffness, band, rhs, forces,
            )  # fmt: skip
        return numbering.free, band, rhs, size

    def touching(self, u: FloatArray) -> Touching | None:
        """Return where folds touch at displacements of the nodes; None if they do not."""
        touching = self._faces.touching(u) if self._faces else None
        return touching if touching is not None and len(touching.rows) else None

    def _energy(self, u: FloatArray) -> float:
        """Return the energy of strain and contact of this part of the ring. [J]"""
        energy = float(total_energy(*self._arrays, u, *self._rubber))
        touching = self.touching(u)
        if touching is None:
            return energy
        return energy + float(contact_energy(touching.rows, self._contact_stiffness))

    @property
    def _arrays(self) -> tuple[np.ndarray, ...]:
        return self.ring.places, self.ring.nodes, self.ring.frames

    def _along(self, u: FloatArray, step: FloatArray, energy: float) -> tuple[FloatArray, float]:
        """Return displacements along a step, and their energy.

        Args:
            u: Displacements before the step. [m]
            step: Newton step. [m]
            energy: What their energy may not exceed; infinity takes the whole step. [J]

        Raises:
            NoEquilibriumError: there are none down to `SHORTEST`.
        """
        part = 1.0
        while part >= SHORTEST:
            trial = u + part * step
            reached = self._energy(trial)
            if reached <= energy + ENERGY_ROUNDING * abs(reached):
                return trial, reached
            if np.isinf(energy):
                break
            part *= 0.5
        raise NoEquilibriumError


def _downhill(band: FloatArray, rhs: FloatArray) -> tuple[FloatArray, bool]:
    """Return the solution of a symmetric system, and whether it is positive definite.

    If it is not, a wall is about to buckle. A shift of the diagonal then turns Newton's step
    towards the force, so that energy falls along it.
    """
    shift = FIRST_SHIFT * float(np.mean(band[0]))
    is_stable = True
    while True:
        try:
            solution = solveh_banded(band, rhs, lower=True, check_finite=False)
            return np.asarray(solution), is_stable
        except LinAlgError:
            band[0] += shift
            shift, is_stable = 10.0 * shift, False
