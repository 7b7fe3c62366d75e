"""Nodes and elements of a gasket: half the ring, or a thin wedge of which all others are copies.

One element through the wall, `meridian` along it. Nodes are numbered along the meridian last, so
that the system of equations has a narrow band.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.types import FloatArray
from wm_drake.solid.element import GRADIENTS

HALF_WEDGE = 0.01
"""Half the angle of a wedge; the arc's own error is its square. [rad]"""


@dataclass(frozen=True)
class Ring:
    """Part of a rubber ring with its rims.

    Attributes:
        places: Places of the nodes of each element as drawn. (elements, 27, 3) [m]
        nodes: Their numbers. (elements, 27)
        frames: Axes in which the unknowns of each node are, as columns. (elements, 27, 3, 3)
        positions: Places of the numbered nodes in these axes. (nodes, 3) [m]
        grid: Numbers of the nodes: along the meridian, around, through the wall. (n, m, 3)
        locked: Directions without displacement, by symmetry. (nodes, 3)
        angles: Part of the angle about the axis that belongs to each column. (m,) [rad]
        copies: Factor from the forces of this part to those of the whole ring.
        shown: Resultants that do not vanish by symmetry: force along x, y, z, moment about them.
    """

    places: FloatArray
    nodes: np.ndarray
    frames: FloatArray
    positions: FloatArray
    grid: np.ndarray
    locked: np.ndarray
    angles: FloatArray
    copies: float
    shown: tuple[bool, ...]

    @property
    def clamped(self) -> np.ndarray:
        """Numbers of the nodes of the rim at the housing."""
        return self.grid[0].ravel()

    @property
    def moved(self) -> np.ndarray:
        """Numbers of the nodes of the rim at the tub."""
        return self.grid[-1].ravel()

    @property
    def centre(self) -> FloatArray:
        """Centre of the rim at the tub: on the axis. (3,) [m]"""
        return np.array([0.0, float(np.mean(self.positions[self.moved, 1])), 0.0])


def half_ring(drawing: GasketDrawing, meridian: int, around: int) -> Ring:
    """Return the half of a ring with z >= 0, for motions symmetric about the plane z = 0."""
    angles = np.linspace(0.0, math.pi, 2 * around + 1)
    section, columns = _section(drawing, meridian), len(angles)
    positions = np.array([[_turned(section, angle)] for angle in angles])[:, 0]
    positions = positions.transpose(1, 0, 2, 3)  # station, angle, layer
    numbers = np.arange(positions[..., 0].size).reshape(positions.shape[:3])
    nodes = _elements(numbers)
    locked = np.zeros((numbers.size, 3), dtype=bool)
    locked[numbers[:, [0, columns - 1]].ravel(), 2] = True
    places = positions.reshape(-1, 3)
    frames = np.broadcast_to(np.eye(3), (*nodes.shape, 3, 3)).copy()
    shown = (True, True, False, False, False, True)
    parts = math.pi / (6.0 * around) * np.array([1.0, *([4.0, 2.0] * around)[:-1], 1.0])
    return _checked(Ring(places[nodes], nodes, frames, places, numbers, locked, parts, 2.0, shown))


def wedge(drawing: GasketDrawing, meridian: int) -> Ring:
    """Return a thin wedge of a ring, for motions along the axis and about it."""
    section, angles = _section(drawing, meridian), (-HALF_WEDGE, 0.0, HALF_WEDGE)
    turned = np.array([_turned(section, angle) for angle in angles]).transpose(1, 0, 2, 3)
    every = np.arange(turned[..., 0].size).reshape(turned.shape[:3])
    elements = _elements(every)
    one = np.arange(section[..., 0].size).reshape(section.shape[:2])
    shared = np.broadcast_to(one[:, None, :], every.shape)
    axes = np.array([axes_at(angle) for angle in angles])
    of_node = np.broadcast_to(axes[None, :, None], (*every.shape, 3, 3)).reshape(-1, 3, 3)
    return _checked(
        Ring(
            turned.reshape(-1, 3)[elements],
            shared.ravel()[elements],
            of_node[elements],
            _turned(section, 0.0).reshape(-1, 3),
            one[:, None, :],
            np.zeros((one.size, 3), dtype=bool),
            np.array([2.0 * HALF_WEDGE]),
            math.pi / HALF_WEDGE,
            (False, True, False, False, True, False),
        )
    )


def _section(drawing: GasketDrawing, meridian: int) -> FloatArray:
    """Return radius and y of the nodes in a plane through the axis. (stations, 3, 2) [m]"""
    line = drawing.stations(2 * meridian + 1)
    across = np.array([-0.5, 0.0, 0.5])[None, :, None] * line[:, None, 2:3]
    return line[:, None, :2] + across * line[:, None, 3:5]


def _turned(section: FloatArray, angle: float) -> FloatArray:
    """Return the nodes of a section at an angle about the axis. (stations, 3, 3) [m]"""
    radius, y = section[..., 0], section[..., 1]
    return np.stack([radius * math.cos(angle), y, radius * math.sin(angle)], axis=-1)


def axes_at(angle: float) -> FloatArray:
    """Return the radial, axial and circumferential direction as columns. (3, 3)"""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def _elements(numbers: np.ndarray) -> np.ndarray:
    """Return the nodes of each element: along the meridian, around, through the wall. (n, 27)"""
    stations, columns, _ = numbers.shape
    return np.array(
        [
            numbers[i : i + 3, j : j + 3].ravel()
            for i in range(0, stations - 2, 2)
            for j in range(0, columns - 2, 2)
        ]
    )


def _checked(ring: Ring) -> Ring:
    """Return a ring whose elements are not turned inside out.

    Raises:
        InputError: the wall bends too sharply for its thickness.
    """
    volumes = np.linalg.det(np.einsum("qna,enb->eqab", GRADIENTS, ring.places))
    if np.all(volumes > 0.0):
        return ring
    if np.all(volumes < 0.0):  # layers from outside to inside
        order = np.arange(27).reshape(9, 3)[:, ::-1].ravel()
        return replace(
            ring,
            places=ring.places[:, order],
            nodes=ring.nodes[:, order],
            frames=ring.frames[:, order],
        )
    message = "the wall bends too sharply for its thickness: the mesh crosses itself"
    raise input_error(message, key="meridian")
